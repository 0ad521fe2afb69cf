// Trigonometric and other functions by polynomials, in lanes, so that their bits depend on no library and no CPU.
//
// Accuracies were measured against double precision over the stated ranges by tests/unit/core/test_transcendental.py.
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
  const vfloat<W> clamped = select(vanishes, vfloat<W>(0.0f), z);
  const vint<W> whole = floor_to_int(clamped + 0.5f);
  const vfloat<W> f = (clamped - to_float(whole)) * 0.693147181f;
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

constexpr float kPi = 3.14159265358979f;
constexpr float kInvPi = 0.318309886183791f;

template <int W>
struct SinCos {
  vfloat<W> sin, cos;
};

// Sine and cosine of 2 pi u, |u| < 2^20; absolute error below 2e-7. Reduced to an eighth of a turn, then Taylor polynomials in
// 2 pi u, whose truncation error there is below 1e-8.
template <int W>
PRIMRAY_INLINE SinCos<W> sincos_turns(vfloat<W> u) {
  const vint<W> quarter = floor_to_int(u * 4.0f + 0.5f);
  const vfloat<W> x = (u - to_float(quarter) * 0.25f) * 6.28318530717959f;
  const vfloat<W> x2 = x * x;
  const vfloat<W> s = x + x * x2 * (-1.66666667e-1f + x2 * (8.33333333e-3f + x2 * (-1.98412698e-4f + x2 * 2.75573192e-6f)));
  const vfloat<W> c = 1.0f + x2 * (-0.5f + x2 * (4.16666667e-2f + x2 * (-1.38888889e-3f + x2 * 2.48015873e-5f)));
  const vbool<W> odd = (quarter & vint<W>(1)) != vint<W>(0);
  const vint<W> sign_sin = (quarter & vint<W>(2)) << 30;
  const vint<W> sign_cos = ((quarter + vint<W>(1)) & vint<W>(2)) << 30;
  return {bit_cast<vfloat<W>>(bit_cast<vint<W>>(select(odd, c, s)) ^ sign_sin),
          bit_cast<vfloat<W>>(bit_cast<vint<W>>(select(odd, s, c)) ^ sign_cos)};
}

// Arc sine over sqrt-reduced |x| <= 0.5; coefficients of the Taylor series with the last one fitted to the end of the range.
template <int W>
PRIMRAY_INLINE vfloat<W> asin_core(vfloat<W> x, vfloat<W> x2) {
  return x + x * x2 *
                 (1.66666667e-1f +
                  x2 * (7.5e-2f + x2 * (4.46428571e-2f +
                                        x2 * (3.0381944e-2f + x2 * (2.2372159e-2f + x2 * (1.7352764e-2f + x2 * 1.95e-2f))))));
}

// Arc cosine; |x| is clamped to 1; absolute error below 4e-7.
template <int W>
PRIMRAY_INLINE vfloat<W> acos(vfloat<W> x) {
  const vfloat<W> a = min(abs(x), 1.0f);
  const vbool<W> large = a > vfloat<W>(0.5f);
  const vfloat<W> z2 = select(large, (1.0f - a) * 0.5f, a * a);
  const vfloat<W> z = select(large, sqrt(z2), a);
  const vfloat<W> s = asin_core(z, z2);
  const vfloat<W> positive = select(large, 2.0f * s, 0.5f * kPi - s);
  return select(x < vfloat<W>(0.0f), kPi - positive, positive);
}

