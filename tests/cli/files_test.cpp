// Files that must not be lost: an output is never an input or another output under any name, --resume believes no file that it
// cannot vouch for, and nothing is left behind.
#include <chrono>
#include <fstream>
#include <set>
#include <sstream>
#include <thread>

#include <sys/file.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include "tests/cli/program.h"

namespace relief::test {
namespace {

namespace fs = std::filesystem;

/// Samples that no test waits for.
constexpr const char* kEndless = "16000000";

/// One grey pixel, as a file.
std::string grey_png()
{
  const std::string_view uri = kGreyPixelPng;
  return from_base64(uri.substr(uri.find(',') + 1));
}

/// The same as a picture.
Picture grey_picture()
{
  Picture picture;
  picture.width = picture.height = picture.full_width = picture.full_height = 1;
  for (const char* name : {"R", "G", "B"}) picture.channels.push_back({name, ChannelType::kFloat, {0.5f}});
  return picture;
}

class FilesOfARun : public ProgramTest {
 protected:
  FilesOfARun() { write_scene(".png"); }

  /// A scene with every kind of file that one can be made of.
  /// @param suffix  of its maps; reading .exr takes a quarter of a second
  void write_scene(const std::string& suffix)
  {
    GltfBuilder b = lit_square();
    folder_.write("displaced.bin", b.binary);
    b.json["buffers"] = {{{"byteLength", b.binary.size()}, {"uri", "displaced.bin"}}};
    folder_.write("part.gltf", b.gltf());
    folder_.write("cobbles.png", grey_png());
    for (const std::string name : {"heights", "sky"}) {
      if (suffix == ".png") {
        folder_.write(name + suffix, grey_png());
      } else {
        exr_write(file(name + suffix), grey_picture());
      }
    }
    b.json["extensionsUsed"] = {"RELIEF_environment", "RELIEF_displacement", "RELIEF_reference"};
    b.json["extensions"]["RELIEF_environment"] = {{"uri", "sky" + suffix}};
    b.json["images"] = {{{"uri", "cobbles.png"}}, {{"uri", "heights" + suffix}}};
    b.json["textures"] = {{{"source", 0}}, {{"source", 1}}};
    b.json["materials"] = {
        {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}},
         {"extensions", {{"RELIEF_displacement", {{"heightTexture", {{"index", 1}}}, {"scale", 0.01}}}}}}};
    b.json["meshes"][0]["primitives"][0]["material"] = 0;
    b.root_node({{"translation", {-2, 0, 0}}, {"extensions", {{"RELIEF_reference", {{"uri", "part.gltf"}}}}}});
    scene_ = folder_.write("scene.gltf", b.gltf()).string();
    folder_.write("rays.txt", "0 0 5 0 0 -1\n");
  }

  /// Everything in the folder, with its bytes or where it links to.
  std::map<std::string, std::string> state() const
  {
    std::map<std::string, std::string> found;
    for (const auto& entry : fs::recursive_directory_iterator(folder_ / "")) {
      const std::string name = entry.path().string();
      if (name == file("stdout") || name == file("stderr")) continue;
      found[name] = entry.is_symlink()        ? "-> " + fs::read_symlink(entry.path()).string()
                    : entry.is_regular_file() ? bytes_of_file(name)
                                              : "";
    }
    return found;
  }

  /// Expects that the run refuses the option's file and changes nothing.
  void expect_refused(const Arguments& arguments, const std::string& option) const
  {
    const auto before = state();
    const Outcome outcome = run(arguments);
    std::string command;
    for (const std::string& a : arguments) command += a + " ";
    EXPECT_EQ(outcome.exit_code, 2) << command << outcome.errors;
    const std::size_t at = outcome.errors.find("relief: " + option + ": expected a file that ");
    EXPECT_NE(at, std::string::npos) << command << outcome.errors;
    EXPECT_TRUE(state() == before) << command << "changed a file";
  }

