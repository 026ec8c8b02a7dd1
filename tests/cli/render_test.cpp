// `relief render` as a technical director uses it: frames, windows, seeds, references, statistics, progress.
#include <cmath>
#include <regex>
#include <sstream>

#include "tests/cli/program.h"

namespace relief::test {
namespace {

class RenderProgram : public ProgramTest {
 protected:
  std::string write_scene(const GltfBuilder& b) const { return folder_.write("scene.gltf", b.gltf()).string(); }
};

/// The square moves by two metres along +x in the first second.
GltfBuilder moving_square(const char* interpolation)
{
  GltfBuilder b = lit_square();
  const bool is_spline = interpolation == std::string("CUBICSPLINE");
  const int times = b.accessor<float>({0, 1}, "SCALAR");
  // A spline has a tangent before and after each value; all of them are zero.
  const int values = is_spline ? b.accessor<float>({0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0, 0, 0}, "VEC3")
                               : b.accessor<float>({0, 0, 0, 2, 0, 0}, "VEC3");
  b.push("animations", {{"samplers", {{{"input", times}, {"output", values}, {"interpolation", interpolation}}}},
                        {"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "translation"}}}}}}});
  return b;
}

/// Horizontal centre of what covers the picture, in pixels.
double center_of_coverage(const std::string& exr)
{
  const Picture picture = exr_load(exr);
  const std::vector<float>& alpha = picture.find("A")->values;
  double sum = 0, moment = 0;
  for (std::size_t i = 0; i < alpha.size(); ++i) {
    sum += double{alpha[i]};
    moment += double{alpha[i]} * (static_cast<double>(i % static_cast<std::size_t>(picture.width)) + .5);
  }
  return moment / sum;
}

TEST_F(RenderProgram, ALogGetsWhatIsSaidBelowWhatItHas)
{
  const std::string scene = write_scene(lit_square()), log = folder_.write("run.log", "before\n").string();
  EXPECT_EQ(render(scene, file("a.exr"), {"--spp", "1", "--log", log}).exit_code, 0);
  EXPECT_EQ(render(scene, file("a.exr"), {"--environment", "missing.png", "--log", log}).exit_code, 3);
  const std::string text = bytes_of_file(log);
  EXPECT_TRUE(text.starts_with("before\n")) << text;
  const std::regex lines("before\n(\\d{4}-\\d\\d-\\d\\dT\\d\\d:\\d\\d:\\d\\dZ [^\n]+\n)+");
  EXPECT_TRUE(std::regex_match(text, lines)) << text;
  EXPECT_NE(text.find("a.exr: 16x16, 1 samples a pixel in "), std::string::npos) << text;
  EXPECT_NE(text.find("relief: "), std::string::npos) << text;
  EXPECT_NE(text.find("missing.png"), std::string::npos) << text;

  const std::string before = bytes_of_file(scene);
  EXPECT_EQ(render(scene, file("b.exr"), {"--log", scene}).exit_code, 2);
  EXPECT_EQ(bytes_of_file(scene), before);
  const Outcome unwritable = render(scene, file("b.exr"), {"--log", file("nowhere/run.log")});
  EXPECT_EQ(unwritable.exit_code, 1);
  EXPECT_NE(unwritable.errors.find("nowhere/run.log"), std::string::npos) << unwritable.errors;
  EXPECT_FALSE(std::filesystem::exists(file("b.exr")));
}

TEST_F(RenderProgram, FramesMoveWhatTheAnimationMoves)
{
  // 32 pixels show four metres: the square's middle, at 0.5 m, is at pixel 12 and goes 16 pixels to the right. A quarter
  // second is frame 6.
  const std::pair<const char*, double> kQuarters[] = {
      {"STEP", 12}, {"LINEAR", 12 + 16 * .25}, {"CUBICSPLINE", 12 + 16 * .15625}};
  for (const auto& [interpolation, quarter] : kQuarters) {
    const std::string scene = write_scene(moving_square(interpolation));
    const Outcome outcome = render(
        scene, file("f.##.exr"), {"--frames", "0,6-24x18", "--resolution", "32x32", "--spp", "64", "--filter", "box"});
    ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
    EXPECT_EQ(outcome.count("done"), 3);
    // A pixel's coverage at an edge is known to about a 64th.
    EXPECT_NEAR(center_of_coverage(file("f.00.exr")), 12, .05) << interpolation;
    EXPECT_NEAR(center_of_coverage(file("f.06.exr")), quarter, .05) << interpolation;
    EXPECT_NEAR(center_of_coverage(file("f.24.exr")), 28, .05) << interpolation;
  }
}

TEST_F(RenderProgram, CausticsStandStillFromFrameToFrame)
{
  // The noise of a still scene is that of its seed, and not another one in each frame: a caustic does not flicker.
  const std::string scene = write_scene(mirrored_lamp());
  const Arguments frames = {"--frames", "3,4", "--resolution", "16x16", "--spp", "2", "--aov", "beauty,caustic", "--caustics", "on"};
  const Outcome outcome = render(scene, file("f.#.exr"), frames);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  const std::vector<float> caustic = values_of(file("f.3.exr"), "caustic.R");
  EXPECT_GT(*std::max_element(caustic.begin(), caustic.end()), 0.0f);
  EXPECT_EQ(caustic, values_of(file("f.4.exr"), "caustic.R"));
  EXPECT_EQ(values_of(file("f.3.exr"), "R"), values_of(file("f.4.exr"), "R"));
}

TEST_F(RenderProgram, PreviewsShowThePictureSoFarAndChangeNothing)
{
  const std::string scene = write_scene(lit_square());
  for (const Arguments& more : {Arguments{}, {"--noise-threshold", "0.02"}, {"--crop", "3,5,60,40"}}) {
    Arguments settings = {"--resolution", "96x96", "--spp", "100"};
    settings.insert(settings.end(), more.begin(), more.end());
    ASSERT_EQ(render(scene, file("plain.exr"), settings).exit_code, 0);
    settings.insert(settings.end(), {"--preview", file("p.exr")});
    const Outcome outcome = render(scene, file("watched.exr"), settings);
    ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
    for (const char* channel : {"R", "G", "B", "A", "samples.N", "half.R"}) {
      EXPECT_EQ(values_of(file("plain.exr"), channel), values_of(file("watched.exr"), channel)) << channel;
    }
    // The first comes with the first sample, another not within half a second.
    ASSERT_GE(outcome.count("preview"), 1) << outcome.output;
    for (const nlohmann::json& event : outcome.events()) {
      if (event["event"] != "preview") continue;
      EXPECT_EQ(event["samples"], 1);
      EXPECT_EQ(event["output"], file("p.exr"));
      break;
    }
    const Picture preview = exr_load(file("p.exr")), picture = exr_load(file("watched.exr"));
    EXPECT_EQ(preview.width, picture.width);
    EXPECT_EQ(preview.crop_x, picture.crop_x);
    ASSERT_EQ(preview.channels.size(), 4u);
    double sums[2] = {};
    for (const float v : preview.find("G")->values) sums[0] += double{v};
    for (const float v : picture.find("G")->values) sums[1] += double{v};
    EXPECT_NEAR(sums[0], sums[1], .02 * sums[1]);
  }
}

TEST_F(RenderProgram, APreviewThatCannotBeWrittenCostsAWarning)
{
  const std::string scene = write_scene(lit_square());
  std::filesystem::create_symlink("/dev/full", file("p.exr"));
  const Outcome outcome = render(scene, file("a.exr"), {"--preview", file("p.exr"), "--spp", "40"});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_NE(outcome.errors.find("no more previews"), std::string::npos) << outcome.errors;
  EXPECT_TRUE(exists("a.exr"));
  // It is an output like the others.
  EXPECT_EQ(render(scene, file("a.exr"), {"--preview", file("a.exr")}).exit_code, 2);
}

TEST_F(RenderProgram, EveryOutputOfAFrameHasItsNumber)
{
  const Outcome outcome = render(write_scene(lit_square()), file("a.exr"),
                                 {"--frames", "3,12", "--png", file("#_a.png"), "--stats", file("a.###.json")});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  EXPECT_EQ(files(), (std::vector<std::string>{"12_a.png", "3_a.png", "a.0003.exr", "a.0012.exr", "a.003.json",
                                               "a.012.json", "scene.gltf"}));
  EXPECT_EQ(nlohmann::json::parse(bytes_of_file(file("a.012.json")))["frame"], 12);
}

TEST_F(RenderProgram, ResumeSkipsWhatIsWholeAndRendersTheRest)
{
  const std::string scene = write_scene(moving_square("LINEAR")), output = file("f.#.exr");
  const Arguments frames = {"--frames", "1-4", "--resume"};
  EXPECT_EQ(render(scene, output, frames).count("done"), 4);
  Outcome again = render(scene, output, frames);
  EXPECT_EQ(again.exit_code, 0);
  EXPECT_EQ(again.count("done"), 0);
  EXPECT_EQ(again.count("skipped"), 4);

  std::filesystem::remove(file("f.2.exr"));
  std::filesystem::resize_file(file("f.3.exr"), std::filesystem::file_size(file("f.3.exr")) / 2);
  folder_.write("f.4.exr", "not a picture");
  again = render(scene, output, frames);
  EXPECT_EQ(again.count("done"), 3) << again.output;
  EXPECT_EQ(again.count("skipped"), 1);
  EXPECT_EQ(exr_load(file("f.3.exr")).width, 16);
}

TEST_F(RenderProgram, ResumeNoticesOtherSettingsAndAnotherScene)
{
  const std::string scene = write_scene(lit_square()), output = file("a.exr");
  // Each differs from the one before.
  for (const Arguments& more : {Arguments{},
                                {"--seed", "2"},
                                {"--spp", "5"},
                                {"--max-bounces", "0"},
                                {"--crop", "0,0,8,8"},
                                {"--filter", "box"},
                                {"--aov", "depth"},
                                {"--float"},
                                {"--compression", "piz"},
                                {}}) {
    Arguments arguments = {"--resume"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    EXPECT_EQ(render(scene, output, arguments).count("done"), 1) << (more.empty() ? "" : more[0]);
  }
  EXPECT_EQ(render(scene, output, {"--resume"}).count("skipped"), 1);
  write_scene(moving_square("STEP"));
  EXPECT_EQ(render(scene, output, {"--resume"}).count("done"), 1);
}

TEST_F(RenderProgram, ResumeKnowsSettingsThatAreTheSame)
{
  GltfBuilder b = lit_square();
  b.json["extensions"]["RELIEF_render"] = {
      {"resolution", {16, 16}}, {"samples", 4}, {"pixelFilter", {{"type", "box"}}}};
  const std::string scene = write_scene(b), output = file("a.exr");
  const auto resume = [&](const Arguments& more) {
    Arguments arguments = {"render", scene, "-o", output, "--progress", "json", "--resume"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  };
  ASSERT_EQ(resume({}).count("done"), 1);
  for (const Arguments& same : {Arguments{"--spp", "4"},
                                {"--resolution", "16x16", "--filter", "box"},
                                {"--seed", "0", "--exposure", "0.0"},
                                {"--caustics", "auto"}}) {
    EXPECT_EQ(resume(same).count("skipped"), 1) << same[0];
  }
  EXPECT_EQ(resume({"--caustics", "off"}).count("done"), 1);
  EXPECT_EQ(resume({"--caustics", "off", "--spp", "5"}).count("done"), 1);
}

TEST_F(RenderProgram, ResumeWantsEveryFileOfAFrame)
{
  const std::string scene = write_scene(lit_square());
  Arguments arguments = {"--resume", "--png", file("a.png"), "--stats", file("a.json")};
  ASSERT_EQ(render(scene, file("a.exr"), arguments).count("done"), 1);
  ASSERT_EQ(render(scene, file("a.exr"), arguments).count("skipped"), 1);
  for (const char* name : {"a.png", "a.json", "a.exr"}) {
    std::filesystem::remove(file(name));
    EXPECT_EQ(render(scene, file("a.exr"), arguments).count("done"), 1) << name;
    EXPECT_TRUE(exists(name));
  }
  arguments.insert(arguments.end(), {"--exposure", "1"});
  EXPECT_EQ(render(scene, file("a.exr"), arguments).count("done"), 1);
}

TEST_F(RenderProgram, TheSameSeedGivesTheSameBits)
{
  const std::string scene = write_scene(lit_square());
  ASSERT_EQ(render(scene, file("a.exr"), {"--seed", "3", "--aov", "all"}).exit_code, 0);
  ASSERT_EQ(render(scene, file("b.exr"), {"--seed", "3", "--aov", "all", "--threads", "1"}).exit_code, 2)
      << "an option that is given twice is a mistake";
  Arguments one_thread = render_arguments(scene, file("b.exr"), {"--seed", "3", "--aov", "all"});
  *(std::find(one_thread.begin(), one_thread.end(), "--threads") + 1) = "1";
  ASSERT_EQ(run(one_thread).exit_code, 0);
  ASSERT_EQ(render(scene, file("c.exr"), {"--seed", "4", "--aov", "all"}).exit_code, 0);
  const Picture a = exr_load(file("a.exr")), b = exr_load(file("b.exr"));
  ASSERT_EQ(a.channels.size(), b.channels.size());
  for (std::size_t c = 0; c < a.channels.size(); ++c) {
    EXPECT_EQ(a.channels[c].values, b.channels[c].values) << a.channels[c].name;
  }
  EXPECT_NE(values_of(file("a.exr"), "R"), values_of(file("c.exr"), "R"));
}

TEST_F(RenderProgram, MergedSeedsAreTheirMeanByWeight)
{
  const std::string scene = write_scene(lit_square());
  ASSERT_EQ(render(scene, file("a.exr"), {"--seed", "1", "--spp", "4", "--float"}).exit_code, 0);
  ASSERT_EQ(render(scene, file("b.exr"), {"--seed", "2", "--spp", "12", "--float"}).exit_code, 0);
  ASSERT_EQ(run({"merge", file("a.exr"), file("b.exr"), "-o", file("m.exr")}).exit_code, 0);
  const std::vector<float> a = values_of(file("a.exr"), "G"), b = values_of(file("b.exr"), "G"),
                           m = values_of(file("m.exr"), "G");
  for (std::size_t i = 0; i < m.size(); ++i) EXPECT_NEAR(m[i], (a[i] + 3 * b[i]) / 4, 1e-6f) << i;
  EXPECT_EQ(values_of(file("m.exr"), "samples.N")[0], 16);
}

TEST_F(RenderProgram, ACropIsAWindowOfTheWholePicture)
{
  const std::string scene = write_scene(lit_square());
  ASSERT_EQ(render(scene, file("whole.exr"), {"--resolution", "24x20"}).exit_code, 0);
  ASSERT_EQ(render(scene, file("crop.exr"), {"--resolution", "24x20", "--crop", "5,3,17,16"}).exit_code, 0);
  const Picture crop = exr_load(file("crop.exr"));
  EXPECT_EQ(crop.width, 12);
  EXPECT_EQ(crop.height, 13);
  EXPECT_EQ(crop.crop_x, 5);
  EXPECT_EQ(crop.crop_y, 3);
  EXPECT_EQ(crop.full_width, 24);
  const std::vector<float> whole = values_of(file("whole.exr"), "R");
  for (int y = 0; y < 13; ++y) {
    for (int x = 0; x < 12; ++x) {
      ASSERT_EQ(crop.find("R")->values[static_cast<std::size_t>(y * 12 + x)],
                whole[static_cast<std::size_t>((y + 3) * 24 + x + 5)])
          << x << "," << y;
    }
  }
}

TEST_F(RenderProgram, StatisticsHaveTheirKeysAndCountEveryCameraRay)
{
  const Outcome outcome = render(write_scene(lit_square()), file("a.exr"), {"--stats", file("s.json"), "--seed", "9"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  const nlohmann::json s = nlohmann::json::parse(bytes_of_file(file("s.json")));
  for (const char* key :
       {"scene", "version", "isa", "load_seconds", "build_seconds", "render_seconds", "rays_per_second", "error_rmse",
        "error_relmse", "peak_memory_bytes", "bvh_bytes", "mesh_bytes", "texture_bytes", "film_bytes",
        "path_state_bytes", "light_bytes", "counters", "stage_seconds", "warnings"}) {
    EXPECT_TRUE(s.contains(key)) << key;
  }
  EXPECT_EQ(s["seed"], 9);
  EXPECT_EQ(s["width"], 16);
  EXPECT_EQ(s["samples_per_pixel"], 4);
  EXPECT_EQ(s["stop_reason"], "samples");
  EXPECT_EQ(s["rays"]["camera"], 16 * 16 * 4);
  EXPECT_EQ(s["rays"]["total"],
            s["rays"]["camera"].get<int>() + s["rays"]["bounce"].get<int>() + s["rays"]["shadow"].get<int>());
  EXPECT_GT(s["peak_memory_bytes"], s["film_bytes"]);
}

TEST_F(RenderProgram, ProgressIsOneJsonObjectALine)
{
  const Outcome outcome = render(write_scene(lit_square()), file("a.exr"), {"--spp", "256", "--resolution", "64x64"});
  const std::vector<nlohmann::json> events = outcome.events();
  ASSERT_GE(events.size(), 2u);
  double fraction = 0;
  for (std::size_t i = 0; i + 1 < events.size(); ++i) {
    EXPECT_EQ(events[i]["event"], "progress");
    for (const char* key : {"frame", "samples", "photons", "seconds", "seconds_left", "rays_per_second"}) {
      EXPECT_TRUE(events[i][key].is_number()) << key;
    }
    EXPECT_GT(events[i]["memory_bytes"], 0);
    EXPECT_GE(events[i]["peak_memory_bytes"], events[i]["memory_bytes"]);
    EXPECT_GE(events[i]["fraction"], fraction);
    fraction = events[i]["fraction"];
  }
  EXPECT_EQ(fraction, 1);
  EXPECT_EQ(events.back()["event"], "done");
  EXPECT_EQ(events.back()["output"], file("a.exr"));
  EXPECT_EQ(events.back()["samples"], 256);
  EXPECT_EQ(events.back()["stop_reason"], "samples");
}

TEST_F(RenderProgram, OneSampleSaysNothingAboutItsError)
{
  const Outcome outcome = render(write_scene(lit_square()), file("a.exr"), {"--spp", "1", "--stats", file("s.json")});
  EXPECT_NE(outcome.errors.find("error unknown"), std::string::npos) << outcome.errors;
  EXPECT_TRUE(outcome.events().back()["error_rmse"].is_null());
  EXPECT_TRUE(nlohmann::json::parse(bytes_of_file(file("s.json")))["error_rmse"].is_null());
}

TEST_F(RenderProgram, APipeGetsNoBar)
{
  const Outcome outcome = run({"render", write_scene(lit_square()), "-o", file("a.exr"), "--resolution", "16x16"});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_EQ(outcome.output, "");
  EXPECT_EQ(outcome.errors.find_first_of("\r\033["), std::string::npos) << outcome.errors;
  EXPECT_NE(outcome.errors.find("samples a pixel"), std::string::npos);
}

TEST_F(RenderProgram, TheErrorAgainstAReferenceIsThatOfCompare)
{
  const std::string scene = write_scene(lit_square());
  ASSERT_EQ(render(scene, file("ref.exr"), {"--spp", "64", "--float"}).exit_code, 0);
  const Outcome rendered = render(scene, file("a.exr"), {"--seed", "5", "--float", "--reference", file("ref.exr")});
  ASSERT_EQ(rendered.exit_code, 0) << rendered.errors;
  const Outcome compared = run({"compare", file("a.exr"), file("ref.exr"), "--json", "-"});
  const double rmse = nlohmann::json::parse(compared.output)["rmse"];
  EXPECT_GT(rmse, 0);
  EXPECT_NEAR(rendered.events().back()["reference_rmse"].get<double>(), rmse, 1e-6 * rmse);

  // Without JSON it is a line; a crop is compared with its window of the reference.
  const Outcome crop = run({"render", scene, "-o", file("c.exr"), "--resolution", "16x16", "--spp", "64", "--crop",
                            "2,3,11,13", "--float", "--reference", file("ref.exr")});
  EXPECT_NE(crop.output.find("RMSE 0, relMSE 0"), std::string::npos) << crop.output << crop.errors;
}

TEST_F(RenderProgram, WarningsAreShownOnceAndStrictMakesThemErrors)
{
  GltfBuilder b = lit_square();
  b.json["extensionsUsed"].push_back("VENDOR_nothing_we_know");
  const std::string scene = write_scene(b);
  const Outcome lenient = render(scene, file("a.#.exr"), {"--frames", "1-3"});
  EXPECT_EQ(lenient.exit_code, 0);
  const std::size_t first = lenient.errors.find("relief: warning: ");
  ASSERT_NE(first, std::string::npos);
  EXPECT_NE(lenient.errors.find("VENDOR_nothing_we_know"), std::string::npos);
  EXPECT_EQ(lenient.errors.find("relief: warning: ", first + 1), std::string::npos) << lenient.errors;
  const Outcome strict = render(scene, file("b.exr"), {"--strict"});
  EXPECT_EQ(strict.exit_code, 3);
  EXPECT_NE(strict.errors.find("expected no warnings (--strict), found 1"), std::string::npos) << strict.errors;
  EXPECT_FALSE(exists("b.exr"));
  EXPECT_EQ(run({"info", scene, "--strict"}).exit_code, 3);
  EXPECT_EQ(run({"info", scene}).exit_code, 0);
}

TEST_F(RenderProgram, ASettingThatNothingReadsIsAWarning)
{
  const Outcome outcome = render(write_scene(lit_square()), file("a.exr"), {"--view", "Filmic", "--exposure", "1"});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_NE(outcome.errors.find("--view has no effect without --png"), std::string::npos);
  EXPECT_NE(outcome.errors.find("--exposure has no effect without --png"), std::string::npos);
}

TEST_F(RenderProgram, ACompressionThatRoundsDataIsAWarning)
{
  const std::string scene = write_scene(lit_square());
  const Outcome lossy = render(scene, file("a.exr"), {"--compression", "dwaa", "--aov", "variance,depth"});
  EXPECT_EQ(lossy.exit_code, 0) << lossy.errors;
  EXPECT_NE(lossy.errors.find("the layer 'variance'"), std::string::npos) << lossy.errors;
  EXPECT_EQ(lossy.errors.find("the layer 'depth'"), std::string::npos) << lossy.errors;
  EXPECT_EQ(render(scene, file("b.exr"), {"--aov", "variance"}).errors.find("--compression"), std::string::npos);
}

TEST_F(RenderProgram, ADisplacedSquareIsHitWhereItIs)
{
  GltfBuilder b = lit_square();
  b.json["extensionsUsed"].push_back("RELIEF_displacement");
  b.push("images", {{"uri", kPixelPng}});
  b.push("textures", {{"source", 0}});
  // The map's only texel has no red, so that every point moves back by half the scale.
  b.push("materials", {{"name", "bark"},
                       {"extensions", {{"RELIEF_displacement", {{"heightTexture", {{"index", 0}}}, {"scale", 0.5}}}}}});
  b.json["meshes"][0]["primitives"][0]["material"] = 0;
  const std::string scene = write_scene(b);
  folder_.write("rays.txt", "0.5 0.25 3 0 0 -1\n");
  EXPECT_EQ(render(scene, file("a.exr")).exit_code, 0);
  const Outcome outcome = run({"trace", scene, "--rays", file("rays.txt")});
  const std::size_t line = outcome.output.find("\n1,");
  ASSERT_NE(line, std::string::npos) << outcome.output << outcome.errors;
  std::istringstream numbers(outcome.output.substr(line + 1));
  // The last bit is the processor's: Embree's kernels round each in their way.
  for (const double expected : {1.0, 3.25, 0.5, 0.25, -0.25, 0.0, 0.0, 1.0}) {
    double number = 0;
    char comma = 0;
    numbers >> number >> comma;
    EXPECT_NEAR(number, expected, 1e-6) << outcome.output;
  }
}

TEST_F(RenderProgram, APictureKnowsItsCommandLine)
{
  const std::string scene = write_scene(lit_square());
  ASSERT_EQ(render(scene, file("a picture's.exr"), {"--seed", "7"}).exit_code, 0);
  const Attributes attributes = exr_load(file("a picture's.exr")).attributes;
  EXPECT_EQ(attributes.at("relief:seed"), "7");
  const std::string command = attributes.at("relief:command");
  EXPECT_EQ(command.substr(0, 14), "relief render ");
  // As a shell would need it.
  EXPECT_NE(command.find("a picture'\\''s.exr' "), std::string::npos) << command;
}

TEST_F(RenderProgram, PathsNeedNotBeUtf8)
{
  const std::string scene = folder_.write("sc\xe9ne.gltf", lit_square().gltf()).string();
  const Outcome outcome =
      render(scene, file("caf\xe9.exr"), {"--png", file("caf\xe9.png"), "--stats", file("caf\xe9.json")});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.errors;
  EXPECT_EQ(outcome.count("done"), 1);
  for (const char* name : {"caf\xe9.exr", "caf\xe9.png", "caf\xe9.json"}) EXPECT_TRUE(exists(name));
  EXPECT_TRUE(nlohmann::json::accept(bytes_of_file(file("caf\xe9.json"))));
}

}  // namespace
}  // namespace relief::test
