// Distant light: infinitely far away, seen under a cone about +z of its frame (it emits along -z). Angle 0: a single direction.
#pragma once

#include "light/types/light_type.hpp"

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
  // 1 - cos = sin^2 / (1 + cos) in the front half, which stays precise for a sun of half a degree.
  const vfloat<W> sin2 = w.x * w.x + w.y * w.y;
  const vfloat<W> one_minus_cos = select(w.z > vfloat<W>(0.0f), sin2 / (1.0f + w.z), 1.0f - w.z);
  const vbool<W> hit = (spread > vfloat<W>(0.0f)) & (one_minus_cos <= spread);
  return {vfloat<W>(kInfinity), select(hit, 1.0f / (2.0f * kPi * max(spread, 1e-30f)), vfloat<W>(0.0f))};
}

struct DistantLight : LightTypeDefaults {
  static constexpr LightType kType = LightType::kDistant;
  static constexpr const char* kName = "DISTANT";

  template <int W>
  static PRIMRAY_INLINE LocalSample<W> sample(const LightRow<W>& row, const vvec3<W>&, const vvec3<W>&, vfloat<W> u,
                                              vfloat<W> v) {
    return distant_sample(row(kSize0), u, v);
  }
  template <int W>
  static PRIMRAY_INLINE vbool<W> is_delta(const LightRow<W>& row) {
    return row(kSize0) == vfloat<W>(0.0f);
  }
  template <int W>
  static PRIMRAY_INLINE LocalHit<W> hit(const LightRow<W>& row, const vvec3<W>&, const vvec3<W>&, const vvec3<W>& w) {
    return distant_hit(w, row(kSize0));
  }
  template <int W>
  static PRIMRAY_INLINE vfloat<W> importance(const float*, const vvec3<W>&, vfloat<W>, vfloat<W> power) {
    return power;
  }
  // Direction to the light (+z of its frame), and the spread of the cone about it, 1 - cos = kSize0.
  static dvec3 far_direction(const float* row) { return light_vector(row, kAxisZ); }
  static double far_half_extent(const float* row) {
    const double spread = row[kSize0];
    return spread < 1 ? std::sqrt(spread * (2 - spread)) : 2.0;
  }
};

}  // namespace primray
