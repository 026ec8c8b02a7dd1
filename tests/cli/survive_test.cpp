// What a render survives, and what is left of it: kill -9, signals with a grace time, a full disk, input that vanishes, too little
// memory, frames that fail.
#include <sys/mount.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <chrono>
#include <thread>

#include "tests/cli/interrupted_runs.h"

namespace relief::test {
namespace {

namespace fs = std::filesystem;

constexpr const char* kEndless = "16000000";

class SurvivingRun : public InterruptedRuns {
 protected:
  SurvivingRun() : scene_(folder_.write("scene.gltf", moving_view(folder_).gltf()).string()) {}

  /// All that is in the folder but the scene's files.
  std::vector<std::string> made() const
  {
    std::vector<std::string> names = files();
    for (const char* input : {"heights.tga", "scene.bin", "scene.gltf"}) std::erase(names, input);
    return names;
  }

  /// Arguments of a render that takes many checkpoints, unless told otherwise.
  Arguments patient(const std::string& output, const Arguments& more = {}, const char* seconds = "0.01") const
  {
    Arguments all = {"--resume", "--checkpoint", seconds, "--resolution", "64x64", "--spp", "100", "--aov", "all"};
    all.insert(all.end(), more.begin(), more.end());
    return render_arguments(scene_, output, all);
  }

  /// Leaves the state of a render of patient() that was ended by a signal behind its first checkpoint.
  void leave_state(const std::string& output, int signal) const
  {
    const Running running = start(patient(output));
    ASSERT_TRUE(running.wait_for("checkpoint"));
    running.process->signal(signal);
    EXPECT_EQ(running.process->wait(), signal == SIGKILL ? 128 + SIGKILL : 130);
  }

  std::string scene_;
};

/// Bounds the size of files that a process started meanwhile may write.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes)
  {
    ::getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit bound{bytes, before_.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &bound);
  }
  ~FileSizeLimit() { ::setrlimit(RLIMIT_FSIZE, &before_); }
  FileSizeLimit(const FileSizeLimit&) = delete;
  FileSizeLimit& operator=(const FileSizeLimit&) = delete;