  Arguments tiny(Arguments arguments) const
  {
    arguments.insert(arguments.end(), {"--resolution", "8x8", "--spp", "1", "--progress", "none"});
    return arguments;
  }

  std::string scene_;
};

TEST_F(FilesOfARun, TheSceneWithAllItsFilesRenders)
{
  const Outcome outcome = run(tiny({"render", scene_, "-o", file("a.exr"), "--strict"}));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.errors;
}

TEST_F(FilesOfARun, NoOutputIsAnInputByAnyName)
{
  fs::create_directory(file("folder"));
  fs::create_directory_symlink(folder_ / "", file("elsewhere"));
  const std::string a = file("a.exr");
  for (const char* input : {"scene.gltf", "displaced.bin", "part.gltf", "cobbles.png", "heights.png", "sky.png"}) {
    fs::create_symlink(input, file("link"));
    fs::create_hard_link(file(input), file("twin"));
    for (const std::string& name : {file(input), file("link"), file("twin"), file("folder/../") + input,
                                    file("elsewhere/") + input, fs::relative(file(input)).string()}) {
      expect_refused(tiny({"render", scene_, "-o", a, "--stats", name}), "--stats");
    }
    expect_refused({"trace", scene_, "--rays", file("rays.txt"), "-o", file("twin")}, "--output");
    expect_refused({"trace", scene_, "--pixel", "1,1", "-o", file("link")}, "--output");
    fs::remove(file("link"));
    fs::remove(file("twin"));
  }
  expect_refused(tiny({"render", scene_, "-o", a, "--png", file("cobbles.png")}), "--png");
  expect_refused({"trace", scene_, "--rays", file("rays.txt"), "-o", file("rays.txt")}, "--output");
  write_scene(".exr");
  expect_refused(tiny({"render", scene_, "-o", file("heights.exr")}), "--output");
  expect_refused(tiny({"render", scene_, "-o", file("sky.exr")}), "--output");
}

TEST_F(FilesOfARun, NoFrameOverwritesAReferenceOfAnyFrame)
{
  ASSERT_EQ(run(tiny({"render", scene_, "-o", file("ref.exr")})).exit_code, 0);
  fs::copy_file(file("ref.exr"), file("r.0002.exr"));
  fs::create_hard_link(file("r.0002.exr"), file("x.3.exr"));
  const Arguments frames = tiny({"render", scene_, "--frames", "1-3"});
  const auto with = [&](const std::string& output, const std::string& reference) {
    Arguments all = frames;
    all.insert(all.end(), {"-o", file(output), "--reference", file(reference)});
    return all;
  };
  expect_refused(with("r.exr", "r.0002.exr"), "--output");
  expect_refused(with("r.##.exr", "r.0#.exr"), "--output");
  expect_refused(with("r.#.exr", "r.#.exr"), "--output");
  expect_refused(with("x.#.exr", "r.0002.exr"), "--output");
  expect_refused(tiny({"render", scene_, "-o", file("ref.exr"), "--reference", file("ref.exr")}), "--output");
}

TEST_F(FilesOfARun, NoOutputIsAnotherOutputOfAnyFrame)
{
  const auto expect = [&](const Arguments& more, const char* option) {
    Arguments all = tiny({"render", scene_});
    all.insert(all.end(), more.begin(), more.end());
    expect_refused(all, option);
  };
  const std::string out = file("a.exr");
  expect({"-o", out, "--stats", out}, "--stats");
  expect({"-o", out, "--stats", file("A.EXR")}, "--stats");
  fs::create_symlink("a.exr", file("later"));
  expect({"-o", out, "--stats", file("later")}, "--stats");
  // Frame 11 of the one is frame 1 of the other.
  expect({"-o", file("a.1#.exr"), "--stats", file("a.#1.exr"), "--frames", "1-11"}, "--stats");
  folder_.write("b.0001.exr", "an older picture");
  fs::create_symlink("b.0001.exr", file("b.0002.exr"));
  expect({"-o", file("b.exr"), "--frames", "1,2"}, "--output");
  fs::create_hard_link(file("b.0001.exr"), file("b.0003.exr"));
  expect({"-o", file("b.exr"), "--frames", "1,3"}, "--output");
  fs::create_symlink("a.json", file("a.html"));
  expect_refused({"bench", "displacement", "--json", file("a.json"), "--html", file("a.html")}, "--html");
}

