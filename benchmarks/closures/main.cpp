// What closures cost: nanoseconds a hit, one thread, in each instruction set that this machine and this build have.
//
//   relief_bench_closures [--hits N] [--rounds N]
//
// Rounds go through all cases in turn, so that whatever else the machine does hits all alike; the best of each is printed.
#include <algorithm>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "benchmarks/closures/closures.h"

namespace relief {
namespace {

void bench(const char* isa, ClosureRound round, int num_hits, int num_rounds)
{
  std::vector<ClosureTimes> times(kMostClosureCases), best;
  for (int i = 0; i < num_rounds; ++i) {
    times.resize(static_cast<std::size_t>(round(num_hits, times.data())));
    if (best.empty()) best = times;
    for (std::size_t c = 0; c < times.size(); ++c) {
      for (int s = 0; s < kNumClosureSteps; ++s) {
        best[c].seconds[s] = std::min(best[c].seconds[s], times[c].seconds[s]);
      }
    }
  }
  fmt::print(
      "\n| {}: ns a hit | resolve | evaluate | sample | all three | in eights |\n| --- | --- | --- | --- | --- | --- "
      "|\n",
      isa);
  for (const ClosureTimes& t : best) {
    fmt::print("| {} |", t.name);
    for (const double seconds : t.seconds) fmt::print(" {:.0f} |", seconds * 1e9 / num_hits);
    fmt::print("\n");
  }
}

}  // namespace
}  // namespace relief

int main(int argc, char** argv)
{
  int num_hits = 4096, num_rounds = 20;
  CLI::App app{"Cost of closures"};
  app.add_option("--hits", num_hits, "Hits of each case, rounded up to eights")
      ->check(CLI::Range(8, relief::kMostClosureHits));
  app.add_option("--rounds", num_rounds)->check(CLI::Range(1, 10000));
  CLI11_PARSE(app, argc, argv);
  num_hits = (num_hits + 7) / 8 * 8;
#ifdef RELIEF_BUILT_baseline
  relief::bench("baseline", relief::closures_round_baseline, num_hits, num_rounds);
#endif
#ifdef RELIEF_BUILT_avx2
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) {
    relief::bench("AVX2", relief::closures_round_avx2, num_hits, num_rounds);
  }
#endif
  return 0;
}