 private:
  rlimit before_{};
};

TEST_F(SurvivingRun, AFrameThatIsKilledAgainAndAgainHasTheSameBitsInTheEnd)
{
  const std::pair<const char*, Arguments> kCases[] = {{"adaptive", {"--noise-threshold", "0.01"}},
                                                      {"caustics", {"--caustics", "on", "--frames", "3"}}};
  for (const auto& [name, more] : kCases) {
    const std::string whole = file(std::string(name) + "_whole.exr"), killed = file(std::string(name) + ".exr");
    const auto path = [&](std::string file) {
      if (!more.empty() && more.back() == "3") file.insert(file.size() - 4, ".0003");
      return file;
    };
    ASSERT_EQ(run(patient(whole, more, "0")).exit_code, 0);
    int num_resumed = 0;
    for (int kill = 0; kill < 2; ++kill) {
      const Running running = start(patient(killed, more));
      if (kill > 0) num_resumed += running.wait_for("resumed");
      ASSERT_TRUE(running.wait_for("checkpoint")) << name << ": finished before it was killed";
      running.process->signal(SIGKILL);
      EXPECT_EQ(running.process->wait(), 128 + SIGKILL);
      EXPECT_EQ(exr_load(path(killed)).width, 64) << "the part that is a picture is one";
    }
    EXPECT_EQ(num_resumed, 1) << name;
    const Outcome last = run(patient(killed, more));
    EXPECT_EQ(last.exit_code, 0) << last.errors;
    EXPECT_EQ(last.count("resumed"), 1) << name;
    EXPECT_NE(last.errors.find(": goes on after "), std::string::npos) << last.errors;
    EXPECT_TRUE(same_bits(path(killed), path(whole)));
    EXPECT_EQ(run(patient(killed, more)).count("skipped"), 1) << "a whole picture like any other";
    EXPECT_LT(fs::file_size(path(killed)), fs::file_size(path(whole)) * 11 / 10) << "without the state";
  }
  for (const std::string& name : files()) EXPECT_FALSE(name.starts_with(".relief-")) << name;
}

TEST_F(SurvivingRun, ASignalLeavesAllLayersAndAStateToGoOnFrom)
{
  ASSERT_EQ(run(patient(file("whole.exr"), {}, "0")).exit_code, 0);
  leave_state(file("a.exr"), SIGTERM);
  const Picture partial = exr_load(file("a.exr")), whole = exr_load(file("whole.exr"));
  EXPECT_EQ(partial.channels.size(), whole.channels.size());
  EXPECT_EQ(partial.attributes.at("relief:stop_reason"), "interrupted");
  // An interrupted picture that nobody said is to go on has no state, as ever.
  const Outcome last = run(patient(file("a.exr")));
  EXPECT_EQ(last.count("resumed"), 1);
  EXPECT_TRUE(same_bits(file("a.exr"), file("whole.exr")));
}

TEST_F(SurvivingRun, APictureOfOneTileIsSavedBetweenItsPasses)
{
  const std::pair<const char*, Arguments> kCases[] = {{"plain", {}},
                                                      {"adaptive", {"--noise-threshold", "1e-4"}},
                                                      {"caustics", {"--caustics", "on"}}};
  for (const auto& [name, more] : kCases) {
    const auto arguments = [&](const std::string& output, const char* seconds) {
      Arguments all = {"--resume", "--checkpoint", seconds, "--spp", "1000"};
      all.insert(all.end(), more.begin(), more.end());
      return render_arguments(scene_, output, all);
    };
    const std::string whole = file(std::string(name) + "_whole.exr"), killed = file(std::string(name) + ".exr");
    ASSERT_EQ(run(arguments(whole, "0")).exit_code, 0);
    {
      const Running running = start(arguments(killed, "0.001"));
      ASSERT_TRUE(running.wait_for("checkpoint")) << name;
      running.process->signal(SIGKILL);
      running.process->wait();
    }
    const Outcome last = run(arguments(killed, "0.001"));
    EXPECT_EQ(last.exit_code, 0) << last.errors;
    EXPECT_EQ(last.count("resumed"), 1) << name;
    EXPECT_TRUE(same_bits(killed, whole)) << name;
  }
}

TEST_F(SurvivingRun, AStateIsOfItsSettingsAndIsNotAskedForWithoutResume)
{
  leave_state(file("a.exr"), SIGKILL);
  fs::copy_file(file("a.exr"), file("kept.exr"));
  const std::pair<const char*, Arguments> kOthers[] = {{"seed", patient(file("a.exr"), {"--seed", "2"})},
                                                       {"not asked for", render_arguments(scene_, file("a.exr"), {})}};
  for (const auto& [name, arguments] : kOthers) {
    fs::copy_file(file("kept.exr"), file("a.exr"), fs::copy_options::overwrite_existing);
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.exit_code, 0) << name;
    EXPECT_EQ(outcome.count("resumed"), 0) << name;
    EXPECT_EQ(outcome.count("done"), 1) << name;
  }
  // A file of the scene that was saved again is another one.
  fs::copy_file(file("kept.exr"), file("a.exr"), fs::copy_options::overwrite_existing);
  folder_.write("heights.tga", bytes_of_file(file("heights.tga")));
  EXPECT_EQ(run(patient(file("a.exr"))).count("resumed"), 0);
}

TEST_F(SurvivingRun, AStateThatIsDamagedIsWarnedAboutAndBegunAnew)
{
  leave_state(file("a.exr"), SIGKILL);
  const std::string bytes = bytes_of_file(file("a.exr"));
  std::string turned = bytes;
  turned[turned.size() - 3] = static_cast<char>(turned[turned.size() - 3] ^ 1);
  std::vector<std::string> bad = {turned};
  for (const double part : {0.0, 0.001, 0.3, 0.99}) {
    bad.push_back(bytes.substr(0, static_cast<std::size_t>(part * static_cast<double>(bytes.size()))));
  }
  for (const std::string& damaged : bad) {
    folder_.write("a.exr", damaged);
    const Outcome outcome = run(patient(file("a.exr"), {}, "0"));
    EXPECT_EQ(outcome.exit_code, 0) << damaged.size() << outcome.errors;
    EXPECT_EQ(outcome.count("resumed"), 0) << damaged.size();
    EXPECT_NE(outcome.errors.find("relief: warning: " + file("a.exr") + ": expected "), std::string::npos)
        << damaged.size() << outcome.errors;
    EXPECT_NE(outcome.errors.find(": the frame begins anew\n"), std::string::npos) << outcome.errors;
  }
}

