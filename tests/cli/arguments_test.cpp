// The grammar of option values, as tables.
#include "cli/arguments.h"

#include <gtest/gtest.h>

#include "kernel/film/film_layout.h"

namespace relief {
namespace {

TEST(Frames, GrammarAndOrder)
{
  const std::pair<const char*, std::vector<int>> kCases[] = {
      {"7", {7}},
      {"0", {0}},
      {"1-4", {1, 2, 3, 4}},
      {"5-5", {5}},
      {"1-10x4", {1, 5, 9}},
      {"1-2x9", {1}},
      {"3,1,2", {3, 1, 2}},
      {"1-3,2-4,1", {1, 2, 3, 4}},
      {"1-3,20,30-36x2", {1, 2, 3, 20, 30, 32, 34, 36}},
      {"007", {7}},
      {"999999-1000000", {999999, 1000000}},
      {"999999-1000000x2147483647", {999999}},
  };
  for (const auto& [text, frames] : kCases) EXPECT_EQ(parse_frames(text).numbers, frames) << text;
  EXPECT_EQ(parse_frames("0-1000000").numbers.size(), 1000001u);
}

TEST(Frames, AnythingElseIsRefused)
{
  for (const char* text : {"",
                           " ",
                           ",",
                           "1,",
                           ",1",
                           "1,,2",
                           "-",
                           "-1",
                           "1-",
                           "1--2",
                           "5-1",
                           "1-10x",
                           "1-10x0",
                           "1-10x-2",
                           "1x2",
                           "x2",
                           "1-2-3",
                           "1 - 2",
                           "1- 2",
                           " 1",
                           "1 ",
                           "+1",
                           "1.5",
                           "0x10",
                           "nan",
                           "1-1000001",
                           "99999999999999999999",
                           "1-2x99999999999",
                           "a"}) {
    EXPECT_THROW(parse_frames(text), CLI::ValidationError) << "'" << text << "'";
  }
}

TEST(Frames, AreSaidShortAndReadBack)
{
  EXPECT_EQ(frames_text({1, 2, 3, 7, 9, 8, 10, 11}), "1-3,7,9,8,10-11");
  for (const char* text : {"1-3", "0", "5,4,3", "1-10x3,2", "7,1000000"}) {
    const std::vector<int> frames = parse_frames(text).numbers;
    EXPECT_EQ(parse_frames(frames_text(frames)).numbers, frames) << text;
  }
}

TEST(Part, PartsAreAllSamplesOnceAndBeginAtMultiplesOfFour)
{
  for (const int samples : {4, 16, 17, 64, 100, 1023, 2147483647}) {
    for (const int count : {1, 2, 3, 5, 7, 25, 255}) {
      if (count > 1 && samples < 4 * count) {
        EXPECT_THROW(part_samples({1, count}, samples), CLI::ValidationError);
        continue;
      }
      std::uint32_t next = 0;
      for (int i = 1; i <= count; ++i) {
        const auto [first, end] = part_samples({i, count}, samples);
        EXPECT_EQ(first, next);
        EXPECT_EQ(first % 4, 0u);
        EXPECT_GT(end, first);
        // As even as can be.
        EXPECT_LE(static_cast<double>(end - first), static_cast<double>(samples) / count + 7);
        next = end;
      }
      EXPECT_EQ(next, static_cast<std::uint32_t>(samples));
    }
  }
  EXPECT_EQ(part_samples({}, 1).second, 1u);
  EXPECT_EQ(parse_part("3/4").number, 3);
  for (const char* text : {"0/4", "5/4", "1", "1/", "/4", "1/4/4", "-1/4", "a/b", "1/2000000", ""}) {
    EXPECT_THROW(parse_part(text), CLI::ValidationError) << text;
  }
}

TEST(Frames, NameAFile)
{
  EXPECT_EQ(frame_path("out/shot.####.exr", 7), "out/shot.0007.exr");
  EXPECT_EQ(frame_path("shot#.exr", 123), "shot123.exr");
  EXPECT_EQ(frame_path("shot.##.exr", 123), "shot.123.exr");
  EXPECT_EQ(frame_path("shot.exr", 7), "shot.0007.exr");
  EXPECT_EQ(frame_path("a#b.##.exr", 7), "a#b.07.exr");
  EXPECT_EQ(frame_path("take#2/shot.exr", 7), "take#2/shot.0007.exr");
  EXPECT_EQ(frame_path("shot", 7), "shot.0007");
}

TEST(Resolution, IsTwoNumbersInRange)
{
  const Resolution size = parse_resolution("1920x1080");
  EXPECT_EQ(size.width, 1920);
  EXPECT_EQ(size.height, 1080);
  EXPECT_EQ(parse_resolution("1x65536").height, 65536);
  for (const char* text : {"", "x", "10", "10x", "x10", "0x10", "10x0", "-1x1", "65537x1", "10x10x10", "10X10",
                           "10 x 10", "1e2x1", "99999999999x1"}) {
    EXPECT_THROW(parse_resolution(text), CLI::ValidationError) << "'" << text << "'";
  }
}

TEST(Crop, IsAWindowThatIsNotEmpty)
{
  const PixelRect rect = parse_crop("1,2,30,40");
  EXPECT_EQ(rect.x0, 1);
  EXPECT_EQ(rect.y0, 2);
  EXPECT_EQ(rect.x1, 30);
  EXPECT_EQ(rect.y1, 40);
  for (const char* text :
       {"", "1,2,3", "1,2,3,4,5", "5,0,5,9", "6,0,5,9", "0,5,9,5", "-1,0,5,5", "a,b,c,d", "0,0,1.5,2"}) {
    EXPECT_THROW(parse_crop(text), CLI::ValidationError) << "'" << text << "'";
  }
}

TEST(Pixel, HasASampleIfOneIsGiven)
{
  const PixelSample pixel = parse_pixel("3,4,4294967295");
  EXPECT_EQ(pixel.x, 3);
  EXPECT_EQ(pixel.y, 4);
  EXPECT_EQ(pixel.sample_index, 4294967295u);
  EXPECT_EQ(parse_pixel("3,4").sample_index, 0u);
  for (const char* text : {"", "3", "3,", "3,4,5,6", "-3,4", "3,-4", "3,4,-1", "3,4,4294967296", "x,y"}) {
    EXPECT_THROW(parse_pixel(text), CLI::ValidationError) << "'" << text << "'";
  }
}

TEST(Lod, IsALevelOrChosenByRays)
{
  EXPECT_EQ(parse_lod("auto"), -1);
  EXPECT_EQ(parse_lod("1.5"), 1.5f);
  EXPECT_EQ(parse_lod("0"), 0);
  EXPECT_EQ(parse_lod("30"), 30);
  for (const char* text : {"", "-1", "31", "1x", "inf", "Auto", "nan"}) {
    EXPECT_THROW(parse_lod(text), CLI::ValidationError) << "'" << text << "'";
  }
}

TEST(Point, IsThreeNumbersInReach)
{
  EXPECT_EQ(parse_point("--look-at", "1,-2.5,3e4"), (Vec3f{1, -2.5f, 3e4f}));
  for (const char* text : {"", "1,2", "1,2,3,4", "1,2,x", "1,2,nan", "1,2,inf", "1,2,1e16", "1;2;3", " 1,2,3"}) {
    EXPECT_THROW(parse_point("--look-at", text), CLI::ValidationError) << "'" << text << "'";
  }
}

TEST(Environment, IsAWordOrAnImagePerhapsWithAStrength)
{
  const auto is = [](const char* text, EnvironmentSource source, const char* file, float strength) {
    const EnvironmentChoice c = parse_environment(text);
    EXPECT_EQ(c.source, source) << text;
    if (source == EnvironmentSource::kFile) {
      EXPECT_EQ(c.file, file);
    }
    EXPECT_EQ(c.strength, strength) << text;
  };
  is("studio", EnvironmentSource::kStudio, "", 1);
  is("sky,0.5", EnvironmentSource::kSky, "", 0.5f);
  is("none", EnvironmentSource::kNone, "", 1);
  is("a.hdr", EnvironmentSource::kFile, "a.hdr", 1);
  is("./studio,2", EnvironmentSource::kFile, "./studio", 2);
  is("a,b.hdr", EnvironmentSource::kFile, "a,b.hdr", 1);
  is("a,1.hdr,3e2", EnvironmentSource::kFile, "a,1.hdr", 300);
  for (const char* text : {"", ",1", "sky,-1", "sky,inf", "sky,nan", "sky,1e7"}) {
    EXPECT_THROW(parse_environment(text), CLI::ValidationError) << "'" << text << "'";
  }
}

TEST(Seed, IsAnyNumberOf64Bits)
{
  EXPECT_EQ(parse_seed("0"), 0u);
  EXPECT_EQ(parse_seed("18446744073709551615"), 18446744073709551615u);
  for (const char* text : {"", "-1", "18446744073709551616", "1e3", "0x1", "nan"}) {
    EXPECT_THROW(parse_seed(text), CLI::ValidationError) << "'" << text << "'";
  }
}

TEST(Aovs, AlwaysHaveTheBeauty)
{
  EXPECT_EQ(parse_aovs("beauty"), 1u);
  EXPECT_EQ(parse_aovs("depth,depth"), 1u | aov_bit(Aov::kDepth));
  EXPECT_EQ(parse_aovs("uv,all"), kAllAovs);
  for (const char* text : {"", "foo", "all,foo", "depth,", "Depth", "depth uv"}) {
    EXPECT_THROW(parse_aovs(text), CLI::ValidationError) << "'" << text << "'";
  }
}

TEST(OutputName, HasTheSuffixOfItsFormatOrIsADevice)
{
  for (const char* text : {"a.exr", "b/a.EXR", "a.b.exr", "####.exr", "/dev/null"}) {
    EXPECT_EQ(parse_output("--output", text, ".exr"), text);
  }
  for (const char* text : {"", "a", "a.png", "exr", ".exr", "a.exr.png", "/tmp", "."}) {
    EXPECT_THROW(parse_output("--output", text, ".exr"), CLI::ValidationError) << "'" << text << "'";
  }
}

TEST(RmipOptions, LevelsAreInterpolatedBetweenBilinearCells)
{
  EXPECT_EQ(parse_rmip("scale=4").levels, RmipLevels::kMixed);
  EXPECT_EQ(parse_rmip("levels=mixed,leaf=triangles").levels, RmipLevels::kMixed);
  EXPECT_EQ(parse_rmip("levels=interpolated,scale=4").levels, RmipLevels::kInterpolated);
  for (const char* text : {"levels", "levels=1", "levels=mixed,levels=mixed", "levels=interpolated,leaf=triangles",
                           "leaf=triangles,levels=interpolated"})
    EXPECT_ANY_THROW(parse_rmip(text)) << text;
}

TEST(RmipOptions, BoundsAreHullsOrAffine)
{
  EXPECT_EQ(parse_rmip("scale=4").bounds, SpaceBounds::kHull);
  EXPECT_EQ(parse_rmip("bounds=affine,scale=4").bounds, SpaceBounds::kAffine);
  for (const char* text : {"bounds", "bounds=box", "bounds=hull,bounds=affine"})
    EXPECT_ANY_THROW(parse_rmip(text)) << text;
}

/// Empty if the check accepts the text.
std::string verdict(const CLI::Validator& check, std::string text) { return check(text); }

TEST(Numbers, AreCheckedWhole)
{
  const CLI::Validator samples = whole_number(1, 100);
  for (const char* text : {"1", "100", "007"}) EXPECT_EQ(verdict(samples, text), "") << text;
  for (const char* text : {"", "0", "101", "-5", "1.0", "1e1", "nan", "5 ", "99999999999"}) {
    EXPECT_NE(verdict(samples, text), "") << "'" << text << "'";
  }
  EXPECT_EQ(verdict(samples, "0"), "expected a whole number from 1 to 100, found '0'");

  const CLI::Validator threshold = number(0, 1.5);
  for (const char* text : {"0", "1.5", "1e-3", "-0", ".5"}) EXPECT_EQ(verdict(threshold, text), "") << text;
  for (const char* text : {"", "nan", "-nan", "inf", "-inf", "-1", "1.6", "1e999", "0.5x", "0,5"}) {
    EXPECT_NE(verdict(threshold, text), "") << "'" << text << "'";
  }
  EXPECT_EQ(verdict(one_of({"bar", "json"}), "foo"), "expected one of bar, json, found 'foo'");
  EXPECT_EQ(verdict(one_of({"bar", "json"}), "bar"), "");
}

}  // namespace
}  // namespace relief
