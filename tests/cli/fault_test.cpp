// What goes wrong: exit codes, one-line messages, files that are whole or absent, interrupts.
#include <algorithm>
#include <fstream>
#include <sstream>
#include <vector>

#include "tests/cli/program.h"

namespace relief::test {
namespace {

/// Samples that no test waits for.
constexpr const char* kEndless = "16000000";

/// What is left of standard error without the lines that say how far a render was.
std::string without_log(const std::string& errors)
{
  std::istringstream lines(errors);
  std::string rest;
  for (std::string line; std::getline(lines, line);) {
    const bool is_log = line.find(": loaded in ") != std::string::npos || line.find(": built in ") != std::string::npos;
    if (!is_log) rest += line + "\n";
  }
  return rest;
}

class FaultyUse : public ProgramTest {
 protected:
  FaultyUse() : scene_(folder_.write("scene.gltf", lit_square().gltf()).string()) {}

  /// Expects failure with that code and one error line with that text, and no file left behind but the scene.
  void expect_failure(const Arguments& arguments, int exit_code, const std::string& text) const
  {
    Outcome outcome = run(arguments);
    outcome.errors = without_log(outcome.errors);
    std::string command;
    for (const std::string& a : arguments) command += a + " ";
    EXPECT_EQ(outcome.exit_code, exit_code) << command << outcome.errors;
    EXPECT_EQ(outcome.errors.rfind("relief: ", 0), 0u) << command << outcome.errors;
    EXPECT_NE(outcome.errors.find(text), std::string::npos) << command << "wants '" << text << "'\n" << outcome.errors;
    // One line, and perhaps a hint that is indented.
    const std::size_t end = outcome.errors.find('\n');
    EXPECT_TRUE(end + 1 == outcome.errors.size() || outcome.errors.compare(end + 1, 2, "  ") == 0) << outcome.errors;
    EXPECT_EQ(outcome.output, "") << command;
    EXPECT_EQ(files(), std::vector<std::string>{"scene.gltf"}) << command;
  }

  /// Starts an endless render and waits for its first samples.
  /// @return read end of its standard output
  std::unique_ptr<Process> start_endless(const std::string& output, const Arguments& more, int* read_end) const
  {
    int ends[2];
    EXPECT_EQ(::pipe2(ends, O_CLOEXEC), 0);
    Arguments all = {"--spp", kEndless};
    all.insert(all.end(), more.begin(), more.end());
    auto process = std::make_unique<Process>(render_arguments(scene_, output, all), ends[1], open_file("stderr"));
    EXPECT_TRUE(wait_for_samples(ends[0]));
    *read_end = ends[0];
    return process;
  }

