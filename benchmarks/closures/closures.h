// What the bench of closures measures, for its two halves: closures.cpp is compiled once an instruction set, as the stages
// are that it stands for.
#pragma once

#include <cstdint>

namespace relief {

/// Steps of a hit.
enum class ClosureStep : std::uint8_t {
  kResolve,   ///< from closures with their inputs to lobes
  kEvaluate,  ///< of all lobes, towards a lamp
  kSample,    ///< a direction, and all lobes towards it
  kHit,       ///< the three, one hit after the other
  kEight,     ///< the three, each for eight hits before the next; plain Principled ones as columns
  kCount
};
inline constexpr int kNumClosureSteps = static_cast<int>(ClosureStep::kCount);

/// Seconds that all hits of each case took in a round.
struct ClosureTimes {
  const char* name = nullptr;
  double seconds[kNumClosureSteps] = {};
  float sum = 0;  ///< of what came out, so that it is computed
};

inline constexpr int kMostClosureCases = 64;

/// Runs all cases once.
/// @param num_hits  multiple of 8, at most kMostClosureHits
/// @param times     room for kMostClosureCases
/// @return          how many cases there are
using ClosureRound = int (*)(int num_hits, ClosureTimes* times);
inline constexpr int kMostClosureHits = 1 << 14;

int closures_round_baseline(int num_hits, ClosureTimes* times);
int closures_round_avx2(int num_hits, ClosureTimes* times);

}  // namespace relief
