// How many rays tests trace, and which.
#pragma once

#include <cstdint>
#include <cstdlib>

namespace relief {

/// Rays of a test: as many as the environment variable RELIEF_TEST_RAYS says, for long runs, or its default.
inline std::uint64_t num_test_rays(std::uint64_t usual)
{
  const char* text = std::getenv("RELIEF_TEST_RAYS");
  return text != nullptr ? std::strtoull(text, nullptr, 10) : usual;
}

/// Which part of a long run this is: each has rays of its own, the same whenever it is run. The environment variable
/// RELIEF_TEST_PART, or 0.
inline std::uint64_t test_part()
{
  const char* text = std::getenv("RELIEF_TEST_PART");
  return text != nullptr ? std::strtoull(text, nullptr, 10) : 0;
}

}  // namespace relief