TEST_F(FilesOfARun, AnImageThatNothingUsesIsTheScenesAllTheSame)
{
  GltfBuilder b = lit_square();
  folder_.write("unused.0001.png", grey_png());
  b.json["images"] = {{{"uri", "unused.0001.png"}}};
  const std::string scene = folder_.write("unused.gltf", b.gltf()).string();
  expect_refused(tiny({"render", scene, "-o", file("a.exr"), "--png", file("unused.png"), "--frames", "1"}), "--png");
}

TEST_F(FilesOfARun, AFolderAmongTheFramesIsFoundBeforeTheFirst)
{
  fs::create_directory(file("a.0002.exr"));
  const auto before = state();
  const Outcome outcome = run(tiny({"render", scene_, "-o", file("a.exr"), "--frames", "1-3"}));
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_NE(outcome.errors.find("a.0002.exr: Is a directory"), std::string::npos) << outcome.errors;
  EXPECT_TRUE(state() == before);
}

TEST_F(FilesOfARun, CompareAndMergeKeepTheirPictures)
{
  ASSERT_EQ(run(tiny({"render", scene_, "-o", file("A.exr")})).exit_code, 0);
  ASSERT_EQ(run(tiny({"render", scene_, "-o", file("B.exr"), "--seed", "2"})).exit_code, 0);
  fs::create_symlink("A.exr", file("link"));
  fs::create_hard_link(file("B.exr"), file("twin.exr"));
  fs::create_hard_link(file("B.exr"), file("twin.png"));
  const Arguments pictures = {file("A.exr"), file("B.exr")};
  const auto with = [&](const char* command, const Arguments& more) {
    Arguments all = {command};
    all.insert(all.end(), pictures.begin(), pictures.end());
    all.insert(all.end(), more.begin(), more.end());
    return all;
  };
  for (const char* name : {"A.exr", "B.exr", "link", "twin.exr"}) {
    expect_refused(with("compare", {"--json", file(name)}), "--json");
  }
  expect_refused(with("compare", {"--diff", file("twin.png")}), "--diff");
  expect_refused(with("compare", {"--diff", file("d.png"), "--json", file("d.png")}), "--json");
  expect_refused(with("merge", {"-o", file("A.exr")}), "--output");
  expect_refused(with("merge", {"-o", file("twin.exr")}), "--output");
  // A name says what is in the file.
  for (const Arguments& arguments :
       {with("merge", {"-o", file("m.png")}), with("compare", {"--diff", file("d.exr")})}) {
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_NE(outcome.errors.find("expected a name that ends in ."), std::string::npos) << outcome.errors;
  }
  EXPECT_FALSE(exists("m.png") || exists("d.exr"));
}

TEST_F(FilesOfARun, TheConfigurationOfTheColourViewIsAnInput)
{
  folder_.write("config.ocio", R"(ocio_profile_version: 1
search_path: .
roles:
  scene_linear: linear
  default: linear
displays:
  screen:
    - !<View> {name: Standard, colorspace: curve}
active_displays: [screen]
active_views: [Standard]
colorspaces:
  - !<ColorSpace>
    name: linear
  - !<ColorSpace>
    name: curve
    from_reference: !<FileTransform> {src: curve.spi1d, interpolation: linear}
)");
  folder_.write("curve.spi1d", "Version 1\nFrom 0.0 1.0\nLength 2\nComponents 1\n{\n0.0\n1.0\n}\n");
  ::setenv("OCIO", file("config.ocio").c_str(), 1);
  const Arguments png = tiny({"render", scene_, "-o", file("a.exr"), "--png", file("a.png")});
  for (const char* name : {"config.ocio", "curve.spi1d"}) {
    Arguments all = png;
    all.insert(all.end(), {"--stats", file(name)});
    expect_refused(all, "--stats");
  }
  Arguments resumed = png;
  resumed.push_back("--resume");
  EXPECT_EQ(run(resumed).exit_code, 0);
  EXPECT_NE(run(resumed).errors.find("already rendered"), std::string::npos);
  folder_.write("curve.spi1d", "Version 1\nFrom 0.0 1.0\nLength 2\nComponents 1\n{\n0.0\n0.5\n}\n");
  EXPECT_EQ(run(resumed).errors.find("already rendered"), std::string::npos);
  ::unsetenv("OCIO");
}

