// Interior of closed objects with an OpenPBR material: coefficients of a homogeneous medium from the inputs.
#pragma once

#include "bsdf/open_pbr/inputs.hpp"
#include "math/transcendental.hpp"

namespace primray {

// Coefficients per world unit of length.
template <int W>
struct Interior {
  vvec3<W> extinction{vfloat<W>(0.0f)};
  vvec3<W> scattering{vfloat<W>(0.0f)};  // below an opaque surface: as a share of the extinction
  vfloat<W> phase{0.0f};                 // mean cosine of the phase function (Henyey and Greenstein)
  PRIMRAY_INLINE vbool<W> exists() const { return max_component(extinction) > vfloat<W>(0.0f); }
};

// Beyond this the phase function is a peak that nothing resolves.
constexpr float kMostPhase = 0.98f;
// Limits of the density: a mean free path of this many world units is treated as zero.
constexpr float kLeastPath = 1e-12f, kDensest = 1e12f;

// "Translucent base": transmission_color is the transmittance of white light over transmission_depth; scattering that would
// exceed the extinction raises absorption by as much gray as needed. A channel of 0 keeps e^-85 of the light.
template <int W>
PRIMRAY_INLINE Interior<W> transmission_interior(const OpenPbrValues<W>& v) {
  using F = vfloat<W>;
  using V = vvec3<W>;
  const F zero(0.0f);
  const vbool<W> deep = v.transmission_depth > zero;
  const F per_length = select(deep, 1.0f / max(v.transmission_depth, kLeastPath), zero);
  const auto absorbed = [&](F x) { return -0.693147181f * log2_cosine(x, (1.0f - x) * (1.0f + x)) * per_length; };
  const V total{absorbed(v.transmission_color.x), absorbed(v.transmission_color.y), absorbed(v.transmission_color.z)};
  const V requested = v.transmission_scatter * per_length;
  const V scattering{min(requested.x, kDensest), min(requested.y, kDensest), min(requested.z, kDensest)};
  V absorption = total - scattering;
  absorption = absorption - V(min(min(min(absorption.x, absorption.y), absorption.z), 0.0f));
  return {absorption + scattering, scattering, clamp(v.transmission_scatter_anisotropy, -kMostPhase, kMostPhase)};
}

// "Subsurface": mean free paths of subsurface_radius times its scale, and the single-scattering albedo with which a half-space
// has subsurface_color, by van de Hulst's formula; exact for uniform illumination, as below a diffuse boundary.
template <int W>
PRIMRAY_INLINE Interior<W> subsurface_interior(const OpenPbrValues<W>& v) {
  using F = vfloat<W>;
  const F zero(0.0f), g = clamp(v.subsurface_scatter_anisotropy, -kMostPhase, kMostPhase);
  const auto extinction = [&](F scale) {
    const F path = v.subsurface_radius * scale;
    return 1.0f / max(path, kLeastPath);
  };
  const auto albedo = [&](F c) {
    const F s = 4.09712f + 4.20863f * c - sqrt(9.59217f + 41.6808f * c + 17.7126f * c * c), s2 = s * s;
    return clamp((1.0f - s2) / (1.0f - g * s2), 0.0f, 1.0f);
  };
  const vvec3<W>& scale = v.subsurface_radius_scale;
  const vbool<W> deep = v.subsurface_radius * max_component(scale) > F(kLeastPath);
  const vvec3<W> t{extinction(scale.x), extinction(scale.y), extinction(scale.z)};
  const vvec3<W>& c = v.subsurface_color;
  return {select(deep, t, vvec3<W>(zero)), {albedo(c.x), albedo(c.y), albedo(c.z)}, g};
}

// Albedo of a half-space with that interior, below a diffuse boundary: van de Hulst's formula is off by up to 4 % of a dark
// colour. A fit to the albedo by doubling (tests/images/open_pbr/test_unseen_walks.py) with an error of 3.3e-4 for mean cosines
// from 0 to 0.9; without a correction elsewhere.
constexpr float kMostFittedPhase = 0.9f;
template <int W>
PRIMRAY_RARE vvec3<W> walk_albedo(const OpenPbrValues<W>& v) {
  using F = vfloat<W>;
  const F g = v.subsurface_scatter_anisotropy;
  const vbool<W> fitted = (g >= F(0.0f)) & (g <= F(kMostFittedPhase));
  const F low = 0.03031f + g * (-0.10394f + g * 0.0945f), high = 0.00095f + g * (-0.03826f - g * 0.04689f);
  const auto of = [&](F c) {
    const F a = 1.0f - c, a2 = a * a, a4 = a2 * a2;
    return select(fitted, c * (1.0f + a4 * a * low + a4 * a4 * a4 * high), c);
  };
  const vvec3<W>& c = v.subsurface_color;
  return {of(c.x), of(c.y), of(c.z)};
}

}  // namespace primray