// The angle of (x, y) in (-pi, pi]; absolute error below 1e-6; 0 where both are 0. Arc tangent on [0, tan(pi/8)] by its Taylor
// series.
template <int W>
PRIMRAY_INLINE vfloat<W> atan2(vfloat<W> y, vfloat<W> x) {
  const vfloat<W> ax = abs(x), ay = abs(y);
  const vbool<W> steep = ay > ax;
  const vfloat<W> lo = select(steep, ax, ay), hi = select(steep, ay, ax);
  const vfloat<W> t = lo / select(hi == vfloat<W>(0.0f), vfloat<W>(1.0f), hi);
  // atan t = pi/4 + atan((t - 1) / (t + 1)) keeps the argument within tan(pi/8).
  const vbool<W> upper = t > vfloat<W>(0.41421356f);
  const vfloat<W> z = select(upper, (t - 1.0f) / (t + 1.0f), t);
  const vfloat<W> z2 = z * z;
  vfloat<W> a =
      z + z * z2 *
              (-3.33333333e-1f +
               z2 * (2.0e-1f + z2 * (-1.42857143e-1f + z2 * (1.11111111e-1f + z2 * (-9.0909091e-2f + z2 * 6.8e-2f)))));
  a = select(upper, 0.25f * kPi + a, a);
  a = select(steep, 0.5f * kPi - a, a);
  a = select(x < vfloat<W>(0.0f), kPi - a, a);
  return copysign(a, y);
}

// 1 / sqrt(a) for normal a > 0, with a relative error below 5e-6: two steps of Newton's method from a linear estimate of the
// logarithm. For weights that need no more, in a third of the time of the division and the root.
template <int W>
PRIMRAY_INLINE vfloat<W> quick_rsqrt(vfloat<W> a) {
  const vfloat<W> half = 0.5f * a;
  vfloat<W> r = bit_cast<vfloat<W>>(vuint<W>(0x5f3759dfu) - (bit_cast<vuint<W>>(a) >> 1));
  r = r * (1.5f - half * r * r);
  return r * (1.5f - half * r * r);
}

// Inverse hyperbolic tangent, |z| < 0.18, by its series; relative truncation error below 1e-8.
template <int W>
PRIMRAY_INLINE vfloat<W> atanh_core(vfloat<W> z) {
  const vfloat<W> z2 = z * z;
  return z + z * z2 * (3.33333333e-1f + z2 * (2.0e-1f + z2 * (1.42857143e-1f + z2 * 1.11111111e-1f)));
}

// log2 |c| of a cosine c, where `sin2` is the square of the sine: computed from the sine near 1, where c itself is too
// imprecise. -123 at most where c is 0. Relative error below 1e-6.
template <int W>
PRIMRAY_INLINE vfloat<W> log2_cosine(vfloat<W> c, vfloat<W> sin2) {
  const vint<W> a = bit_cast<vint<W>>(max(abs(c), 1e-37f));
  // c = m 2^e with m in [sqrt(1/2), sqrt 2): ln m = 2 atanh((m - 1) / (m + 1)). ln c = atanh(-sin2 / (2 - sin2)).
  const vint<W> e = (a - vint<W>(0x3f3504f3)) >> 23;
  const vfloat<W> m = bit_cast<vfloat<W>>(a - (e << 23));
  const vbool<W> near_one = sin2 < vfloat<W>(0.29f);
  const vfloat<W> z = select(near_one, -sin2 / (2.0f - sin2), (m - 1.0f) / (m + 1.0f));
  const vfloat<W> l = atanh_core(z) * 1.44269504f;
  return select(near_one, l, to_float(e) + 2.0f * l);
}

// 2^x, x <= 127; relative error below 3e-7; 0 below 2^-126. Taylor series on [-1/2, 1/2].
template <int W>
PRIMRAY_INLINE vfloat<W> exp2(vfloat<W> x) {
  const vfloat<W> clamped = max(x, -200.0f);
  const vint<W> whole = floor_to_int(clamped + 0.5f);
  const vfloat<W> f = clamped - to_float(whole);
  const vfloat<W> part =
      1.0f + f * (6.93147181e-1f +
                  f * (2.40226507e-1f +
                       f * (5.55041087e-2f +
                            f * (9.61812911e-3f + f * (1.33335581e-3f + f * (1.54035304e-4f + f * 1.52527338e-5f))))));
  const vfloat<W> scale = bit_cast<vfloat<W>>((max(whole, -126) + vint<W>(127)) << 23);
  return select(whole < vint<W>(-126), vfloat<W>(0.0f), part * scale);
}

// e^-x.
template <int W>
PRIMRAY_INLINE vfloat<W> exp_of_minus(vfloat<W> x) {
  return exp2(-1.44269504f * x);
}

}  // namespace primray
