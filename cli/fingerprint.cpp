#include "cli/fingerprint.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <iterator>
#include <memory>
#include <string_view>

#include <fmt/format.h>

#include "exporters/errors.h"
#include "exporters/exr.h"
#include "exporters/side_file.h"
#include "scene/memory.h"
#include "scene/setting_values.h"

namespace relief {

namespace {

// Options by which no picture differs: --threads, --progress, --log, --preview, --checkpoint and --grace change how it comes about, the
// others which files are read and whether the run fails. The scene counts with its content.
constexpr std::string_view kUncounted[] = {"--help",       "scene",        "--frames",    "--resume",  "--strict",
                                           "--threads",    "--progress",   "--reference", "--preview", "--max-memory",
                                           "--checkpoint", "--keep-going", "--grace",     "--log"};
// Options that do nothing but change one of the RenderSettings, which count as they come out. So it is one whether the scene says
// something, the command line, or nobody.
constexpr std::string_view kDeclared[] = {
    "--resolution",   "--spp",  "--seed",     "--max-bounces",     "--caustics",
    "--filter",       "--view", "--exposure", "--noise-threshold", "--luminous-efficacy",
    "--filter-glossy"};
// Only whether they are given counts, and not where the files are.
constexpr std::string_view kOutputs[] = {"--output", "--png", "--stats", "--report"};

template <class Names>
bool is_among(const Names& names, const CLI::Option& option)
{
  return std::any_of(std::begin(names), std::end(names),
                     [&](std::string_view name) { return option.check_name(std::string(name)); });
}

/// Hash of a file's bytes; empty if there is none, or if it is no file, and so cannot be looked at again.
std::string file_hash(const std::filesystem::path& path)
{
  std::error_code ignored;
  if (path.empty() || !std::filesystem::is_regular_file(path, ignored)) return {};
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rb"), &std::fclose);
  if (!file) return {};
  std::uint64_t hash = hash_of({});
  std::array<char, 1 << 16> block;
  for (std::size_t size = 0; (size = std::fread(block.data(), 1, block.size(), file.get())) > 0;) {
    hash = hash_of({block.data(), size}, hash);
  }
  return fmt::format("{:016x}", hash);
}

}  // namespace

std::vector<std::string> settings_given(const CLI::App& command)
{
  std::vector<std::string> settings;
  for (const CLI::Option* option : command.get_options()) {
    if (option->count() == 0 || is_among(kUncounted, *option) || is_among(kDeclared, *option)) continue;
    settings.push_back(option->get_name());
    if (is_among(kOutputs, *option)) continue;
    settings.insert(settings.end(), option->results().begin(), option->results().end());
  }
  return settings;
}

std::string render_fingerprint(const std::vector<std::string>& options,
                               const RenderSettings& settings,
                               std::optional<int> frame,
                               const std::vector<FileStamp>& files)
{
  // Lengths keep apart what stands side by side.
  std::string text = fmt::format("{}\n{}\n", RELIEF_VERSION, frame ? std::to_string(*frame) : "rest");
  for (const std::string& option : options) text += fmt::format("{} {}\n", option.size(), option);
  for (const SettingValue& setting : setting_values(settings)) text += setting_text(setting.value) + '\n';
  for (const FileStamp& file : files) {
    text += fmt::format("{} {} {} {}\n", file.inode, file.bytes, file.modified_ns, file.changed_ns);
  }
  return fmt::format("{:016x}", hash_of(text));
}

Attributes frame_attributes(const FramePaths& paths, const std::string& fingerprint)
{
  Attributes attributes = {{"relief:fingerprint", fingerprint},
                           {"relief:png_hash", file_hash(paths.png)},
                           {"relief:stats_hash", file_hash(paths.stats)},
                           {"relief:report_hash", file_hash(paths.report)}};
  std::erase_if(attributes, [](const auto& entry) { return entry.second.empty(); });
  return attributes;
}

bool is_whole_render(const FramePaths& paths, const std::string& fingerprint)
{
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(paths.exr, ignored)) return false;
  const auto is_there = [&](const std::filesystem::path& path) {
    return path.empty() || std::filesystem::exists(path, ignored);
  };
  if (!is_there(paths.png) || !is_there(paths.stats) || !is_there(paths.report)) return false;
  try {
    // Reading all of it also finds a file that was cut short while it was copied.
    const Attributes found = exr_load(paths.exr).attributes;
    const Attributes expected = frame_attributes(paths, fingerprint);
    return std::all_of(expected.begin(), expected.end(), [&](const auto& entry) {
      const auto at = found.find(entry.first);
      return at != found.end() && at->second == entry.second;
    });
  } catch (const InputError&) {
    return false;
  } catch (const OutOfMemory&) {
    // A damaged header may claim anything. A render of what it claims would need more than reading it, and say so.
    return false;
  }
}

}  // namespace relief