TEST_F(FilesOfARun, ALinkMadeDuringTheRenderIsFoundWhenTheFileIsWritten)
{
  int ends[2];
  ASSERT_EQ(::pipe2(ends, O_CLOEXEC), 0);
  Process process(render_arguments(scene_, file("a.exr"), {"--spp", kEndless, "--stats", file("a.json")}), ends[1],
                  open_file("stderr"));
  EXPECT_TRUE(wait_for_samples(ends[0]));
  fs::create_symlink("displaced.bin", file("a.json"));
  const std::string before = bytes_of_file(file("displaced.bin"));
  process.signal(SIGINT);
  EXPECT_EQ(process.wait(), 2);
  ::close(ends[0]);
  EXPECT_EQ(bytes_of_file(file("displaced.bin")), before);
  EXPECT_EQ(exr_load(file("a.exr")).width, 16) << "the picture is saved all the same";
}

TEST_F(FilesOfARun, ResumeBelievesNoFileThatIsNotAsItWasWritten)
{
  const Arguments all = {"--resume", "--png", file("a.png"), "--stats", file("a.json")};
  ASSERT_EQ(render(scene_, file("a.exr"), all).count("done"), 1);
  ASSERT_EQ(render(scene_, file("a.exr"), all).count("skipped"), 1);
  for (const char* name : {"a.png", "a.json", "a.exr"}) {
    const std::string whole = bytes_of_file(file(name));
    std::string damaged = whole;
    damaged[whole.size() / 2] = static_cast<char>(damaged[whole.size() / 2] ^ 1);
    for (const std::string& bytes : {std::string(), whole.substr(0, whole.size() / 2), damaged, std::string("{}")}) {
      if (name == std::string("a.exr") && bytes == damaged) continue;  // one pixel, perhaps, and no way to know
      folder_.write(name, bytes);
      EXPECT_EQ(render(scene_, file("a.exr"), all).count("done"), 1) << name << " of " << bytes.size() << " bytes";
      EXPECT_EQ(render(scene_, file("a.exr"), all).count("skipped"), 1) << name;
    }
  }
}

TEST_F(FilesOfARun, ResumeNoticesASceneThatIsSavedWhileItIsRendered)
{
  int ends[2];
  ASSERT_EQ(::pipe2(ends, O_CLOEXEC), 0);
  const Arguments more = {"--resume", "--time-limit", "0.3", "--spp", kEndless};
  Process process(render_arguments(scene_, file("a.exr"), more), ends[1], open_file("stderr"));
  EXPECT_TRUE(wait_for_samples(ends[0]));
  // As an editor does: another file takes the name. Size and time of the last change are the old ones.
  const auto time = fs::last_write_time(file("displaced.bin"));
  fs::copy_file(file("displaced.bin"), file("saved"));
  fs::last_write_time(file("saved"), time);
  fs::rename(file("saved"), file("displaced.bin"));
  ASSERT_EQ(process.wait(), 0);
  ::close(ends[0]);
  EXPECT_NE(bytes_of_file(file("stderr")).find("displaced.bin: changed after the render had begun"), std::string::npos);
  EXPECT_EQ(exr_load(file("a.exr")).attributes.count("relief:fingerprint"), 0u);
  EXPECT_EQ(render(scene_, file("a.exr"), more).count("skipped"), 0);
}

