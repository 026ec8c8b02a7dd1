#include <cstdlib>
#include <stdexcept>
#include <string>
#include <vector>

#include "displacement/cpu.h"
#include "displacement/embree_geometry.h"
#include "integrator/graph_bounds_stage.h"
#include "integrator/isa.h"
#include "integrator/stages.h"

namespace relief {

namespace {

/// All that graph_run_avx512 is compiled with besides.
[[maybe_unused]] bool has_avx512()
{
  return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
         __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw");
}

/// What was compiled for one instruction set.
struct Built {
  const StageTable* stages;
  GraphBoundsRun run_bounds;
  const TraversalTable* traversals;
  const char* description;
};

/// What was built (RELIEF_ISAS in CMake) and runs here, the best first.
std::vector<Built> built_that_run()
{
  std::vector<Built> built;
#ifdef RELIEF_BUILT_avx2
  static const StageTable avx2 = [] {
    StageTable table = stage_table_avx2();
#ifdef RELIEF_BUILT_avx512
    if (has_avx512()) table.run_graph = graph_run_avx512;
#endif
    return table;
  }();
  if (cpu_has_avx2()) {
    built.push_back({&avx2, graph_bounds_avx2, &traversal_table_avx2(),
                     avx2.run_graph == graph_run_avx2 ? "avx2" : "avx2, value graphs avx512"});
  }
#endif
#ifdef RELIEF_BUILT_baseline
  built.push_back({&stage_table_baseline(), graph_bounds_baseline, &traversal_table_baseline(), "baseline"});
#endif
  return built;
}

Built built_select()
{
  const std::vector<Built> built = built_that_run();
  if (built.empty()) {
    throw std::runtime_error("expected a processor with AVX2, FMA, BMI2 and F16C: this relief was built for " RELIEF_ISAS
                             " alone");
  }
  const char* wish = std::getenv("RELIEF_ISA");
  const std::string isa = wish == nullptr ? "" : wish;
  if (isa.empty()) return built.front();
  std::string known;
  for (auto one = built.rbegin(); one != built.rend(); ++one) {
    if (isa == one->stages->isa) return *one;
    known += (known.empty() ? "'" : " or '") + std::string(one->stages->isa) + "'";
  }
  throw std::runtime_error("$RELIEF_ISA: expected " + known + ", found '" + isa + "'");
}

}  // namespace

const StageTable& stage_table_select() { return *built_select().stages; }

GraphBoundsRun graph_bounds_select() { return built_select().run_bounds; }

const TraversalTable& traversal_table_select() { return *built_select().traversals; }

std::string isa_description()
{
  const std::vector<Built> built = built_that_run();
  return std::string(RELIEF_ISAS) + " (here: " + (built.empty() ? "none of them" : built.front().description) + ")";
}

}  // namespace relief
