#include "scene/memory.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdio>
#include <fstream>
#include <limits>
#include <mutex>
#include <utility>

#include <sys/resource.h>
#include <unistd.h>

namespace relief {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kUnlimited = std::numeric_limits<std::uint64_t>::max();

std::atomic<std::uint64_t> limit_by_option{0};
std::mutex reserved_mutex;
std::uint64_t reserved_bytes = 0;

/// A number in a file; unlimited if there is no file or something else in it, such as "max".
std::uint64_t number_in(const fs::path& file)
{
  std::ifstream stream(file);
  std::uint64_t value = 0;
  return stream >> value ? value : kUnlimited;
}

/// The least of a file's numbers in a folder and all folders above it, up to `top`.
std::uint64_t least_upwards(const fs::path& top, fs::path group, const char* name)
{
  std::uint64_t least = kUnlimited;
  while (true) {
    least = std::min(least, number_in(top / group / name));
    if (group.empty()) {
      return least;
    }
    group = group.parent_path();
  }
}

/// Pages of the address space, and of those the ones in memory. @source proc(5), statm
struct Used {
  std::uint64_t address_bytes = 0, resident_bytes = 0;
};

Used memory_used()
{
  // No stream: this is asked for every image, and where there is no memory for one.
  Used used;
  unsigned long long size = 0, resident = 0;
  if (std::FILE* file = std::fopen("/proc/self/statm", "r")) {
    if (std::fscanf(file, "%llu %llu", &size, &resident) == 2) {
      const auto page = static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
      used = {size * page, resident * page};
    }
    std::fclose(file);
  }
  return used;
}

MemoryLimit machine_limit()
{
  const auto pages = static_cast<std::uint64_t>(std::max(0L, ::sysconf(_SC_PHYS_PAGES)));
  const MemoryLimit machine{pages * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE)), "the machine's memory"};
  const MemoryLimit group{cgroup_memory_limit("/"), "what the control group allows"};
  return group.bytes < machine.bytes ? group : machine;
}

std::uint64_t address_space_limit()
{
  rlimit limit{};
  return ::getrlimit(RLIMIT_AS, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY ? limit.rlim_cur : kUnlimited;
}

std::uint64_t difference(std::uint64_t a, std::uint64_t b) { return a > b ? a - b : 0; }

[[noreturn]] void refuse(std::uint64_t bytes, std::string_view what, const Used& used, std::uint64_t address_limit)
{
  const MemoryLimit limit = memory_limit();
  const bool is_address = difference(address_limit, used.address_bytes) < difference(limit.bytes, used.resident_bytes);
  const std::uint64_t most = is_address ? address_limit : limit.bytes;
  const std::uint64_t taken = is_address ? used.address_bytes : used.resident_bytes;
  throw OutOfMemory(std::string(what) + ": needs up to " + memory_text(bytes) + " where " + memory_text(taken) +
                    " of " + memory_text(most) + " are taken (" +
                    (is_address ? "the address space allowed, ulimit -v" : limit.reason) + ")");
}

/// Whether there is room besides what is reserved.
bool fits(std::uint64_t bytes, const Used& used, std::uint64_t address_limit)
{
  return bytes <= difference(memory_limit().bytes, used.resident_bytes) &&
         bytes <= difference(address_limit, used.address_bytes);
}

}  // namespace

std::uint64_t cgroup_memory_limit(const fs::path& root)
{
  std::ifstream groups(root / "proc/self/cgroup");
  std::uint64_t least = kUnlimited;
  // "0::/a/b" of version 2, "7:cpu,memory:/a/b" of version 1.
  for (std::string line; std::getline(groups, line);) {
    const std::size_t first = line.find(':'), second = line.find(':', first + 1);
    if (first == std::string::npos || second == std::string::npos) {
      continue;
    }
    const std::string controllers = ',' + line.substr(first + 1, second - first - 1) + ',';
    const fs::path group = fs::path(line.substr(second + 1)).relative_path();
    if (controllers == ",,") {
      least = std::min(least, least_upwards(root / "sys/fs/cgroup", group, "memory.max"));
    } else if (controllers.find(",memory,") != std::string::npos) {
      least = std::min(least, least_upwards(root / "sys/fs/cgroup/memory", group, "memory.limit_in_bytes"));
    }
  }
  return least;
}

MemoryLimit memory_limit()
{
  if (const std::uint64_t bytes = limit_by_option) {
    return {bytes, "--max-memory"};
  }
  static const MemoryLimit machine = machine_limit();
  return machine;
}

void memory_limit_set(std::uint64_t bytes) { limit_by_option = std::max<std::uint64_t>(bytes, 1); }

void memory_limit_reset() { limit_by_option = 0; }

std::uint64_t memory_left()
{
  const Used used = memory_used();
  return std::min(difference(memory_limit().bytes, used.resident_bytes),
                  difference(address_space_limit(), used.address_bytes));
}

MemoryReservation::MemoryReservation(std::uint64_t bytes, std::string_view what)
{
  const Used used = memory_used();
  const std::uint64_t address_limit = address_space_limit();
  const std::lock_guard<std::mutex> guard(reserved_mutex);
  const std::uint64_t all = bytes > kUnlimited - reserved_bytes ? kUnlimited : bytes + reserved_bytes;
  if (!fits(all, used, address_limit)) {
    refuse(bytes, what, used, address_limit);
  }
  bytes_ = bytes;
  reserved_bytes = all;
}

MemoryReservation::MemoryReservation(MemoryReservation&& other) noexcept : bytes_(std::exchange(other.bytes_, 0)) {}

MemoryReservation& MemoryReservation::operator=(MemoryReservation&& other) noexcept
{
  release();
  bytes_ = std::exchange(other.bytes_, 0);
  return *this;
}

void MemoryReservation::release()
{
  if (bytes_ > 0) {
    const std::lock_guard<std::mutex> guard(reserved_mutex);
    reserved_bytes -= std::exchange(bytes_, 0);
  }
}

void memory_require(std::uint64_t bytes, std::string_view what) { const MemoryReservation room(bytes, what); }

bool is_out_of_memory(std::string_view error)
{
  const std::uint64_t limit = address_space_limit();
  if (limit == kUnlimited) {
    return false;
  }
  using namespace std::string_view_literals;
  constexpr std::array kWords = {"bad_alloc"sv, "memory"sv,      "Memory"sv,        "No space"sv,
                                 "allocat"sv,   "unavailable"sv, "failed to map"sv, "Failed to allocate"sv};
  constexpr std::uint64_t kLittle = std::uint64_t{64} << 20;
  return difference(limit, memory_used().address_bytes) < kLittle ||
         std::any_of(kWords.begin(), kWords.end(),
                     [&](std::string_view word) { return error.find(word) != std::string_view::npos; });
}

std::string memory_text(std::uint64_t bytes)
{
  constexpr const char* kUnits[] = {"KiB", "MiB", "GiB", "TiB"};
  double size = static_cast<double>(bytes) / 1024;
  std::size_t unit = 0;
  for (; size >= 1024 && unit + 1 < std::size(kUnits); ++unit) {
    size /= 1024;
  }
  char text[32];
  std::snprintf(text, sizeof text, "%.1f %s", size, kUnits[unit]);
  return text;
}

}  // namespace relief
