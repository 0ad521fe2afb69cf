// Elementary functions of any number, in lanes, by polynomials (see math/transcendental.hpp); undefined values are 0.
//
// Accuracies were measured against double precision by tests/unit/core/patterns.
#pragma once

#include "math/transcendental.hpp"

namespace primray::pattern {

template <int W>
PRIMRAY_INLINE vfloat<W> floor(vfloat<W> x) {
  // Beyond 2^23 a float has no fraction.
  return select(abs(x) < vfloat<W>(0x1p23f), to_float(floor_to_int(x)), x);
}

template <int W>
PRIMRAY_INLINE vfloat<W> divide(vfloat<W> a, vfloat<W> b) {
  return select(b == vfloat<W>(0.0f), 0.0f, a / b);
}

// Sine and cosine of an angle in radians, below 1e4; absolute error below 2e-7. Reduced by pi / 2 in three parts (Cody and
// Waite), then Taylor polynomials as in sincos_turns().
template <int W>
PRIMRAY_INLINE SinCos<W> sincos(vfloat<W> x) {
  const vint<W> quarter = floor_to_int(x * 0.636619772f + 0.5f);
  const vfloat<W> k = to_float(quarter);
  const vfloat<W> r = ((x - k * 1.5703125f) - k * 4.83751297e-4f) - k * 7.54978995e-8f;
  const vfloat<W> r2 = r * r;
  const vfloat<W> s = r + r * r2 * (-1.66666667e-1f + r2 * (8.33333333e-3f + r2 * (-1.98412698e-4f + r2 * 2.75573192e-6f)));
  const vfloat<W> c = 1.0f + r2 * (-0.5f + r2 * (4.16666667e-2f + r2 * (-1.38888889e-3f + r2 * 2.48015873e-5f)));
  const vbool<W> odd = (quarter & vint<W>(1)) != vint<W>(0);
  const vint<W> sign_sin = (quarter & vint<W>(2)) << 30, sign_cos = ((quarter + vint<W>(1)) & vint<W>(2)) << 30;
  return {bit_cast<vfloat<W>>(bit_cast<vint<W>>(select(odd, c, s)) ^ sign_sin),
          bit_cast<vfloat<W>>(bit_cast<vint<W>>(select(odd, s, c)) ^ sign_cos)};
}

template <int W>
PRIMRAY_INLINE vfloat<W> asin(vfloat<W> x) {
  const vfloat<W> a = min(abs(x), 1.0f);
  const vfloat<W> small = asin_core(a, a * a), z2 = (1.0f - a) * 0.5f, z = sqrt(z2);
  return copysign(select(a > vfloat<W>(0.5f), 0.5f * kPi - 2.0f * asin_core(z, z2), small), x);
}

// Exponential up to 2^128, which is infinite. x = k ln 2 + r by two parts of ln 2; the series of exp up to the seventh power.
template <int W>
PRIMRAY_INLINE vfloat<W> exp(vfloat<W> x) {
  const vfloat<W> clamped = clamp(x, -87.0f, 89.0f);
  const vint<W> whole = floor_to_int(clamped * 1.44269504f + 0.5f);
  const vfloat<W> k = to_float(whole), r = (clamped - k * 0.693359375f) - k * -2.12194440e-4f;
  const vfloat<W> high = 4.16666667e-2f + r * (8.33333333e-3f + r * (1.38888889e-3f + r * 1.98412698e-4f));
  const vfloat<W> part = 1.0f + r * (1.0f + r * (0.5f + r * (1.66666667e-1f + r * high)));
  // Apply half of the exponent at a time: 2^128 is not a float.
  const vint<W> half = whole >> 1;
  const auto power = [](vint<W> n) { return bit_cast<vfloat<W>>((n + vint<W>(127)) << 23); };
  return select(x < vfloat<W>(-87.0f), 0.0f, part * power(half) * power(whole - half));
}

constexpr float kLeastLn = 0x1p-126f;  // smaller arguments have its logarithm

template <int W>
PRIMRAY_INLINE vfloat<W> ln(vfloat<W> x) {
  return log2<W>(max(x, kLeastLn)) * 0.693147181f;
}

// Negative numbers have powers with integer exponents only; 0 has none with negative ones.
template <int W>
PRIMRAY_INLINE vfloat<W> power(vfloat<W> x, vfloat<W> y) {
  using F = vfloat<W>;
  const F a = abs(x), z = clamp(y * log2<W>(max(a, kLeastLn)), -150.0f, 128.0f);
  F r = exp2(z - 1.0f) * 2.0f;
  const F half = y * 0.5f;
  const vbool<W> whole = floor(y) == y, odd = whole & !(floor(half) == half), negative = x < F(0.0f);
  r = select(negative, select(whole, select(odd, -r, r), 0.0f), r);
  r = select(a == F(0.0f), 0.0f, r);
  r = select(y == F(1.0f), x, r);
  return select(y == F(0.0f), 1.0f, r);
}

}  // namespace primray::pattern
