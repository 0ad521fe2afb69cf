// A fibre of hair as a row of numbers that its lobes are made of.
#pragma once

#include "bsdf/hair/inputs.hpp"
#include "math/power.hpp"
#include "math/transcendental.hpp"

namespace primray {

constexpr int kHairLobes = 4;  // reflected; passing; after one reflection within; after more

// Columns of a row; colours have three, and none is a row's last.
enum HairField : int {
  kHairAbsorption,
  kHairTint = kHairAbsorption + 3,  // of three lobes; the last has the third's
  kHairVariance = kHairTint + 9,    // likewise, as are scales
  kHairScale = kHairVariance + 3,
  kHairIor = kHairScale + 3,
  kHairTilt,  // sine and cosine of each lobe's, the last having none
  kHairFields = kHairTilt + 2 * 3
};

// Columns of W rows of one surface whose inputs are `v`. Scales tilt what is reflected by 2 alpha towards the root (-x), what passes
// by alpha and what is reflected within by 4 alpha towards the tip (Marschner et al. 2003, Chiang et al. 2016).
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

// Where the rows of W lanes stand.
template <int W>
struct HairRows {
  const float* rows;
  vint<W> base;
  PRIMRAY_INLINE vfloat<W> operator()(int field) const { return gather<W>(rows + field, base); }
  PRIMRAY_INLINE vvec3<W> color(int field) const {
    const FourLanes<float, W> c = gather_four<W>(rows + field, base);
    return {c.x, c.y, c.z};
  }
};

}  // namespace primray
