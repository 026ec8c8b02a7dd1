#include "cli/run_files.h"

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <system_error>

#include <sys/stat.h>
#include <unistd.h>

#include <fmt/format.h>
#include <CLI/App.hpp>

#include "exporters/atomic_file.h"
#include "exporters/errors.h"

namespace relief {

namespace {

std::string lower_case(std::string text)
{
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

[[noreturn]] void refuse(const std::string& option, const std::string& expected, const std::string& found)
{
  throw CLI::ValidationError(option, fmt::format("expected {}, found {}", expected, found));
}

}  // namespace

RunFiles::Place RunFiles::place_of(const std::filesystem::path& file) const
{
  Place place;
  const std::filesystem::path destination = output_destination(file);
  const std::string folder = destination.parent_path().string();
  auto [known, is_new] = canonical_.try_emplace(folder);
  if (is_new) {
    std::error_code ignored;
    known->second = std::filesystem::weakly_canonical(folder.empty() ? "." : folder, ignored).string();
  }
  place.name = known->second + "/" + destination.filename().string();
  struct stat status {};
  if (::stat(destination.c_str(), &status) != 0) return place;
  place.is_stream = S_ISREG(status.st_mode) == 0 && S_ISDIR(status.st_mode) == 0;
  place.identity = {status.st_dev, status.st_ino};
  return place;
}

void RunFiles::refuse_input(const std::string& option, const std::filesystem::path& file, const Place& place) const
{
  if (place.is_stream) return;
  const Known* input = nullptr;
  if (const auto found = input_of_name_.find(place.name); found != input_of_name_.end()) {
    input = &inputs_[found->second];
  } else if (place.identity) {
    const auto same = input_of_identity_.find(*place.identity);
    if (same != input_of_identity_.end()) input = &inputs_[same->second];
  }
  if (input == nullptr) return;
  refuse(option, "a file that this run does not read",
         input->name == file ? fmt::format("'{}', which is read as {}", input->name, input->what)
                             : fmt::format("'{}', which is '{}', read as {}", file.string(), input->name, input->what));
}

void RunFiles::add_output(const std::string& option, const std::filesystem::path& file)
{
  if (file.empty()) return;
  const Place place = place_of(file);
  if (place.is_stream) return;
  std::error_code ignored;
  if (std::filesystem::is_directory(file, ignored)) {
    throw OutputError(file.string(), std::generic_category().message(EISDIR));
  }
  refuse_input(option, file, place);
  const std::size_t index = outputs_.size();
  outputs_.push_back({option, file.string(), place.name});
  std::size_t same = output_of_name_.try_emplace(lower_case(place.name), index).first->second;
  if (same == index && place.identity) same = output_of_identity_.try_emplace(*place.identity, index).first->second;
  if (same == index) return;
  refuse(option, "a file that nothing else is written to",
         fmt::format("'{}', which is '{}' of {}", file.string(), outputs_[same].name, outputs_[same].what));
}

void RunFiles::add_input(const std::string& what, const std::filesystem::path& file)
{
  if (file.empty()) return;
  const Place place = place_of(file);
  if (place.is_stream) return;
  const auto [at, is_new] = input_of_name_.try_emplace(place.name, inputs_.size());
  if (is_new) inputs_.push_back({what, file.string(), place.name});
  if (place.identity) input_of_identity_.try_emplace(*place.identity, at->second);
  const Known* output = nullptr;
  // What is read exists, so that its identity tells whether a name in other letters is the same file.
  const auto found = output_of_name_.find(lower_case(place.name));
  if (found != output_of_name_.end() && outputs_[found->second].place == place.name) output = &outputs_[found->second];
  if (output == nullptr && place.identity) {
    const auto same = output_of_identity_.find(*place.identity);
    if (same != output_of_identity_.end()) output = &outputs_[same->second];
  }
  if (output != nullptr) refuse_input(output->what, output->name, place);
}

void RunFiles::add_inputs(const std::string& what, const std::vector<FileStamp>& files)
{
  for (const FileStamp& file : files) add_input(what, file.path);
}

void RunFiles::check_output(const std::string& option, const std::filesystem::path& file) const
{
  if (file.empty()) return;
  const Place place = place_of(file);
  refuse_input(option, file, place);
  const auto found = output_of_name_.find(lower_case(place.name));
  if (found == output_of_name_.end() || outputs_[found->second].name == file) return;
  refuse(option, "a file that nothing else is written to",
         fmt::format("'{}', which is '{}' of {}", file.string(), outputs_[found->second].name,
                     outputs_[found->second].what));
}

bool is_standard_output(const std::filesystem::path& path)
{
  struct stat file {
  }, output{}, nowhere{};
  const auto same = [&](const struct stat& other) {
    return file.st_dev == other.st_dev && file.st_ino == other.st_ino;
  };
  if (::stat(path.c_str(), &file) != 0 || ::fstat(STDOUT_FILENO, &output) != 0 || !same(output)) return false;
  // Nobody reads what both throw away.
  return ::stat("/dev/null", &nowhere) != 0 || !same(nowhere);
}

void check_writable(const std::filesystem::path& path)
{
  if (path.empty() || is_stream(output_destination(path))) return;
  const AtomicFile probe(path);
}

}  // namespace relief
