// Row of lobe parameters of a hair fibre.
#pragma once

#include "bsdf/basics/lobe_rows.hpp"
#include "bsdf/hair/inputs.hpp"
#include "math/power.hpp"
#include "math/transcendental.hpp"

namespace primray {

constexpr int kHairLobes = 4;  // reflected; transmitted; internally reflected once; more often

// Columns of a row; colours have three, and none is the last.
enum HairField : int {
  kHairAbsorption,
  kHairTint = kHairAbsorption + 3,  // of three lobes; the last uses the third's
  kHairVariance = kHairTint + 9,    // of three lobes, as are scales
  kHairScale = kHairVariance + 3,
  kHairIor = kHairScale + 3,
  kHairTilt,  // sine and cosine for each lobe but the last
  kHairFields = kHairTilt + 2 * 3
};

// Computes the columns of W rows of one surface with inputs `v`. Scales tilt reflected light by 2 alpha towards the root (-x),
// transmitted light by alpha and internally reflected light by 4 alpha towards the tip (Marschner et al. 2003, Chiang et al.
// 2016).
template <int W>
PRIMRAY_INLINE void reduce_hair(const HairValues<W>& v, vfloat<W> (&row)[kHairFields]) {
  const auto put = [&](int field, const vvec3<W>& c) { row[field] = c.x, row[field + 1] = c.y, row[field + 2] = c.z; };
  put(kHairAbsorption, v.absorption);
  put(kHairTint, v.tint_r), put(kHairTint + 3, v.tint_tt), put(kHairTint + 6, v.tint_trt);
  put(kHairVariance, {v.variance_r, v.variance_tt, v.variance_trt});
  put(kHairScale, {v.scale_r, v.scale_tt, v.scale_trt});
  row[kHairIor] = v.ior;
  const float times[3] = {2, -1, -4};
  for (int k = 0; k < 3; ++k) {
    const SinCos<W> t = sincos_turns(v.cuticle_tilt * (times[k] * 0.5f * kInvPi));
    row[kHairTilt + 2 * k] = t.sin, row[kHairTilt + 2 * k + 1] = t.cos;
  }
}

template <int W>
using HairRows = LobeRows<W>;

}  // namespace primray
