#include "exporters/exr.h"

#include <ImfChannelList.h>
#include <ImfChromaticitiesAttribute.h>
#include <ImfDoubleAttribute.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <ImfIntAttribute.h>
#include <ImfStandardAttributes.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "exporters/errors.h"
#include "tests/exporters/test_pictures.h"

namespace relief {

namespace {

constexpr ExrCompression kLossless[] = {ExrCompression::kNone, ExrCompression::kZips, ExrCompression::kZip,
                                        ExrCompression::kPiz};

float film_value(const TestFilm& film, Aov aov, std::size_t channel, int x, int y)
{
  return film_layer(film.view, aov).channels.at(channel).at(x, y);
}

}  // namespace

using ExrTest = FolderTest;

TEST_F(ExrTest, FloatsAndIdsComeBackExactlyThroughEveryLosslessCompression)
{
  // More rows than are packed at once, so that the blocks' seams are covered.
  const TestFilm film(37, 301, 1);
  ExrOptions options;
  options.float_color = true;
  for (const ExrCompression compression : kLossless) {
    options.compression = compression;
    exr_write(file("a.exr"), film.view, {}, options);
    const Picture picture = exr_load(file("a.exr"));
    EXPECT_FALSE(picture.lossy);
    for (const AovInfo& info : kAovInfo) {
      for (std::size_t c = 0; c < info.channels.size(); ++c) {
        const Channel* channel = picture.find(channel_name(info, c, film.view.light_groups));
        ASSERT_NE(channel, nullptr) << channel_name(info, c, film.view.light_groups);
        EXPECT_EQ(channel->type, info.integer_like ? ChannelType::kUint : ChannelType::kFloat);
        for (int y = 0; y < 301; ++y) {
          for (int x = 0; x < 37; ++x) {
            ASSERT_EQ(channel->values[static_cast<std::size_t>(y * 37 + x)], film_value(film, info.aov, c, x, y))
                << channel->name << " at " << x << "," << y;
          }
        }
      }
    }
  }
}

TEST_F(ExrTest, HalvesAreTheNearestOnesAndDataStaysFloat)
{
  const TestFilm film(20, 9, 2);
  exr_write(file("a.exr"), film.view, {});
  const Picture picture = exr_load(file("a.exr"));
  EXPECT_EQ(picture.find("R")->type, ChannelType::kHalf);
  EXPECT_EQ(picture.find("albedo.G")->type, ChannelType::kHalf);
  for (const char* name : {"depth.Z", "position.X", "uv.U", "variance.B", "half.R"}) {
    EXPECT_EQ(picture.find(name)->type, ChannelType::kFloat) << name;
  }
  for (int y = 0; y < 9; ++y) {
    for (int x = 0; x < 20; ++x) {
      const float truth = film_value(film, Aov::kBeauty, 0, x, y);
      EXPECT_LE(std::abs(picture.find("R")->values[static_cast<std::size_t>(y * 20 + x)] - truth), truth * 0x1p-11f);
      EXPECT_EQ(picture.find("depth.Z")->values[static_cast<std::size_t>(y * 20 + x)],
                film_value(film, Aov::kDepth, 0, x, y));
    }
  }
}

TEST_F(ExrTest, ValuesBeyondAHalfBecomeItsLargestAndNanStays)
{
  TestFilm film(4, 1, 3, aov_bit(Aov::kBeauty));
  film.pixels[0] = 1e9f;
  film.pixels[4] = -1e9f;
  film.pixels[8] = std::nanf("");
  film.pixels[12] = std::numeric_limits<float>::infinity();
  exr_write(file("a.exr"), film.view, {});
  const Picture picture = exr_load(file("a.exr"));
  const std::vector<float>& red = picture.find("R")->values;
  EXPECT_EQ(red[0], 65504.f);
  EXPECT_EQ(red[1], -65504.f);
  EXPECT_TRUE(std::isnan(red[2]));
  EXPECT_TRUE(std::isinf(red[3]));
}

TEST_F(ExrTest, ColoursOfAcescgHaveItsPrimariesInTheFileAndRec709InMemory)
{
  // From Rec.709 to ACEScg with Bradford's adaptation, as the Academy publishes it.
  constexpr double kMatrix[3][3] = {
      {0.613097, 0.339523, 0.047379}, {0.070194, 0.916354, 0.013452}, {0.020616, 0.109570, 0.869815}};
  const TestFilm film(21, 300, 5);
  exr_write(file("a.exr"), film.view, {}, {ExrCompression::kZip, true, ColorSpace::kAcescg});
  Imf::InputFile input(file("a.exr").string().c_str());
  const Imf::Chromaticities& found = Imf::chromaticities(input.header());
  EXPECT_NEAR(found.green.y, 0.830f, 1e-6f);
  EXPECT_NEAR(found.white.x, 0.32168f, 1e-6f);
  for (const auto& [layer, aov] : {std::pair("", Aov::kBeauty), {"albedo.", Aov::kAlbedo}}) {
    std::vector<float> stored[3];
    Imf::FrameBuffer buffer;
    for (std::size_t c = 0; c < 3; ++c) {
      stored[c].resize(21 * 300);
      buffer.insert(std::string(layer) + "RGB"[c],
                    Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(stored[c].data()), 4, 4 * 21));
    }
    input.setFrameBuffer(buffer);
    input.readPixels(0, 299);
    for (int y = 0; y < 300; ++y) {
      for (int x = 0; x < 21; ++x) {
        double sum = 0;
        for (std::size_t c = 0; c < 3; ++c) sum += double{std::abs(film_value(film, aov, c, x, y))};
        for (std::size_t c = 0; c < 3; ++c) {
          double expected = 0;
          for (std::size_t i = 0; i < 3; ++i) expected += kMatrix[c][i] * double{film_value(film, aov, i, x, y)};
          // The published white of D65 is rounded otherwise than ours.
          ASSERT_NEAR(stored[c][static_cast<std::size_t>(y * 21 + x)], expected, 2e-4 * sum) << layer << x << "," << y;
        }
      }
    }
  }
  const Picture picture = exr_load(file("a.exr"));
  for (const AovInfo& info : kAovInfo) {
    for (std::size_t c = 0; c < info.channels.size(); ++c) {
      const std::string name = channel_name(info, c, film.view.light_groups);
      const bool is_color = color_component(name).has_value();
      for (int y = 0; y < 300; ++y) {
        for (int x = 0; x < 21; ++x) {
          double size = 0;
          for (std::size_t i = 0; i < info.channels.size(); ++i) {
            size = std::max(size, double{std::abs(film_value(film, info.aov, i, x, y))});
          }
          ASSERT_NEAR(picture.find(name)->values[static_cast<std::size_t>(y * 21 + x)],
                      film_value(film, info.aov, c, x, y), is_color ? 2e-6 * size : 0)
              << name;
        }
      }
    }
  }
}

