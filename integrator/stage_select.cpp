#include <cstdlib>
#include <stdexcept>
#include <string>
#include <string_view>

#include <cpuid.h>

#include "displacement/embree_geometry.h"
#include "integrator/graph_bounds_stage.h"
#include "integrator/stages.h"

namespace relief {

namespace {

/// All that the files are compiled with whose table is called avx2.
bool has_avx2()
{
  // Clang 14 has no name for F16C.
  unsigned eax = 0, ebx = 0, ecx = 0, edx = 0;
  const bool has_f16c = __get_cpuid(1, &eax, &ebx, &ecx, &edx) != 0 && (ecx & bit_F16C) != 0;
  return has_f16c && __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi2");
}

/// All that graph_run_avx512 is compiled with besides.
bool has_avx512()
{
  return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
         __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw");
}

/// The best there is.
const StageTable& stage_table_best()
{
  if (!has_avx2()) return stage_table_baseline();
  if (!has_avx512()) return stage_table_avx2();
  static const StageTable table = [] {
    StageTable with_graphs = stage_table_avx2();
    with_graphs.run_graph = graph_run_avx512;
    return with_graphs;
  }();
  return table;
}

}  // namespace

const StageTable& stage_table_select()
{
  const char* wish = std::getenv("RELIEF_ISA");
  const std::string isa = wish == nullptr ? "" : wish;
  if (isa.empty()) return stage_table_best();
  if (isa == "baseline") return stage_table_baseline();
  if (isa == "avx2" && has_avx2()) return stage_table_avx2();
  throw std::runtime_error("$RELIEF_ISA: expected 'baseline'" + std::string(has_avx2() ? " or 'avx2'" : "") +
                           ", found '" + isa + "'");
}

GraphBoundsRun graph_bounds_select()
{
  return std::string_view(stage_table_select().isa) == "avx2" ? graph_bounds_avx2 : graph_bounds_baseline;
}

const TraversalTable& traversal_table_select()
{
  return std::string_view(stage_table_select().isa) == "avx2" ? traversal_table_avx2() : traversal_table_baseline();
}

}  // namespace relief