TEST_F(SurvivingRun, AFileThatCannotGrowLeavesTheOlderCheckpoint)
{
  ASSERT_EQ(run(patient(file("whole.exr"), {}, "0")).exit_code, 0);
  leave_state(file("a.exr"), SIGKILL);
  const std::string before = bytes_of_file(file("a.exr"));
  {
    const FileSizeLimit limit(12000);
    Arguments arguments = patient(file("a.exr"));
    *(std::find(arguments.begin(), arguments.end(), "json")) = "none";
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.exit_code, 1);
    EXPECT_NE(outcome.errors.find("relief: warning: a checkpoint could not be written: " + file("a.exr") +
                                  ": File too large"),
              std::string::npos)
        << outcome.errors;
    EXPECT_NE(outcome.errors.find("\nrelief: " + file("a.exr") + ": File too large"), std::string::npos)
        << outcome.errors;
  }
  EXPECT_TRUE(bytes_of_file(file("a.exr")) == before);
  EXPECT_EQ(made(), (std::vector<std::string>{"a.exr", "whole.exr"}));
  EXPECT_EQ(run(patient(file("a.exr"))).count("resumed"), 1);
  EXPECT_TRUE(same_bits(file("a.exr"), file("whole.exr")));
}

TEST_F(SurvivingRun, AFullDiskIsExitCodeOneAndNothingHalfWritten)
{
  fs::create_directory(file("disk"));
  if (::mount("none", file("disk").c_str(), "tmpfs", 0, "size=12k") != 0)
    GTEST_SKIP() << "only root may mount a small disk";
  const Outcome outcome = run(patient(file("disk/a.exr")));
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_NE(outcome.errors.find("warning: a checkpoint could not be written: "), std::string::npos) << outcome.errors;
  EXPECT_NE(outcome.errors.find("relief: " + file("disk/a.exr") + ": No space left on device"), std::string::npos)
      << outcome.errors;
  EXPECT_TRUE(fs::is_empty(file("disk")));
  ::umount(file("disk").c_str());
}

TEST_F(SurvivingRun, InputThatVanishesBetweenFramesIsNamedAndTheRestIsWhole)
{
  for (const char* input : {"scene.bin", "heights.tga", "scene.gltf"}) {
    const std::string bytes = bytes_of_file(file(input));
    for (const bool keeps_going : {false, true}) {
      if (!keeps_going && input != std::string("scene.bin")) continue;
      Arguments all = {"--frames", "1-3", "--spp", kEndless, "--time-limit", "0.3"};
      if (keeps_going) all.emplace_back("--keep-going");
      const Running running = start(render_arguments(scene_, file("f.#.exr"), all));
      ASSERT_TRUE(running.wait_for("progress"));
      fs::remove(file(input));
      EXPECT_EQ(running.process->wait(), keeps_going ? 1 : 3) << input;
      const std::string errors = bytes_of_file(file("stderr"));
      EXPECT_NE(errors.find(std::string(input) + ": changed after the render had begun"), std::string::npos) << errors;
      EXPECT_NE(errors.find(keeps_going ? "\nrelief: frame 2: " : "\nrelief: "), std::string::npos) << errors;
      EXPECT_NE(errors.find(input, errors.find(keeps_going ? "frame 2: " : "1.exr: 16x16")), std::string::npos)
          << errors;
      EXPECT_EQ(errors.find("2 of 3 frames failed: 2, 3") != std::string::npos, keeps_going) << errors;
      EXPECT_EQ(made(), std::vector<std::string>{"f.1.exr"}) << input;
      EXPECT_EQ(exr_load(file("f.1.exr")).width, 16);
      fs::remove(file("f.1.exr"));
      folder_.write(input, bytes);
    }
  }
}

TEST_F(SurvivingRun, KeepGoingRendersTheFramesAfterABadOne)
{
  ASSERT_EQ(render(scene_, file("ref.1.exr"), {}).exit_code, 0);
  fs::copy_file(file("ref.1.exr"), file("ref.3.exr"));
  const Arguments frames = {"--frames", "1-3", "--reference", file("ref.#.exr")};
  EXPECT_EQ(render(scene_, file("f.#.exr"), frames).exit_code, 3);
  EXPECT_FALSE(exists("f.3.exr"));
  Arguments keep_going = frames;
  keep_going.emplace_back("--keep-going");
  const Outcome outcome = render(scene_, file("f.#.exr"), keep_going);
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_EQ(outcome.count("done"), 2);
  EXPECT_EQ(outcome.count("failed"), 1);
  EXPECT_NE(outcome.errors.find("relief: frame 2: " + file("ref.2.exr") + ": no such file\n"), std::string::npos)
      << outcome.errors;
  EXPECT_NE(outcome.errors.find("relief: 1 of 3 frames failed: 2\n"), std::string::npos) << outcome.errors;
  EXPECT_EQ(made(), (std::vector<std::string>{"f.1.exr", "f.3.exr", "ref.1.exr", "ref.3.exr"}));
  // What is wrong with the command line is wrong with every frame.
  EXPECT_EQ(render(scene_, file("f.#.exr"), {"--frames", "1-3", "--keep-going", "--crop", "0,0,99,1"}).exit_code, 2);
}