TEST(ColorSpace, OnlyColoursAreConverted)
{
  for (const char* name : {"R", "G", "B", "albedo.R", "denoised.G", "caustic.B", "direct.R", "light_group_a.b.R"}) {
    EXPECT_TRUE(color_component(name)) << name;
  }
  for (const char* name : {"A", "variance.R", "half.G", "denoised_error.B", "denoising_half.R", "normal.X", "depth.Z",
                           "CryptoObject00.R", "x.albedo.R", "RG", ""}) {
    EXPECT_FALSE(color_component(name)) << name;
  }
  const ColorMatrix matrix = color_matrix(ColorSpace::kRec709, ColorSpace::kAcescg);
  for (const auto& row : matrix) EXPECT_NEAR(row[0] + row[1] + row[2], 1, 1e-12);  // white stays white
}

TEST_F(ExrTest, DwaIsCloseAndSaysWhichLayersItDamages)
{
  // A smooth picture, as DWA is made for; its default level keeps such a picture within a hundredth.
  TestFilm film(64, 64, 4);
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) {
      for (int c = 0; c < 3; ++c) {
        film.pixels[static_cast<std::size_t>((y * 64 + x) * film.view.layout.num_floats + c)] =
            .5f + .4f * std::sin(.1f * static_cast<float>(x + (c + 1) * y));
      }
    }
  }
  ExrOptions options;
  options.compression = ExrCompression::kDwaa;
  exr_write(file("a.exr"), film.view, {}, options);
  const Picture picture = exr_load(file("a.exr"));
  EXPECT_TRUE(picture.lossy);
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) {
      EXPECT_NEAR(picture.find("R")->values[static_cast<std::size_t>(y * 64 + x)],
                  film_value(film, Aov::kBeauty, 0, x, y), .01f);
      EXPECT_EQ(picture.find("object_id.I")->values[static_cast<std::size_t>(y * 64 + x)],
                film_value(film, Aov::kObjectId, 0, x, y));
      EXPECT_EQ(picture.find("depth.Z")->values[static_cast<std::size_t>(y * 64 + x)],
                film_value(film, Aov::kDepth, 0, x, y));
    }
  }
  EXPECT_EQ(exr_damaged_layers(film.view.layout, ExrCompression::kDwaa),
            (std::vector<std::string>{"normal", "position", "variance", "half", "denoising_normal", "denoising_half"}));
  EXPECT_TRUE(exr_damaged_layers(film.view.layout, ExrCompression::kZip).empty());
}

