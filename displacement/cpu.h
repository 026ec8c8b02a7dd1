// What the processor can run of what was compiled more than once.
#pragma once

#include <cpuid.h>

namespace relief {

/// All that the files are compiled with whose tables are called avx2.
inline bool cpu_has_avx2()
{
  // Clang 14 has no name for F16C.
  unsigned eax = 0, ebx = 0, ecx = 0, edx = 0;
  const bool has_f16c = __get_cpuid(1, &eax, &ebx, &ecx, &edx) != 0 && (ecx & bit_F16C) != 0;
  return has_f16c && __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi2");
}

}  // namespace relief
