// Contracts: checked in debug and sanitizer builds, compiled out of release builds.
#pragma once

#ifdef RELIEF_ENABLE_ASSERTS
#include <cstdio>
#include <cstdlib>

#define RELIEF_ASSERT(condition)                                                            \
  do {                                                                                      \
    if (!(condition)) {                                                                     \
      std::fprintf(stderr, "%s:%d: contract broken: %s\n", __FILE__, __LINE__, #condition); \
      std::abort();                                                                         \
    }                                                                                       \
  } while (false)
#else
#define RELIEF_ASSERT(condition) static_cast<void>(sizeof(!(condition)))
#endif