TEST_F(FilesOfARun, ResumeNoticesAFileThatTookAnOthersPlace)
{
  ASSERT_EQ(render(scene_, file("a.exr"), {"--resume"}).count("done"), 1);
  const auto time = fs::last_write_time(file("displaced.bin"));
  fs::copy_file(file("displaced.bin"), file("other"));
  fs::last_write_time(file("other"), time);
  fs::rename(file("other"), file("displaced.bin"));
  EXPECT_EQ(render(scene_, file("a.exr"), {"--resume"}).count("done"), 1);
}

TEST_F(FilesOfARun, ResumeNoticesEveryOptionThatChangesFiles)
{
  const Arguments kPng = {"--png", file("a.png"), "--resume"};
  // Each differs from the one before, and from its neighbours in the list.
  for (const Arguments& more : {Arguments{"--texture-memory", "0"},
                                {"--displacement", "rmip"},
                                {"--lod", "1"},
                                {"--exposure", "1"},
                                {"--view", "Standard"},
                                {"--time-limit", "100"},
                                {"--displacement-memory", "1"}}) {
    Arguments all = kPng;
    all.insert(all.end(), more.begin(), more.end());
    const Outcome first = render(scene_, file("a.exr"), all);
    EXPECT_EQ(first.count("done"), 1) << more[0] << first.errors;
    EXPECT_EQ(render(scene_, file("a.exr"), all).count("skipped"), 1) << more[0];
  }
}

TEST_F(FilesOfARun, OnlyOneProcessMakesAFrame)
{
  int ends[2];
  ASSERT_EQ(::pipe2(ends, O_CLOEXEC), 0);
  const Arguments endless = {"--spp", kEndless, "--png", file("a.png")};
  Process first(render_arguments(scene_, file("a.1.exr"), endless), ends[1], open_file("first"));
  EXPECT_TRUE(wait_for_samples(ends[0]));
  const Outcome resumed = render(scene_, file("a.#.exr"), {"--frames", "1,2", "--resume"});
  EXPECT_EQ(resumed.exit_code, 0);
  EXPECT_EQ(resumed.count("skipped"), 1);
  EXPECT_EQ(resumed.count("done"), 1);
  EXPECT_NE(resumed.errors.find("a.1.exr: is being made by process "), std::string::npos) << resumed.errors;
  EXPECT_EQ(render(scene_, file("a.1.exr")).exit_code, 1);
  // Another picture, but the same PNG.
  const Outcome other = render(scene_, file("b.exr"), {"--png", file("a.png")});
  EXPECT_EQ(other.exit_code, 1);
  EXPECT_NE(other.errors.find("a.png: is being made by process "), std::string::npos) << other.errors;
  first.signal(SIGKILL);
  EXPECT_EQ(first.wait(), 128 + SIGKILL);
  ::close(ends[0]);
  // Whoever is killed holds nothing any more.
  EXPECT_EQ(render(scene_, file("a.#.exr"), {"--frames", "1,2", "--resume"}).count("done"), 1);
  for (const std::string& name : files()) EXPECT_FALSE(name.starts_with(".relief-")) << name;
}

TEST_F(FilesOfARun, ManyProcessesShareFramesAndRenderEachOnce)
{
  constexpr int kNumProcesses = 4, kNumFrames = 12;
  std::vector<std::unique_ptr<Process>> processes;
  for (int i = 0; i < kNumProcesses; ++i) {
    const std::string name = "out" + std::to_string(i);
    processes.push_back(std::make_unique<Process>(
        render_arguments(scene_, file("f.##.exr"), {"--frames", "1-12", "--resume", "--png", file("f.png")}),
        open_file(name), open_file("err" + std::to_string(i))));
  }
  for (const auto& process : processes) EXPECT_EQ(process->wait(), 0);
  int num_done = 0;
  for (int i = 0; i < kNumProcesses; ++i) {
    std::istringstream lines(bytes_of_file(file("out" + std::to_string(i))));
    for (std::string line; std::getline(lines, line);) num_done += line.find("\"done\"") != std::string::npos;
  }
  EXPECT_EQ(num_done, kNumFrames);
  for (const std::string& name : files()) EXPECT_FALSE(name.starts_with(".relief-")) << name;
}

