// Interference in a thin film: Airy's series with each channel's mean over wavelengths computed in Fourier space, after Belcour
// and Barla 2017, "A Practical Extension to Microfacet Theory for the Modeling of Varying Iridescence". Amplitudes are complex
// numbers here, so one formula serves dielectrics, metals and total reflection. A channel's response is their fit of the CIE's
// observer (from their supplemental code) in linear Rec.709, divided by its own value at zero retardation, so that a film of
// zero thickness has no effect.
#pragma once

#include "math/transcendental.hpp"

namespace primray {

template <int W>
struct Complex {
  vfloat<W> re, im;
  PRIMRAY_INLINE friend Complex operator+(const Complex& a, const Complex& b) { return {a.re + b.re, a.im + b.im}; }
  PRIMRAY_INLINE friend Complex operator-(const Complex& a, const Complex& b) { return {a.re - b.re, a.im - b.im}; }
  PRIMRAY_INLINE friend Complex operator*(const Complex& a, const Complex& b) {
    return {a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
  }
  PRIMRAY_INLINE friend Complex operator*(const Complex& a, vfloat<W> b) { return {a.re * b, a.im * b}; }
  PRIMRAY_INLINE friend Complex operator/(const Complex& a, const Complex& b) {
    const vfloat<W> scale = 1.0f / max(b.re * b.re + b.im * b.im, 1e-20f);
    return {(a.re * b.re + a.im * b.im) * scale, (a.im * b.re - a.re * b.im) * scale};
  }
};
template <int W>
PRIMRAY_INLINE vfloat<W> square_of(const Complex<W>& a) {
  return a.re * a.re + a.im * a.im;
}
// Square root in the first quadrant, of numbers with a non-negative imaginary part.
template <int W>
PRIMRAY_INLINE Complex<W> root_of(const Complex<W>& a) {
  const vfloat<W> size = sqrt(square_of(a));
  return {safe_sqrt(0.5f * (size + a.re)), safe_sqrt(0.5f * (size - a.re))};
}

// Reflected amplitudes at an interface: `c1` and `c2` are n cos(theta) before and beyond it, `n1` and `n2` the indices.
template <int W>
struct Amplitudes {
  Complex<W> s, p;
  PRIMRAY_INLINE Amplitudes(const Complex<W>& n1, const Complex<W>& c1, const Complex<W>& n2, const Complex<W>& c2) {
    s = (c1 - c2) / (c1 + c2);
    const Complex<W> a = n2 * n2 * c1, b = n1 * n1 * c2;
    p = (a - b) / (a + b);
  }
};

// Responses of the three channels to cos(retardation + shift); `path` in nanometres.
template <int W>
PRIMRAY_INLINE vvec3<W> film_response(vfloat<W> path, vfloat<W> shift) {
  // Height, position and squared width of Gaussians over wave numbers; the last one is the second lobe of X.
  constexpr float kHeight[4] = {5.4856e-13f, 4.4201e-13f, 5.2481e-13f, 9.7470e-14f};
  constexpr float kPlace[4] = {1.6810e6f, 1.7953e6f, 2.2084e6f, 2.2399e6f};
  constexpr float kWidth[4] = {4.3278e9f, 9.3046e9f, 6.6121e9f, 4.5282e9f};
  constexpr float kFromXyz[3][3] = {
      {3.2404542f, -1.5371385f, -0.4985314f}, {-0.9692660f, 1.8760108f, 0.0415560f}, {0.0556434f, -0.2040259f, 1.0572252f}};
  constexpr float kTurn = 0.159154943f;
  const vfloat<W> phase = path * 6.28318531e-9f;
  vfloat<W> wave[4];
  float still[4];
  for (int k = 0; k < 4; ++k) {
    still[k] = kHeight[k] * __builtin_sqrtf(6.28318531f * kWidth[k]) * 1e7f;
    const vfloat<W> turns = (phase * kPlace[k] + shift) * kTurn;
    wave[k] = still[k] * sincos_turns(turns).cos * exp2(phase * phase * (-1.44269504f * kWidth[k]));
  }
  const auto channel = [&](const float (&m)[3]) {
    const float white = m[0] * (still[0] + still[3]) + m[1] * still[1] + m[2] * still[2];
    return ((wave[0] + wave[3]) * m[0] + wave[1] * m[1] + wave[2] * m[2]) * (1.0f / white);
  };
  return {channel(kFromXyz[0]), channel(kFromXyz[1]), channel(kFromXyz[2])};
}

// Reflectance of one channel in both polarizations: `first` + sum over k of responses weighted by `wave`^k; for a film between
// index `n1` and the complex index `n3`, seen from n1 at that cosine. `thickness` in micrometres.
template <int W>
struct ThinFilm {
  vfloat<W> n1, n2, thickness;

