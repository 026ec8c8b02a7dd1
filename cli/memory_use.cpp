#include "cli/memory_use.h"

#include <fstream>
#include <string>
#include <string_view>

#include <sys/resource.h>

namespace relief {

namespace {

/// A line of Linux's /proc/self/status, as bytes; 0: it is not there.
std::uint64_t status_bytes(std::string_view key)
{
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;) {
    std::uint64_t kibibytes = 0;
    if (word == key && status >> kibibytes) return kibibytes * 1024u;
  }
  return 0;
}

}  // namespace

std::uint64_t memory_bytes() { return status_bytes("VmRSS:"); }

std::uint64_t peak_memory_bytes()
{
  // Not what getrusage says, where Linux has it: there the size of the program that started this one counts too.
  if (const std::uint64_t most = status_bytes("VmHWM:")) return most;
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::uint64_t>(usage.ru_maxrss) * 1024u;
}

}  // namespace relief