  std::string scene_;
};

TEST_F(FaultyUse, UsageIsExitCodeTwoAndTouchesNoFile)
{
  const std::string out = file("a.exr");
  expect_failure({}, 2, "a command");
  expect_failure({"frobnicate"}, 2, "frobnicate");
  expect_failure({"render"}, 2, "scene is required");
  expect_failure({"render", scene_}, 2, "--output is required");
  expect_failure({"render", scene_, "other", "-o", out}, 2, "other");
  expect_failure({"render", scene_, "-o", file("a.jpg")}, 2, "--output: expected a name that ends in .exr");
  expect_failure({"render", scene_, "-o", ""}, 2, "--output: ");
  // One value each: their grammars are in arguments_test.cpp.
  const std::pair<const char*, const char*> kBad[] = {
      {"--spp", "0"},
      {"--resolution", "0x0"},
      {"--crop", "0,0,961,1"},
      {"--frames", "5-1"},
      {"--frames", ""},
      {"--seed", "-1"},
      {"--threads", "0"},
      {"--time-limit", "nan"},
      {"--exposure", "inf"},
      {"--noise-threshold", "nan"},
      {"--texture-memory", "nan"},
      {"--max-bounces", "-1"},
      {"--filter", "gauss"},
      {"--compression", "gzip"},
      {"--progress", "loud"},
      {"--aov", "depth,foo"},
      {"--camera", "nobody"},
      {"--png", "a.exr"},
      {"--stats", scene_.c_str()},
      {"--stats", out.c_str()},
      {"--reference", out.c_str()},
      {"--bogus", "1"},
  };
  for (const auto& [option, value] : kBad) expect_failure({"render", scene_, "-o", out, option, value}, 2, "--");
}

TEST_F(FaultyUse, HelpAndVersionAreNoErrors)
{
  for (const Arguments& arguments : {Arguments{"--help"}, {"--version"}, {"render", "--help"}, {"trace", "--help"}}) {
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.exit_code, 0);
    EXPECT_NE(outcome.output.find("relief"), std::string::npos);
    EXPECT_EQ(outcome.errors, "");
  }
}

TEST_F(FaultyUse, AnInvalidSceneIsExitCodeThree)
{
  const std::string out = file("a.exr");
  expect_failure({"render", file("missing.gltf"), "-o", out}, 3, "missing.gltf: expected");
  expect_failure({"render", file(""), "-o", out}, 3, "expected");
  expect_failure({"info", file("missing.gltf")}, 3, "missing.gltf: expected");
  expect_failure({"render", scene_, "-o", out, "--reference", file("missing.exr")}, 3, "missing.exr");
  folder_.write("scene.gltf", "{\"asset\": {\"version\": \"2.0\"}, \"scene\": 7}");
  expect_failure({"render", scene_, "-o", out}, 3, "scene.gltf: ");
  folder_.write("scene.gltf", "not JSON at all");
  expect_failure({"render", scene_, "-o", out}, 3, "scene.gltf: ");
}

// One run tells of all that is wrong with a scene's images, height maps and luminaires.
TEST_F(FaultyUse, TexturesThatCannotBeReadAreOneErrorOrMagenta)
{
  GltfBuilder b = lit_square();
  for (const char* uri : {"gone.png", "data:image/png;base64,iVBORw0KGgo=", "also_gone.jpg"}) {
    b.push("textures", {{"source", b.push("images", {{"uri", uri}})}});
  }
  b.push("materials",
         {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}, {"metallicFactor", 0}}},
          {"emissiveTexture", {{"index", 1}}},
          {"emissiveFactor", {1, 1, 1}},
          {"normalTexture", {{"index", 2}}},
          {"extensions", {{"RELIEF_displacement", {{"heightTexture", {{"uri", "heights.png"}}}, {"scale", 0.1}}}}}});
  b.json["meshes"][0]["primitives"][0]["material"] = 0;
  folder_.write("scene.gltf", b.gltf());
  const std::string out = file("a.exr");
  for (const char* name : {"gone.png", "/images/1", "also_gone.jpg", "heights.png"}) {
    expect_failure({"render", scene_, "-o", out}, 3, name);
    expect_failure({"info", scene_}, 3, name);
  }
  expect_failure({"render", scene_, "-o", out}, 3, "found 4 that cannot");
  const Outcome outcome = render(scene_, out, {"--continue-without-textures"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.errors;
  for (const char* name : {"gone.png", "/images/1", "also_gone.jpg", "heights.png"}) {
    EXPECT_NE(outcome.errors.find(name), std::string::npos) << outcome.errors;
  }
  const std::vector<float> red = values_of(out, "R"), green = values_of(out, "G");
  EXPECT_GT(*std::max_element(red.begin(), red.end()), 1) << "emission is 1, besides what is reflected";
  const auto brightest = static_cast<std::size_t>(std::max_element(red.begin(), red.end()) - red.begin());
  EXPECT_LT(green[brightest], 0.2) << "magenta";
}

TEST_F(FaultyUse, AReferenceOfAnotherSizeIsFoundBeforeTheRender)
{
  ASSERT_EQ(render(scene_, file("ref.exr")).exit_code, 0);
  const Outcome outcome = render(scene_, file("a.exr"), {"--resolution", "17x16", "--reference", file("ref.exr")});
  EXPECT_EQ(outcome.exit_code, 3);
  EXPECT_NE(outcome.errors.find("expected a picture of 17x16"), std::string::npos) << outcome.errors;
  EXPECT_FALSE(exists("a.exr"));
  EXPECT_EQ(outcome.output, "");
}

TEST_F(FaultyUse, AMissingFolderIsFoundBeforeTheRender)
{
  for (const Arguments& outputs : {Arguments{"-o", file("no/a.exr")},
                                   {"-o", file("a.exr"), "--png", file("no/a.png")},
                                   {"-o", file("a.exr"), "--stats", file("no/a.json")},
                                   {"-o", file("no/a.####.exr"), "--frames", "1-3"},
                                   {"-o", "/proc/a.exr"}}) {
    Arguments all = {"render", scene_, "--spp", kEndless};
    all.insert(all.end(), outputs.begin(), outputs.end());
    expect_failure(all, 1, "No such file or directory");
  }
  std::filesystem::create_directory(file("folder.exr"));
  const Outcome outcome = render(scene_, file("folder.exr"), {"--spp", kEndless});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_NE(outcome.errors.find("Is a directory"), std::string::npos);
}

TEST_F(FaultyUse, AFullDiskIsExitCodeOne)
{
  const Arguments kSmall = {"--resolution", "16x16", "--spp", "1"};
  Arguments all = {"render", scene_, "-o", "/dev/full"};
  all.insert(all.end(), kSmall.begin(), kSmall.end());
  expect_failure(all, 1, "/dev/full: No space left on device");
  folder_.write("rays.txt", "0 0 5 0 0 -1\n");
  for (const Arguments& arguments : {Arguments{"info", scene_}, {"trace", scene_, "--rays", file("rays.txt")}}) {
    Process process(arguments, ::open("/dev/full", O_WRONLY | O_CLOEXEC), open_file("stderr"));
    EXPECT_EQ(process.wait(), 1);
    EXPECT_NE(bytes_of_file(file("stderr")).find("No space left on device"), std::string::npos);
  }
}

TEST_F(FaultyUse, AFileThatFailsDoesNotCostThePictureButTheFrameIsNotDone)
{
  for (const char* option : {"--png", "--stats"}) {
    const Arguments full = {option, "/dev/full", "--resume"};
    for (int attempt = 0; attempt < 2; ++attempt) {
      const Outcome outcome = render(scene_, file("a.exr"), full);
      EXPECT_EQ(outcome.exit_code, 1);
      EXPECT_EQ(outcome.count("skipped"), 0);
      EXPECT_EQ(outcome.count("done"), 0);
      EXPECT_NE(outcome.errors.find("a.exr: saved"), std::string::npos) << outcome.errors;
      EXPECT_NE(outcome.errors.find("relief: /dev/full: No space left on device"), std::string::npos) << outcome.errors;
      EXPECT_EQ(exr_load(file("a.exr")).width, 16);
      EXPECT_EQ(files(), (std::vector<std::string>{"a.exr", "scene.gltf"}));
    }
  }
}

TEST_F(FaultyUse, AnOlderPictureSurvivesAFailedRender)
{
  folder_.write("a.exr", "an older picture");
  EXPECT_EQ(render(scene_, file("a.exr"), {"--camera", "nobody"}).exit_code, 2);
  EXPECT_EQ(render(file("missing.gltf"), file("a.exr")).exit_code, 3);
  EXPECT_EQ(bytes_of_file(file("a.exr")), "an older picture");
}

TEST_F(FaultyUse, AnInterruptSavesWhatIsRenderedAndExitsWith130)
{
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    int output = -1;
    const auto process = start_endless(file("a.exr"), {"--png", file("a.png"), "--stats", file("a.json")}, &output);
    process->signal(signal);
    EXPECT_EQ(process->wait(), 130) << signal;
    ::close(output);
    const Picture picture = exr_load(file("a.exr"));
    EXPECT_GT(std::stod(picture.attributes.at("relief:samples")), 0);
    EXPECT_EQ(picture.attributes.count("relief:fingerprint"), 0u);
    EXPECT_EQ(nlohmann::json::parse(bytes_of_file(file("a.json")))["stop_reason"], "interrupted");
    EXPECT_EQ(files(), (std::vector<std::string>{"a.exr", "a.json", "a.png", "scene.gltf"}));
    for (const char* name : {"a.exr", "a.png", "a.json"}) std::filesystem::remove(file(name));
  }
}

