// Directional albedos by table (albedo_table.hpp), interpolated on lanes.
#pragma once

#include "bsdf/albedo_table.hpp"
#include "math/vec3.hpp"

namespace primray {

// E = F0 * f0 + F90 * f90 of a GGX lobe.
template <int W>
struct LobeAlbedo {
  vfloat<W> f0, f90;
};

template <int W>
PRIMRAY_INLINE LobeAlbedo<W> ggx_albedo(vfloat<W> cos_theta, vfloat<W> roughness) {
  const vfloat<W> mu = clamp(cos_theta, 0.0f, 1.0f), alpha = max(roughness * roughness, 1e-6f);
  const vfloat<W> y = clamp(roughness, 0.0f, 1.0f) * float(kAlbedoRoughnesses - 1);
  const vint<W> yi = min(truncate(y), kAlbedoRoughnesses - 2);
  const vfloat<W> fy = y - to_float(yi);
  const auto read = [&](const float* table, vfloat<W> column) {
    const vfloat<W> x = column * float(kAlbedoCosines - 1);
    const vint<W> xi = min(truncate(x), kAlbedoCosines - 2), at = yi * vint<W>(kAlbedoCosines) + xi;
    const vfloat<W> fx = x - to_float(xi);
    const vfloat<W> a = gather<W>(table, at), b = gather<W>(table + 1, at);
    const vfloat<W> c = gather<W>(table + kAlbedoCosines, at), d = gather<W>(table + kAlbedoCosines + 1, at);
    return (a + (b - a) * fx) * (1.0f - fy) + (c + (d - c) * fx) * fy;
  };
  // See make_albedo_table.py for the columns.
  const vfloat<W> total = read(kAlbedoTotal, sqrt(min(mu * (1.0f + alpha) / (mu + alpha), 1.0f)));
  const vfloat<W> fresnel_cosine = mu + roughness * read(kAlbedoFresnelExcess, sqrt(mu));
  const vfloat<W> m = clamp(1.0f - fresnel_cosine, 0.0f, 1.0f), m2 = m * m, share = m2 * m2 * m;
  return {total * (1.0f - share), total * share};
}

// Integral of (1 - wo.h)^5 cos / pi over wi.
template <int W>
PRIMRAY_INLINE vfloat<W> diffuse_fresnel_loss(vfloat<W> cos_theta) {
  const vfloat<W> x = clamp(cos_theta, 0.0f, 1.0f) * float(kAlbedoCosines - 1);
  const vint<W> i = min(truncate(x), kAlbedoCosines - 2);
  const vfloat<W> a = gather<W>(kDiffuseFresnelLoss, i), b = gather<W>(kDiffuseFresnelLoss + 1, i);
  return a + (b - a) * (x - to_float(i));
}

}  // namespace primray
