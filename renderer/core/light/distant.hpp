// A light infinitely far away, seen under a cone about +z of its frame (it emits along -z). Angle 0: one direction.
#pragma once

#include "light/shape/local_shape.hpp"

namespace primray {

// `spread` = 1 - cos of the cone's half-angle, up to 2 (all directions); uniform over the cone.
template <int W>
PRIMRAY_INLINE LocalSample<W> distant_sample(vfloat<W> spread, vfloat<W> u, vfloat<W> v) {
  const vfloat<W> one_minus_cos = u * spread;
  const vfloat<W> sin_theta = safe_sqrt(one_minus_cos * (2.0f - one_minus_cos));
  const SinCos<W> phi = sincos_turns(v);
  const vfloat<W> pdf = 1.0f / (2.0f * kPi * max(spread, 1e-30f));
  return {{sin_theta * phi.cos, sin_theta * phi.sin, 1.0f - one_minus_cos},
          vfloat<W>(kInfinity),
          select(spread > vfloat<W>(0.0f), pdf, vfloat<W>(1.0f))};
}

template <int W>
PRIMRAY_INLINE LocalHit<W> distant_hit(const vvec3<W>& w, vfloat<W> spread) {
  // 1 - cos = sin^2 / (1 + cos) in front, so that a sun of half a degree keeps its digits.
  const vfloat<W> sin2 = w.x * w.x + w.y * w.y;
  const vfloat<W> one_minus_cos = select(w.z > vfloat<W>(0.0f), sin2 / (1.0f + w.z), 1.0f - w.z);
  const vbool<W> hit = (spread > vfloat<W>(0.0f)) & (one_minus_cos <= spread);
  return {vfloat<W>(kInfinity), select(hit, 1.0f / (2.0f * kPi * max(spread, 1e-30f)), vfloat<W>(0.0f))};
}

}  // namespace primray