TEST_F(SurvivingRun, TooLittleMemoryIsAMessageForEachFrame)
{
  const Arguments all = {"--frames", "1,2", "--keep-going", "--max-memory", "0.001"};
  const Outcome outcome = render(scene_, file("f.#.exr"), all);
  EXPECT_EQ(outcome.exit_code, 1);
  for (const char* text : {"relief: frame 1: out of memory: ", "relief: frame 2: out of memory: ",
                           "relief: 2 of 2 frames failed: 1, 2\n"}) {
    EXPECT_NE(outcome.errors.find(text), std::string::npos) << text << outcome.errors;
  }
  EXPECT_EQ(made(), std::vector<std::string>{});
}

TEST_F(SurvivingRun, AFrameMayBeFinishedWithinTheGraceTime)
{
  for (const char* frames : {"1", "1-2"}) {
    const Running running = start(render_arguments(
        scene_, file("f.#.exr"), {"--frames", frames, "--grace", "600", "--spp", kEndless, "--time-limit", "0.5"}));
    ASSERT_TRUE(running.wait_for("progress"));
    running.process->signal(SIGTERM);
    EXPECT_EQ(running.process->wait(), frames == std::string("1") ? 0 : 130) << "further frames are left out";
    EXPECT_EQ(exr_load(file("f.1.exr")).attributes.at("relief:stop_reason"), "time_limit");
    EXPECT_EQ(exr_load(file("f.1.exr")).attributes.count("relief:fingerprint"), 1u);
    EXPECT_EQ(made(), std::vector<std::string>{"f.1.exr"});
    fs::remove(file("f.1.exr"));
  }
}

TEST_F(SurvivingRun, SamplingEndsInTimeForTheStateToBeWritten)
{
  const Running running = start(patient(file("a.exr"), {"--grace", "20"}));
  ASSERT_TRUE(running.wait_for("progress"));
  running.process->signal(SIGTERM);
  const int code = running.process->wait();
  // On a fast machine the frame is finished.
  EXPECT_TRUE(code == 130 || code == 0) << code;
  EXPECT_EQ(exr_load(file("a.exr")).width, 64);
}

TEST_F(SurvivingRun, WhenTheGraceTimeIsOverTheProgramEndsWhateverItIsDoing)
{
  ASSERT_EQ(::mkfifo(file("pipe").c_str(), 0600), 0);
  // Nobody reads the pipe, and opening it waits.
  const Running running = start(render_arguments(scene_, file("pipe"), {"--spp", "1", "--grace", "0.2"}));
  ASSERT_TRUE(running.wait_for("progress"));
  running.process->signal(SIGTERM);
  EXPECT_EQ(running.process->wait(), 143);
  EXPECT_NE(bytes_of_file(file("stderr")).find("relief: the grace time is over"), std::string::npos);
  EXPECT_EQ(made(), std::vector<std::string>{"pipe"});
}

TEST_F(SurvivingRun, AFrameThatWasFinishedInTimeAndWrittenAfterwardsIsNoInterrupt)
{
  ASSERT_EQ(::mkfifo(file("pipe").c_str(), 0600), 0);
  const Running running = start(render_arguments(scene_, file("pipe"), {"--spp", "1", "--grace", "6"}));
  ASSERT_TRUE(running.wait_for("progress"));
  running.process->signal(SIGTERM);
  // Writing waits for a reader, beyond the half of the grace time at which sampling would have ended.
  std::this_thread::sleep_for(std::chrono::milliseconds(3500));
  EXPECT_FALSE(bytes_of_file(file("pipe")).empty());
  EXPECT_EQ(running.process->wait(), 0);
}

TEST_F(SurvivingRun, ALockThatAKilledProcessLeftIsNobodys)
{
  leave_state(file("a.exr"), SIGKILL);
  const auto is_lock = [](const std::string& name) { return name.ends_with(".lock"); };
  std::vector<std::string> left = made();
  ASSERT_TRUE(std::any_of(left.begin(), left.end(), is_lock));
  const Outcome outcome = render(scene_, file("a.exr"));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.errors;
  EXPECT_EQ(made(), std::vector<std::string>{"a.exr"});
}

}  // namespace
}  // namespace relief::test
