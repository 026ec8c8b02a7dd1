// Runs the `relief` binary as a shell would, and the small scenes that its tests render.
#pragma once

#include <gtest/gtest.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "exporters/exr.h"
#include "tests/support/gltf_builder.h"

namespace relief::test {

using Arguments = std::vector<std::string>;

inline std::string bytes_of_file(const std::filesystem::path& path)
{
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// Waits until a render has a picture to keep: the progress that it prints before may be of none yet.
/// @param output  read end of its standard output
inline bool wait_for_samples(int output)
{
  std::string line;
  for (char byte = 0; ::read(output, &byte, 1) == 1;) {
    if (byte != '\n') {
      line += byte;
      continue;
    }
    const nlohmann::json event = nlohmann::json::parse(line, nullptr, false);
    if (event.is_object() && event.value("event", "") == "progress" && event.value("samples", 0.0) >= 1.0) return true;
    line.clear();
  }
  return false;
}

/// A running `relief`. Its standard error goes to a file, its standard output to where `output` says.
class Process {
 public:
  /// @param output         descriptor of the new process's standard output, closed here afterwards
  /// @param address_bytes  bound on the new process's address space, as a shell sets by `ulimit -v`
  Process(const Arguments& arguments, int output, int error, std::uint64_t address_bytes = RLIM_INFINITY)
      : pid_(::fork())
  {
    if (pid_ == 0) {
      ::dup2(output, STDOUT_FILENO);
      ::dup2(error, STDERR_FILENO);
      std::vector<char*> argv = {const_cast<char*>("relief")};
      for (const std::string& a : arguments) argv.push_back(const_cast<char*>(a.c_str()));
      argv.push_back(nullptr);
      const rlimit bound{address_bytes, address_bytes};
      ::setrlimit(RLIMIT_AS, &bound);
      ::execv(RELIEF_PROGRAM, argv.data());
      std::_Exit(127);
    }
    ::close(output);
    ::close(error);
  }
  ~Process()
  {
    if (pid_ <= 0) return;
    ::kill(pid_, SIGKILL);
    wait();
  }
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  void signal(int number) const { ::kill(pid_, number); }

  /// Exit code; 128 + n for an end by signal n, as shells say it.
  int wait()
  {
    int status = 0;
    ::waitpid(std::exchange(pid_, -1), &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }

 private:
  pid_t pid_;
};

struct Outcome {
  int exit_code = -1;
  std::string output, errors;

  /// The lines of the output as JSON objects. A line that is not JSON fails the test.
  std::vector<nlohmann::json> events() const
  {
    std::vector<nlohmann::json> list;
    std::istringstream lines(output);
    for (std::string line; std::getline(lines, line);) {
      list.push_back(nlohmann::json::parse(line, nullptr, false));
      EXPECT_TRUE(list.back().is_object()) << line;
    }
    return list;
  }

  /// Number of events of that name.
  int count(const std::string& event) const
  {
    int n = 0;
    for (const nlohmann::json& e : events()) n += e.value("event", "") == event;
    return n;
  }
};

class ProgramTest : public ::testing::Test {
 protected:
  std::string file(const std::string& name) const { return (folder_ / name).string(); }
  bool exists(const std::string& name) const { return std::filesystem::exists(folder_ / name); }

  /// Names of the files in the test's folder but the program's own output, sorted.
  std::vector<std::string> files() const
  {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(folder_ / "")) {
      const std::string name = entry.path().filename().string();
      if (name != "stdout" && name != "stderr") names.push_back(name);
    }
    std::sort(names.begin(), names.end());
    return names;
  }

  int open_file(const std::string& name) const
  {
    return ::open(file(name).c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  }

  Outcome run(const Arguments& arguments, std::uint64_t address_bytes = RLIM_INFINITY) const
  {
    Process process(arguments, open_file("stdout"), open_file("stderr"), address_bytes);
    Outcome outcome;
    outcome.exit_code = process.wait();
    outcome.output = bytes_of_file(file("stdout"));
    outcome.errors = bytes_of_file(file("stderr"));
    return outcome;
  }

  /// Renders tiny: 16x16, 4 samples, unless `more` says otherwise; progress as JSON.
  Outcome render(const std::string& scene, const std::string& output, const Arguments& more = {}) const
  {
    return run(render_arguments(scene, output, more));
  }

  Arguments render_arguments(const std::string& scene, const std::string& output, const Arguments& more) const
  {
    Arguments all = {"render", scene, "-o", output, "--progress", "json", "--threads", "2"};
    const auto add = [&](const char* option, const char* value) {
      if (std::find(more.begin(), more.end(), option) == more.end()) all.insert(all.end(), {option, value});
    };
    add("--resolution", "16x16");
    add("--spp", "4");
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }

  TemporaryFolder folder_;
};

/// A white square of one metre in front of a grey surrounding that the camera sees as empty (coverage 0), and an orthographic
/// camera that sees x from −1 to 3 and y from −1.5 to 2.5.
inline GltfBuilder lit_square()
{
  GltfBuilder b = square_scene();
  b.json["extensionsUsed"] = {"RELIEF_environment"};
  b.json["extensions"]["RELIEF_environment"] = {{"color", {0.5, 0.5, 0.5}}};
  b.push("cameras", {{"type", "orthographic"},
                     {"name", "front"},
                     {"orthographic", {{"xmag", 2}, {"ymag", 2}, {"znear", 0.1}, {"zfar", 100}}}});
  b.root_node({{"name", "front"}, {"camera", 0}, {"translation", {1, 0.5, 5}}});
  return b;
}

/// The square as a wall, with a mirror for a floor and a lamp between the two, in place of a sky.
inline GltfBuilder mirrored_lamp()
{
  GltfBuilder b = lit_square();
  b.json["extensions"].erase("RELIEF_environment");
  b.json["extensionsUsed"] = {"KHR_lights_punctual"};
  b.json["extensions"]["KHR_lights_punctual"] = {{"lights", {{{"type", "point"}, {"intensity", 1}}}}};
  b.push("materials", {{"pbrMetallicRoughness", {{"metallicFactor", 0}, {"roughnessFactor", 1}}}});
  b.push("materials", {{"pbrMetallicRoughness", {{"metallicFactor", 1}, {"roughnessFactor", 0}}}});
  b.json["meshes"][0]["primitives"][0]["material"] = 0;
  nlohmann::json mirror = b.json["meshes"][0];
  mirror["primitives"][0]["material"] = 1;
  b.push("meshes", mirror);
  b.root_node({{"mesh", 1}, {"rotation", {0.70710678, 0, 0, 0.70710678}}});
  b.root_node({{"translation", {0.5, 0.5, 0.5}}, {"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  return b;
}

inline std::vector<float> values_of(const std::string& exr, const char* channel)
{
  const Picture picture = exr_load(exr);
  const Channel* found = picture.find(channel);
  EXPECT_NE(found, nullptr) << exr << " " << channel;
  return found == nullptr ? std::vector<float>() : found->values;
}

}  // namespace relief::test
