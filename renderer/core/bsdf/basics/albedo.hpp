// Directional albedos from a table (albedo_table.hpp), interpolated in lanes.
#pragma once

#include "bsdf/basics/albedo_table.hpp"
#include "math/vec3.hpp"

namespace primray {

// Fifth power of one minus a cosine, Schlick's term.
template <int W>
PRIMRAY_INLINE vfloat<W> pow5(vfloat<W> x) {
  const vfloat<W> x2 = x * x;
  return x2 * x2 * x;
}

// E = F0 * f0 + F90 * f90 of a GGX lobe.
template <int W>
struct LobeAlbedo {
  vfloat<W> f0, f90;
};

template <int W>
PRIMRAY_INLINE LobeAlbedo<W> ggx_albedo(vfloat<W> cos_theta, vfloat<W> roughness) {
  // See make_albedo_table.py for the axes.
  const vfloat<W> mu = clamp(cos_theta, 0.0f, 1.0f), r = clamp(roughness, kAlbedoSmoothest, 1.0f), alpha = r * r;
  const vfloat<W> y = (r - kAlbedoSmoothest) * (float(kAlbedoRoughnesses - 1) / (1.0f - kAlbedoSmoothest));
  const vfloat<W> x = sqrt(min(mu * (1.0f + 3.0f * alpha) / (mu + 3.0f * alpha), 1.0f)) * float(kAlbedoCosines - 1);
  const vint<W> yi = min(truncate(y), kAlbedoRoughnesses - 2), xi = min(truncate(x), kAlbedoCosines - 2);
  const vfloat<W> fy = y - to_float(yi), fx = x - to_float(xi);
  const vint<W> at = yi * vint<W>(2 * kAlbedoCosines) + xi + xi;
  // Pairs of two cosines, of both roughnesses.
  const FourLanes<float, W> p = gather_four<W>(kAlbedoPairs, at), q = gather_four<W>(kAlbedoPairs + 2 * kAlbedoCosines, at);
  const auto between = [&](vfloat<W> a, vfloat<W> b, vfloat<W> c, vfloat<W> d) {
    const vfloat<W> low = a + (b - a) * fx, high = c + (d - c) * fx;
    return low + (high - low) * fy;
  };
  const vfloat<W> total = min(between(p.x, p.z, q.x, q.z), 1.0f);
  const vfloat<W> fresnel_cosine = mu + alpha / (r + 0.05f) * between(p.y, p.w, q.y, q.w);
  const vfloat<W> m = clamp(1.0f - fresnel_cosine, 0.0f, 1.0f), m2 = m * m, share = m2 * m2 * m;
  return {total * (1.0f - share), total * share};
}

// Integral of (1 - wo.h)^5 cos / pi over wi.
template <int W>
PRIMRAY_INLINE vfloat<W> diffuse_fresnel_loss(vfloat<W> cos_theta) {
  const vfloat<W> x = clamp(cos_theta, 0.0f, 1.0f) * float(kDiffuseFresnelLosses - 1);
  const vint<W> i = min(truncate(x), kDiffuseFresnelLosses - 2);
  const TwoLanes<float, W> loss = gather_two<W>(kDiffuseFresnelLoss, i);
  return loss.x + (loss.y - loss.x) * (x - to_float(i));
}

}  // namespace primray