TEST_F(FilesOfARun, AFullDiskIsExitCodeOneWhateverIsPrinted)
{
  ASSERT_EQ(run(tiny({"render", scene_, "-o", file("a.exr")})).exit_code, 0);
  ASSERT_EQ(run(tiny({"render", scene_, "-o", file("b.exr"), "--seed", "3"})).exit_code, 0);
  for (const Arguments& arguments : {Arguments{"compare", file("a.exr"), file("b.exr"), "--json", "-"},
                                     {"compare", file("a.exr"), file("b.exr")},
                                     {"merge", file("a.exr"), file("b.exr"), "-o", file("c.exr")},
                                     {"trace", scene_, "--pixel", "1,1"},
                                     {"info", scene_},
                                     {"--help"},
                                     {"render", "--help"},
                                     {"--version"}}) {
    Process process(arguments, ::open("/dev/full", O_WRONLY | O_CLOEXEC), open_file("stderr"));
    EXPECT_EQ(process.wait(), 1) << arguments[0];
    EXPECT_NE(bytes_of_file(file("stderr")).find("relief: standard output: "), std::string::npos) << arguments[0];
  }
}

TEST_F(FilesOfARun, AFrameOfADeviceHasNoNumber)
{
  fs::create_symlink("/dev/null", file("null"));
  const Outcome outcome =
      run(tiny({"render", scene_, "-o", file("null"), "--frames", "1-2", "--stats", file("a.json")}));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.errors;
  EXPECT_TRUE(exists("a.0001.json") && exists("a.0002.json"));
  EXPECT_FALSE(exists("null.0001"));
}

TEST_F(FilesOfARun, ALinkToAClosedStandardOutputIsNotReplaced)
{
  fs::create_symlink("/proc/self/fd/1", file("standard.exr"));
  const int status = std::system((std::string(RELIEF_PROGRAM) + " render " + scene_ + " -o " + file("standard.exr") +
                                  " --resolution 8x8 --spp 1 --progress none >&- 2>" + file("stderr"))
                                     .c_str());
  EXPECT_EQ(WEXITSTATUS(status), 1);
  EXPECT_TRUE(fs::is_symlink(file("standard.exr")));
}

TEST_F(FilesOfARun, AClosedStandardOutputIsNotTakenByAFile)
{
  ASSERT_EQ(run(tiny({"render", scene_, "-o", file("a.exr")})).exit_code, 0);
  const std::string picture = bytes_of_file(file("a.exr"));
  const auto without_output = [&](const std::string& words) {
    return std::system((std::string(RELIEF_PROGRAM) + " " + words + " >&- 2>" + file("stderr")).c_str());
  };
  // The error would be printed into the lock of the frame, the first file to be opened.
  const int status = without_output("render " + scene_ + " -o " + file("b.exr") + " --reference " + file("a.exr") +
                                    " --resolution 8x8 --spp 1 --progress none");
  EXPECT_EQ(WEXITSTATUS(status), 1);
  EXPECT_NE(bytes_of_file(file("stderr")).find("standard output: Bad file descriptor"), std::string::npos);
  EXPECT_EQ(values_of(file("b.exr"), "R"), values_of(file("a.exr"), "R"));
}

TEST_F(FilesOfARun, AFileBeyondTheLimitOfSizesIsExitCodeOne)
{
  rlimit old{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &old), 0);
  const rlimit small = {2048, old.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &small), 0);
  const Outcome outcome =
      run({"render", scene_, "-o", file("a.exr"), "--resolution", "64x64", "--spp", "1", "--compression", "none"});
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &old), 0);
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_NE(outcome.errors.find("a.exr: File too large"), std::string::npos) << outcome.errors;
  EXPECT_FALSE(exists("a.exr"));
  for (const std::string& name : files()) EXPECT_FALSE(name.starts_with(".relief-")) << name;
}

