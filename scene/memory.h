// How much memory a run may take, and what is said where it does not suffice. A file of 300 bytes can ask for gigabytes, so
// whoever is about to allocate what a file says asks here first: an allocation alone would succeed, and the machine would
// come to a halt later.
#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <new>
#include <string>
#include <string_view>

namespace relief {

/// Memory did not suffice, or would not have. what() is the text that follows "out of memory: ".
class OutOfMemory : public std::bad_alloc {
 public:
  explicit OutOfMemory(std::string text) : text_(std::make_shared<const std::string>(std::move(text))) {}
  const char* what() const noexcept override { return text_->c_str(); }

 private:
  std::shared_ptr<const std::string> text_;  ///< shared: copying an exception must not throw
};

/// Most that this process may hold in memory.
struct MemoryLimit {
  std::uint64_t bytes = 0;
  const char* reason = "";  ///< for messages: "the machine's memory"
};

/// What --max-memory says; without it the least of the machine's memory and what its control groups (versions 1 and 2) allow.
MemoryLimit memory_limit();

/// Sets the limit in the place of the machine's and the control groups'. Before other threads ask.
void memory_limit_set(std::uint64_t bytes);
/// Takes that back.
void memory_limit_reset();

/// What the control groups of a process allow, the least of its own and those above it.
/// @param root  folder in which proc/self and sys/fs/cgroup are; "/" but for tests
/// @return      bytes; the largest number if there is no limit
std::uint64_t cgroup_memory_limit(const std::filesystem::path& root);

/// Bytes that may still be taken: up to the limit, and to the end of the address space that a shell allows (ulimit -v).
std::uint64_t memory_left();

/// Room for what is about to be allocated, kept until the object goes. Several threads that each look at what is left would
/// else all find the same room. While it is held, what has been allocated of it counts twice.
class MemoryReservation {
 public:
  MemoryReservation() = default;
  /// @param what  whom the memory is for, such as "scene.gltf: /images/0"
  /// @error OutOfMemory with the numbers, if there is not so much
  MemoryReservation(std::uint64_t bytes, std::string_view what);
  ~MemoryReservation() { release(); }
  MemoryReservation(MemoryReservation&& other) noexcept;
  MemoryReservation& operator=(MemoryReservation&& other) noexcept;
  MemoryReservation(const MemoryReservation&) = delete;
  MemoryReservation& operator=(const MemoryReservation&) = delete;

 private:
  void release();

  std::uint64_t bytes_ = 0;
};

/// Fails unless there is room, without keeping it.
/// @error OutOfMemory
void memory_require(std::uint64_t bytes, std::string_view what);

/// For what grows by little pieces: looks at the memory each time they have come to something.
class MemoryWatch {
 public:
  /// @error OutOfMemory
  void add(std::uint64_t bytes, std::string_view what)
  {
    constexpr std::uint64_t kStep = std::uint64_t{16} << 20;
    if ((bytes_ += bytes) >= kStep) {
      bytes_ = 0;
      memory_require(std::max(bytes, kStep), what);
    }
  }

 private:
  std::uint64_t bytes_ = 0;
};

/// Whether a library's error came of a lack of memory, as far as can be told: by its words, or since the address space that a
/// shell allows is all but used up. Without such a limit it is not: then only absurd sizes fail, which are the file's fault.
bool is_out_of_memory(std::string_view error);

/// A size for people: "8.4 GiB".
std::string memory_text(std::uint64_t bytes);

}  // namespace relief
