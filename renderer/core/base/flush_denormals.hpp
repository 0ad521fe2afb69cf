// Denormals are zero, as Embree's speed and our bits want it: renders set it on threads of their own.
#pragma once

#include <xmmintrin.h>

namespace primray {

// The least float that such arithmetic tells from 0: what keeps a divisor from being 0 must not be smaller.
constexpr float kLeastNormal = 0x1p-126f;

inline void set_float_mode() { _mm_setcsr(_mm_getcsr() | 0x8040); }

// For as long as it lives, on the thread that made it.
class FlushDenormals {
 public:
  FlushDenormals() : mode_(_mm_getcsr()) { set_float_mode(); }
  ~FlushDenormals() { _mm_setcsr(mode_); }

 private:
  unsigned mode_;
};

}  // namespace primray