TEST_F(FilesOfARun, AFolderThatIsRemovedMeanwhileIsExitCodeOne)
{
  fs::create_directory(file("out"));
  int ends[2];
  ASSERT_EQ(::pipe2(ends, O_CLOEXEC), 0);
  Process process(render_arguments(scene_, file("out/a.exr"), {"--spp", kEndless}), ends[1], open_file("stderr"));
  EXPECT_TRUE(wait_for_samples(ends[0]));
  fs::remove_all(file("out"));
  process.signal(SIGINT);
  EXPECT_EQ(process.wait(), 1);
  ::close(ends[0]);
  EXPECT_NE(bytes_of_file(file("stderr")).find("a.exr: No such file or directory"), std::string::npos);
}

TEST_F(FilesOfARun, WhatAKilledRunLeftIsRemovedByTheNext)
{
  // Somewhere between the start and the end of writing.
  for (int attempt = 0; attempt < 10; ++attempt) {
    Process process(render_arguments(scene_, file("b.exr"), {"--resolution", "1024x1024", "--spp", "1"}),
                    open_file("stdout"), open_file("stderr"));
    std::this_thread::sleep_for(std::chrono::milliseconds(20 * (attempt + 1)));
    process.signal(SIGKILL);
    process.wait();
  }
  EXPECT_EQ(run(tiny({"render", scene_, "-o", file("c.exr")})).exit_code, 0);
  for (const std::string& name : files()) EXPECT_FALSE(name.starts_with(".")) << name;
}

TEST_F(FilesOfARun, EventsAndPicturesAreNotMixed)
{
  // By its name, a file that standard output goes to, and one that takes both and keeps neither.
  const std::tuple<std::string, std::string, int> kCases[] = {
      {"/dev/stdout", "/dev/full", 2}, {file("a.exr"), file("a.exr"), 2}, {"/dev/null", "/dev/null", 0}};
  for (const auto& [output, standard_output, exit_code] : kCases) {
    const std::string command = std::string(RELIEF_PROGRAM) + " render " + scene_ + " -o " + output +
                                " --resolution 8x8 --spp 1 --progress json 2>" + file("stderr") + " >" +
                                standard_output;
    EXPECT_EQ(WEXITSTATUS(std::system(command.c_str())), exit_code) << command;
    EXPECT_EQ(bytes_of_file(file("stderr")).find("--output: expected a file, found '") != std::string::npos,
              exit_code != 0)
        << bytes_of_file(file("stderr"));
  }
}

TEST_F(FilesOfARun, APipeTakesAPicture)
{
  // OpenEXR goes back to its table of offsets, which a pipe cannot. What /dev/stdout is, but ours to lose.
  const std::string output = file("standard");
  fs::create_symlink("/proc/self/fd/1", output);
  ASSERT_EQ(run(tiny({"render", scene_, "-o", file("a.exr")})).exit_code, 0);
  const std::string command = std::string(RELIEF_PROGRAM) + " render " + scene_ + " -o " + output +
                              " --resolution 8x8 --spp 1 --progress none 2>" + file("stderr") + " | cat > " +
                              file("b.exr");
  ASSERT_EQ(std::system(command.c_str()), 0);
  EXPECT_EQ(values_of(file("b.exr"), "R"), values_of(file("a.exr"), "R"));
  // What is open for appending keeps what it has.
  folder_.write("log", "first line\n");
  const std::string append = std::string(RELIEF_PROGRAM) + " trace " + scene_ + " --rays " + file("rays.txt") + " -o " +
                             output + " >> " + file("log");
  ASSERT_EQ(std::system(append.c_str()), 0);
  EXPECT_EQ(bytes_of_file(file("log")).rfind("first line\nhit,t,", 0), 0u) << bytes_of_file(file("log"));
}

}  // namespace
}  // namespace relief::test
