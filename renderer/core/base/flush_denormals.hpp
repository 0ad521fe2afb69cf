// Flush-to-zero mode: denormals are zero, for Embree's speed and for reproducible bits; renders set it on their own threads.
#pragma once

#include <xmmintrin.h>

namespace primray {

// Smallest float that such arithmetic distinguishes from 0: lower limits that keep a divisor from being 0 must not be smaller.
constexpr float kLeastNormal = 0x1p-126f;

inline void set_float_mode() { _mm_setcsr(_mm_getcsr() | 0x8040); }

// Sets the mode for its lifetime, on the thread that created it.
class FlushDenormals {
 public:
  FlushDenormals() : mode_(_mm_getcsr()) { set_float_mode(); }
  ~FlushDenormals() { _mm_setcsr(mode_); }

 private:
  unsigned mode_;
};

}  // namespace primray
