// An animation that is killed at random moments of its life, loading and writing included.
#include <chrono>
#include <random>
#include <thread>

#include "tests/cli/interrupted_runs.h"

namespace relief::test {
namespace {

TEST_F(InterruptedRuns, AnAnimationKilledAtTwentyRandomMomentsHasTheSameBits)
{
  constexpr int kNumFrames = 48, kNumKills = 20;
  const std::string scene = folder_.write("scene.gltf", moving_view(folder_).gltf()).string();
  const auto arguments = [&](const std::string& output) {
    return render_arguments(scene, output,
                            {"--frames", "1-48", "--resume", "--checkpoint", "0.1", "--resolution", "96x96", "--spp",
                             "384", "--aov", "all", "--noise-threshold", "0.005"});
  };
  const auto start_time = std::chrono::steady_clock::now();
  ASSERT_EQ(run(arguments(file("whole.##.exr"))).exit_code, 0);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start_time).count();

  std::mt19937 random(1);
  // In seven tenths of the time, should the machine get faster.
  std::uniform_real_distribution<double> moment(0, 1.4 * seconds / (kNumKills + 1));
  int num_kills = 0, num_resumed = 0;
  while (num_kills < kNumKills) {
    Process process(arguments(file("killed.##.exr")), open_file("stdout"), open_file("stderr"));
    std::this_thread::sleep_for(std::chrono::duration<double>(moment(random)));
    process.signal(SIGKILL);
    const bool was_killed = process.wait() == 128 + SIGKILL;
    std::istringstream lines(bytes_of_file(file("stdout")));
    for (std::string line; std::getline(lines, line);) num_resumed += line.find("\"resumed\"") != std::string::npos;
    ASSERT_TRUE(was_killed) << "all frames were done after " << num_kills << " kills";
    ++num_kills;
  }
  const Outcome last = run(arguments(file("killed.##.exr")));
  ASSERT_EQ(last.exit_code, 0) << last.errors;
  std::printf("%.1f s undisturbed; %d kills, %d frames went on from a state\n", seconds, num_kills,
              num_resumed + last.count("resumed"));
  EXPECT_GT(num_resumed + last.count("resumed"), kNumKills / 4);
  for (int frame = 1; frame <= kNumFrames; ++frame) {
    const std::string number = (frame < 10 ? "0" : "") + std::to_string(frame);
    EXPECT_TRUE(same_bits(file("killed." + number + ".exr"), file("whole." + number + ".exr")));
  }
  for (const std::string& name : files()) EXPECT_FALSE(name.starts_with(".relief-")) << name;
}

}  // namespace
}  // namespace relief::test