TEST_F(ExrTest, ACropIsTheDataWindowInsideTheFullImage)
{
  TestFilm film(12, 7, 5);
  film.view.crop_x = 30;
  film.view.crop_y = 11;
  film.view.full_width = 100;
  film.view.full_height = 50;
  exr_write(file("a.exr"), film.view, {});
  const Imf::InputFile input(file("a.exr").c_str());
  EXPECT_EQ(input.header().displayWindow(), Imath::Box2i(Imath::V2i(0, 0), Imath::V2i(99, 49)));
  EXPECT_EQ(input.header().dataWindow(), Imath::Box2i(Imath::V2i(30, 11), Imath::V2i(41, 17)));
  const Picture picture = exr_load(file("a.exr"));
  EXPECT_EQ(picture.width, 12);
  EXPECT_EQ(picture.height, 7);
  EXPECT_EQ(picture.crop_x, 30);
  EXPECT_EQ(picture.crop_y, 11);
  EXPECT_EQ(picture.full_width, 100);
  EXPECT_EQ(picture.full_height, 50);
  EXPECT_EQ(picture.find("depth.Z")->values[0], film_value(film, Aov::kDepth, 0, 0, 0));
}

TEST_F(ExrTest, AttributesComeBackAsText)
{
  Statistics statistics;
  statistics.scene = "scène.glb";
  statistics.version = "0.1.0";
  statistics.seed = std::numeric_limits<std::uint64_t>::max();
  statistics.samples_per_pixel = 64;
  statistics.render_seconds = 12.5;
  statistics.error_rmse = .001;
  statistics.frame = 7;
  statistics.warnings = {"one", "two"};
  Attributes attributes = exr_attributes(statistics, "relief render scene.glb");
  attributes["studio:shot"] = "sq010_sh020";
  exr_write(file("a.exr"), TestFilm(3, 2, 6).view, attributes);
  const Picture picture = exr_load(file("a.exr"));
  for (const auto& [name, text] : attributes) {
    ASSERT_TRUE(picture.attributes.contains(name)) << name;
    EXPECT_EQ(picture.attributes.at(name), text);
  }
  EXPECT_EQ(picture.attributes.at("relief:seed"), "18446744073709551615");
  EXPECT_EQ(picture.attributes.at("relief:samples"), "64");
  EXPECT_EQ(picture.attributes.at("relief:warnings"), "one\ntwo");
  EXPECT_FALSE(picture.attributes.contains("relief:view"));  // empty ones are left out
}