  // Reflectance of the three channels, for an object with the same index in all of them.
  PRIMRAY_INLINE vvec3<W> reflectance(vfloat<W> cosine, const Complex<W>& n3) const {
    using F = vfloat<W>;
    const F zero(0.0f), c = clamp(cosine, 1e-4f, 1.0f), side = n1 * n1 * (1.0f - c * c);
    const Complex<W> outer{n1, zero}, film{n2, zero};
    const Complex<W> c1{n1 * c, zero}, c2 = root_of(Complex<W>{n2 * n2 - side, zero});
    const Complex<W> c3 = root_of(n3 * n3 - Complex<W>{side, zero});
    const Amplitudes<W> top(outer, c1, film, c2), bottom(film, c2, n3, c3);
    // Each further pass through the film is retarded by 2 n2 d cos(theta_2); no light enters under total reflection.
    const F path = 2000.0f * thickness * c2.re;
    const vvec3<W> both = airy(top.s, bottom.s, path) + airy(top.p, bottom.p, path);
    return {clamp(0.5f * both.x, 0.0f, 1.0f), clamp(0.5f * both.y, 0.0f, 1.0f), clamp(0.5f * both.z, 0.0f, 1.0f)};
  }

 private:
  PRIMRAY_INLINE static vvec3<W> airy(const Complex<W>& top, const Complex<W>& bottom, vfloat<W> path) {
    using F = vfloat<W>;
    const F r12 = min(square_of(top), 1.0f), r23 = min(square_of(bottom), 1.0f), through = 1.0f - r12;
    // Factor of one round trip: reflected internally at the top, which changes the sign, and at the bottom.
    const Complex<W> loop = bottom * Complex<W>{-top.re, -top.im};
    const F turn = atan2(loop.im, loop.re), each = sqrt(r12 * r23);
    const F mean = through * through * r23 / max(1.0f - r12 * r23, 1e-6f);
    vvec3<W> sum(r12 + mean);
    F weight = mean - through;
    for (int k = 1; k <= 3; ++k) {
      weight = weight * each;
      sum += film_response(path * float(k), turn * float(k)) * (2.0f * weight);
    }
    return sum;
  }
};

// Complex index, relative to that of the medium above it, of a metal with reflectance `f0` at normal incidence and that edge
// tint: Gulbrandsen 2014, "Artist Friendly Metallic Fresnel".
template <int W>
PRIMRAY_INLINE Complex<W> metal_index(vfloat<W> f0, vfloat<W> edge) {
  const vfloat<W> r = clamp(f0, 0.0f, 0.999f), root = sqrt(r), g = clamp(edge, 0.0f, 1.0f);
  const vfloat<W> n = g * ((1.0f - r) / (1.0f + r)) + (1.0f - g) * ((1.0f + root) / (1.0f - root));
  return {n, safe_sqrt((r * (n + 1.0f) * (n + 1.0f) - (n - 1.0f) * (n - 1.0f)) / (1.0f - r))};
}

}  // namespace primray
