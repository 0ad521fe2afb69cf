// Powers of numbers up to 1 by polynomials, in lanes (see transcendental.hpp).
#pragma once

#include "math/vec3.hpp"

namespace primray {

// log2 of x >= 2^-126; error below 2e-7 where |log2 x| < 1, relative beyond. Uses log m = 2 artanh((m - 1) / (m + 1)) with m in
// [sqrt(1/2), sqrt(2)), and the series up to t^9.
template <int W>
PRIMRAY_INLINE vfloat<W> log2(vfloat<W> x) {
  const vint<W> bits = bit_cast<vint<W>>(x), root_half(0x3f3504f3);  // the float next to sqrt(1/2)
  const vint<W> exponent = (bits - root_half) >> 23;
  const vfloat<W> m = bit_cast<vfloat<W>>(bits - (exponent << 23));
  const vfloat<W> t = (m - 1.0f) / (m + 1.0f), t2 = t * t;
  const vfloat<W> series = 1.0f + t2 * (3.33333333e-1f + t2 * (2.0e-1f + t2 * (1.42857143e-1f + t2 * 1.11111111e-1f)));
  return to_float(exponent) + t * series * 2.88539008f;
}

// 2^z for z <= 0, relative error below 3e-7 down to 2^-126, and 0 below; the series of exp up to the 7th power.
template <int W>
PRIMRAY_INLINE vfloat<W> exp2_negative(vfloat<W> z) {
  const vbool<W> vanishes = z < vfloat<W>(-126.0f);
  const vfloat<W> kept = select(vanishes, vfloat<W>(0.0f), z);
  const vint<W> whole = floor_to_int(kept + 0.5f);
  const vfloat<W> f = (kept - to_float(whole)) * 0.693147181f;
  const vfloat<W> high = 4.16666667e-2f + f * (8.33333333e-3f + f * (1.38888889e-3f + f * 1.98412698e-4f));
  const vfloat<W> e = 1.0f + f * (1.0f + f * (0.5f + f * (1.66666667e-1f + f * high)));
  const vfloat<W> scale = bit_cast<vfloat<W>>((whole + vint<W>(127)) << 23);
  return select(vanishes, vfloat<W>(0.0f), e * scale);
}

// x^y for x in [0, 1] and y >= 0; x itself where y is 1.
template <int W>
PRIMRAY_INLINE vfloat<W> power_of_unit(vfloat<W> x, vfloat<W> y) {
  const vbool<W> positive = x >= vfloat<W>(0x1p-126f);
  const vfloat<W> power = exp2_negative<W>(y * min(log2<W>(select(positive, x, vfloat<W>(1.0f))), 0.0f));
  const vfloat<W> of_zero = select(y > vfloat<W>(0.0f), vfloat<W>(0.0f), vfloat<W>(1.0f));
  return select(y == vfloat<W>(1.0f), x, select(positive, power, of_zero));
}

}  // namespace primray
