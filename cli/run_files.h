// What a run reads and what it writes, so that the one never destroys the other.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "scene/file_stamp.h"

namespace relief {

/// Every file of a run under every name that it may have: names are followed through symbolic links, and files that exist are
/// known by device and inode, so that hard links, and letters that a file system takes for one, count too. Devices and pipes
/// are no files in this sense.
/// Where something is the same file, CLI::ValidationError (exit code 2) names the option of the output.
class RunFiles {
 public:
  /// Declares what will be written. An empty name declares nothing.
  /// @param option  that asks for it, such as "--png"
  /// @error also OutputError, if it is a folder
  void add_output(const std::string& option, const std::filesystem::path& file);

  /// Declares what is read.
  /// @param what  for messages: "the scene", "--reference"
  void add_input(const std::string& what, const std::filesystem::path& file);
  void add_inputs(const std::string& what, const std::vector<FileStamp>& files);

  /// Looks once more, just before a file is written: links may have been made since it was declared.
  void check_output(const std::string& option, const std::filesystem::path& file) const;

 private:
  using Identity = std::pair<std::uint64_t, std::uint64_t>;  ///< device, inode
  struct Known {
    std::string what;  ///< option of an output, role of an input
    std::string name;  ///< as the user gave it
    std::string place;
  };
  struct Place {
    std::string name;                  ///< end of all links, in a canonical folder
    std::optional<Identity> identity;  ///< if there is a file
    bool is_stream = false;
  };

  Place place_of(const std::filesystem::path& file) const;
  void refuse_input(const std::string& option, const std::filesystem::path& file, const Place& place) const;

  std::vector<Known> outputs_, inputs_;
  /// Indices of the above. Outputs go by names in lower case: of two that differ in case alone nobody can say beforehand
  /// whether a file system tells them apart.
  std::unordered_map<std::string, std::size_t> output_of_name_, input_of_name_;
  std::map<Identity, std::size_t> output_of_identity_, input_of_identity_;
  mutable std::unordered_map<std::string, std::string> canonical_;  ///< of folders that were met
};

/// Whether what is written to a file stands among what is printed: it is standard output, whatever its name.
bool is_standard_output(const std::filesystem::path& path);

/// Fails now if a file could not be written after hours of work. Pipes are left alone: their reader would see an end.
/// @error OutputError
void check_writable(const std::filesystem::path& path);

}  // namespace relief