TEST_F(FaultyUse, AnInterruptEndsTheSequenceAndResumeStartsWithTheFrameThatWasCut)
{
  for (int attempt = 0; attempt < 2; ++attempt) {
    int output = -1;
    // In the second attempt a skipped frame would be the first line, and the next one's name would not be a.1.exr.
    const auto process = start_endless(file("a.#.exr"), {"--frames", "1-3", "--resume"}, &output);
    process->signal(SIGINT);
    EXPECT_EQ(process->wait(), 130);
    ::close(output);
    EXPECT_EQ(bytes_of_file(file("stderr")).find("already rendered"), std::string::npos);
    EXPECT_EQ(files(), (std::vector<std::string>{"a.1.exr", "scene.gltf"}));
  }
}

TEST_F(FaultyUse, ASecondInterruptEndsTheProgramAtOnce)
{
  int output = -1;
  const auto process = start_endless(file("a.exr"), {}, &output);
  // Stopped, so that both are pending when it runs again.
  process->signal(SIGSTOP);
  process->signal(SIGINT);
  process->signal(SIGTERM);
  process->signal(SIGCONT);
  EXPECT_EQ(process->wait(), 130);
  ::close(output);
  EXPECT_FALSE(exists("a.exr"));
}

TEST_F(FaultyUse, AReaderThatGoesAwayIsAnInterrupt)
{
  int output = -1;
  const auto process = start_endless(file("a.exr"), {}, &output);
  ::close(output);
  EXPECT_EQ(process->wait(), 130);
  EXPECT_EQ(exr_load(file("a.exr")).width, 16);
}

TEST_F(FaultyUse, ATerminalGetsABarAndTheBarGoesAway)
{
  const int terminal = ::posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
  ASSERT_GE(terminal, 0);
  ASSERT_EQ(::grantpt(terminal), 0);
  ASSERT_EQ(::unlockpt(terminal), 0);
  const int program_side = ::open(::ptsname(terminal), O_RDWR | O_NOCTTY | O_CLOEXEC);
  ASSERT_GE(program_side, 0);
  Process process({"render", scene_, "-o", file("a.exr"), "--resolution", "16x16", "--spp", "64", "--frames", "5"},
                  open_file("stdout"), program_side);
  std::string text;
  char buffer[4096];
  // The last reader of a terminal is told of its end by an error.
  for (ssize_t n = 0; (n = ::read(terminal, buffer, sizeof buffer)) > 0;) {
    text.append(buffer, static_cast<std::size_t>(n));
  }
  ::close(terminal);
  EXPECT_EQ(process.wait(), 0);
  EXPECT_NE(text.find("\rframe 5 ["), std::string::npos) << text;
  EXPECT_NE(text.find("100%"), std::string::npos) << text;
  EXPECT_NE(text.find("\r\033[K" + file("a.0005.exr") + ": 16x16"), std::string::npos) << text;
  EXPECT_EQ(bytes_of_file(file("stdout")), "");
}

}  // namespace
}  // namespace relief::test
