// What this process takes of the machine's memory.
#pragma once

#include <cstdint>

namespace relief {

/// Resident now; 0 where the system does not say.
std::uint64_t memory_bytes();

/// The most that was resident at a time.
std::uint64_t peak_memory_bytes();

}  // namespace relief
