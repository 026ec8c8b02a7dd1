// Denormals are off while rays are traced and shaded.
#pragma once

#include <pmmintrin.h>
#include <xmmintrin.h>

namespace relief {

/// Denormals cost hundreds of cycles and Embree asks for them to be off; restored at the end of the scope, because TBB
/// lends us its threads.
class FlushDenormals {
 public:
  FlushDenormals() : saved_(_mm_getcsr())
  {
    _MM_SET_FLUSH_ZERO_MODE(_MM_FLUSH_ZERO_ON);
    _MM_SET_DENORMALS_ZERO_MODE(_MM_DENORMALS_ZERO_ON);
  }
  ~FlushDenormals() { _mm_setcsr(saved_); }
  FlushDenormals(const FlushDenormals&) = delete;
  FlushDenormals& operator=(const FlushDenormals&) = delete;

 private:
  unsigned saved_;
};

}  // namespace relief
