#include <cstdlib>
#include <string_view>

#include "denoise/fit_tile.h"

namespace relief {

FitTile fit_tile_select()
{
  const char* wish = std::getenv("RELIEF_ISA");
  const bool is_baseline = wish != nullptr && std::string_view(wish) == "baseline";
  const bool has_avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  return has_avx2 && !is_baseline ? fit_tile_avx2 : fit_tile_baseline;
}

}  // namespace relief