TEST_F(ExrTest, NumbersAndMatricesAreSuchToEveryReader)
{
  Statistics statistics;
  statistics.seed = 4'000'000'001;
  statistics.samples_per_pixel = 64;
  statistics.render_seconds = 12.5;
  statistics.frame = 7;
  Attributes attributes = exr_attributes(statistics, "");
  Camera camera;
  camera.world_from_camera = {{0, 0, -1}, {0, 1, 0}, {1, 0, 0}, {5, 2, 3}};
  camera.half_width = 0.5f;
  camera.half_height = 0.25f;
  camera.shift_x = 0.1f;
  for (const auto& [name, text] : exr_camera_attributes(camera)) attributes[name] = text;
  exr_write(file("a.exr"), TestFilm(3, 2, 6).view, attributes);
  {
    const Imf::InputFile input(file("a.exr").c_str());
    const Imf::Header& header = input.header();
    EXPECT_EQ(header.typedAttribute<Imf::DoubleAttribute>("relief:seed").value(), 4'000'000'001.0);
    EXPECT_EQ(header.typedAttribute<Imf::DoubleAttribute>("relief:samples").value(), 64.0);
    EXPECT_EQ(header.typedAttribute<Imf::DoubleAttribute>("relief:seconds").value(), 12.5);
    EXPECT_EQ(header.typedAttribute<Imf::IntAttribute>("relief:frame").value(), 7);
    const std::string date = Imf::capDate(header);
    EXPECT_EQ(date.size(), 19u) << date;
    EXPECT_EQ(date[4], ':');
    EXPECT_TRUE(Imf::hasUtcOffset(header));
    // Two metres before the camera, which looks along −x, .5 m to its right and .25 m above.
    const Imath::V3f P(3, 2.25f, 2.5f);
    Imath::V3f in_camera, on_screen;
    Imf::worldToCamera(header).multVecMatrix(P, in_camera);
    EXPECT_NEAR((in_camera - Imath::V3f(0.5f, 0.25f, -2)).length(), 0, 1e-6);
    Imf::worldToNDC(header).multVecMatrix(P, on_screen);
    // Half of half the width, less the shift of a tenth of the whole; half of half the height.
    EXPECT_NEAR((on_screen - Imath::V3f(0.5f - 0.2f, 0.5f, 0.5f)).length(), 0, 1e-6);
    EXPECT_EQ(header.pixelAspectRatio(), 1);
    camera.projection = Projection::kOrthographic;
    camera.pixel_aspect = 1.5f;
  }
  for (const auto& [name, text] : exr_camera_attributes(camera)) attributes[name] = text;
  exr_write(file("b.exr"), TestFilm(3, 2, 6).view, attributes);
  const Imf::InputFile input(file("b.exr").c_str());
  Imath::V3f on_screen;
  Imf::worldToNDC(input.header()).multVecMatrix(Imath::V3f(3, 2.25f, 2.5f), on_screen);
  EXPECT_NEAR((on_screen - Imath::V3f(1 - 0.2f, 1, 2)).length(), 0, 1e-6);
  EXPECT_EQ(input.header().pixelAspectRatio(), 1.5f);
  EXPECT_FALSE(exr_load(file("a.exr")).attributes.contains("pixelAspectRatio"));
  camera.projection = Projection::kPanoramic;
  EXPECT_EQ(exr_camera_attributes(camera).size(), 1u) << "a panorama has no matrix, and no shape of its pixels";
  const Picture picture = exr_load(file("b.exr"));
  EXPECT_EQ(picture.attributes.at("pixelAspectRatio"), "1.5");
  EXPECT_EQ(picture.attributes.at("relief:seed"), "4000000001");
  exr_write(file("c.exr"), picture);
  EXPECT_EQ(exr_load(file("c.exr")).attributes, picture.attributes);
}

TEST_F(ExrTest, SaysItsPrimariesAreRec709)
{
  exr_write(file("a.exr"), TestFilm(3, 2, 7).view, {});
  const Imf::InputFile input(file("a.exr").c_str());
  ASSERT_TRUE(Imf::hasChromaticities(input.header()));
  const Imf::Chromaticities primaries = Imf::chromaticities(input.header());
  EXPECT_FLOAT_EQ(primaries.red.x, .64f);
  EXPECT_FLOAT_EQ(primaries.green.y, .6f);
  EXPECT_FLOAT_EQ(primaries.blue.x, .15f);
  EXPECT_FLOAT_EQ(primaries.white.x, .3127f);
}

TEST_F(ExrTest, KeepsOnlyTheLayersOfTheFilm)
{
  const TestFilm film(3, 2, 8, aov_bit(Aov::kBeauty) | aov_bit(Aov::kNormal));
  exr_write(file("a.exr"), film.view, {});
  EXPECT_EQ(picture_layers(exr_load(file("a.exr"))), (std::vector<std::string>{"beauty", "normal"}));
}

TEST_F(ExrTest, APictureIsWrittenAsItWasRead)
{
  const TestFilm film(19, 23, 9);
  exr_write(file("a.exr"), film.view, {{"relief:seed", "3"}});
  const Picture a = exr_load(file("a.exr"));
  exr_write(file("b.exr"), a);
  EXPECT_EQ(bytes_of_file(file("a.exr")), bytes_of_file(file("b.exr")));
}

TEST_F(ExrTest, AFailedWriteLeavesTheOldPicture)
{
  write_bytes(file("a.exr"), "old");
  // "channels" is OpenEXR's own attribute and no text.
  EXPECT_THROW(exr_write(file("a.exr"), TestFilm(3, 2, 10).view, {{"channels", "x"}}), OutputError);
  EXPECT_THROW(exr_write(file("a.exr"), FilmView{}, {}), OutputError);
  EXPECT_EQ(bytes_of_file(file("a.exr")), "old");
  EXPECT_EQ(files_in_folder(), std::vector<std::string>{"a.exr"});
  EXPECT_THROW(exr_write(file("nowhere/a.exr"), TestFilm(3, 2, 10).view, {}), OutputError);
}

TEST_F(ExrTest, AFullDiskIsAnError)
{
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
  EXPECT_THROW(exr_write("/dev/full", TestFilm(300, 300, 11).view, {}), OutputError);
}

TEST_F(ExrTest, TheSameFilmGivesTheSameBytesWhateverTheThreads)
{
  const TestFilm film(200, 300, 12);
  exr_use_threads(0);
  exr_write(file("a.exr"), film.view, {});
  exr_use_threads(4);
  exr_write(file("b.exr"), film.view, {});
  EXPECT_EQ(bytes_of_file(file("a.exr")), bytes_of_file(file("b.exr")));
}

TEST(PictureLayer, PutsRedGreenBlueFirstAndLeavesAlphaOut)
{
  Picture picture;
  picture.width = picture.height = 1;
  for (const char* name : {"A", "B", "G", "R", "albedo.B", "albedo.G", "albedo.R", "depth.Z", "mask.A"}) {
    picture.channels.push_back({name, ChannelType::kFloat, {1.f}});
  }
  const auto names = [&](std::string_view layer) {
    std::string text;
    for (const ChannelView& channel : picture_layer(picture, layer).channels) {
      text += channel.name + " ";
    }
    return text;
  };
  EXPECT_EQ(names("beauty"), "R G B ");
  EXPECT_EQ(names(""), "R G B ");
  EXPECT_EQ(names("albedo"), "albedo.R albedo.G albedo.B ");
  EXPECT_EQ(names("depth"), "depth.Z ");
  EXPECT_EQ(names("mask"), "mask.A ");
  EXPECT_EQ(names("nothing"), "");
}

TEST_F(ExrTest, CryptomattesAreLaidOutAsTheirSpecificationSays)
{
  Scene scene;
  for (const char* name : {"ball", "floor"}) {
    scene.instances.emplace_back();
    scene.instances.back().name = name;
  }
  scene.material_names = {"say \"cheese\"\n", "\xff"};
  const TestFilm film(4, 3, 1, 1u | aov_bit(Aov::kCryptoObject) | aov_bit(Aov::kCryptoMaterial));
  exr_write(file("a.exr"), film.view, exr_cryptomatte_attributes(scene, kAllAovs));
  const Picture picture = exr_load(file("a.exr"));
  for (const char* layer : {"CryptoObject00.", "CryptoObject01.", "CryptoObject02.", "CryptoMaterial02."}) {
    for (const char* channel : {"r", "g", "b", "a"}) {
      const Channel* found = picture.find(std::string(layer) + channel);
      ASSERT_NE(found, nullptr) << layer << channel;
      EXPECT_EQ(found->type, ChannelType::kFloat);
    }
  }
  EXPECT_EQ(picture.find("CryptoObject03.r"), nullptr);
  // Ids are bits, not numbers: none may be rounded.
  const std::size_t offset =
      static_cast<std::size_t>(film.view.layout.offset[static_cast<std::size_t>(Aov::kCryptoObject)]);
  EXPECT_EQ(picture.find("CryptoObject00.r")->values[0], film.pixels[offset]);
  EXPECT_EQ(picture.find("CryptoObject02.a")->values[0], film.pixels[offset + 11]);

  // Keys are the first seven digits of the layer's hash.
  const auto text = [&](const std::string& name) { return picture.attributes.at("cryptomatte/" + name); };
  EXPECT_EQ(text("3ae39a5/name"), "CryptoObject");
  EXPECT_EQ(text("3ae39a5/hash"), "MurmurHash3_32");
  EXPECT_EQ(text("3ae39a5/conversion"), "uint32_to_float32");
  EXPECT_EQ(text("3ae39a5/manifest"), R"({"ball":"645d3bc4","floor":"7819c83c"})");
  EXPECT_EQ(text("be359d6/name"), "CryptoMaterial");
  EXPECT_NE(text("be359d6/manifest").find(R"("say \"cheese\"\n":")"), std::string::npos);
  EXPECT_EQ(text("f42029d/name"), "CryptoAsset");
}

}  // namespace relief
