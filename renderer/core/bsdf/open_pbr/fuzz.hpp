// OpenPBR's fuzz (sheen) lobe, a linearly transformed cosine: Zeltner, Burley and Chiang 2022, "Practical Multiple-Scattering
// Sheen Using Linearly Transformed Cosines", whose coefficients are in fuzz_table.cpp.
#pragma once

#include "bsdf/open_pbr/tables.hpp"
#include "math/transcendental.hpp"

namespace primray {

template <int W>
struct Fuzz {
  vfloat<W> a, b;       // coefficients of the inverse transformation (x, y, z) -> (a x + b z, a y, z); wo is in the xz plane
  vfloat<W> reflected;  // directional albedo of a white lobe
  vfloat<W> cos_phi, sin_phi;

  PRIMRAY_INLINE Fuzz() = default;
  PRIMRAY_INLINE Fuzz(const vvec3<W>& wo, vfloat<W> roughness) {
    const vfloat<W> y = clamp(roughness, 0.0f, 1.0f) * float(kFuzzNodes - 1),
                    x = clamp(wo.z, 0.0f, 1.0f) * float(kFuzzNodes - 1);
    const vint<W> yi = min(truncate(y), kFuzzNodes - 2), xi = min(truncate(x), kFuzzNodes - 2);
    const vfloat<W> fy = y - to_float(yi), fx = x - to_float(xi);
    const vint<W> at = (yi * vint<W>(kFuzzNodes) + xi) * vint<W>(3);
    // Three values of two nodes, of both roughnesses.
    const float* const second = kFuzzTable + 3 * kFuzzNodes;
    const FourLanes<float, W> p = gather_four<W>(kFuzzTable, at), r = gather_four<W>(second, at);
    const TwoLanes<float, W> q = gather_two<W>(kFuzzTable + 4, at), s = gather_two<W>(second + 4, at);
    const auto between = [&](vfloat<W> p0, vfloat<W> p1, vfloat<W> r0, vfloat<W> r1) {
      const vfloat<W> low = p0 + (p1 - p0) * fx, high = r0 + (r1 - r0) * fx;
      return low + (high - low) * fy;
    };
    // A smooth lobe reflects nothing, and its coefficients are undefined.
    a = max(between(p.x, p.w, r.x, r.w), 1e-3f), b = between(p.y, q.x, r.y, s.x), reflected = between(p.z, q.y, r.z, s.y);
    const vfloat<W> side2 = wo.x * wo.x + wo.y * wo.y, scale = 1.0f / sqrt(max(side2, 1e-12f));
    const vbool<W> aside = side2 > vfloat<W>(1e-12f);
    cos_phi = select(aside, wo.x * scale, 1.0f), sin_phi = select(aside, wo.y * scale, 0.0f);
  }
  // Density per solid angle of directions wi above the surface. The lobe times the cosine is `reflected` times this.
  PRIMRAY_INLINE vfloat<W> density(const vvec3<W>& wi) const {
    const vfloat<W> x = cos_phi * wi.x + sin_phi * wi.y, y = cos_phi * wi.y - sin_phi * wi.x;
    const vfloat<W> u = a * x + b * wi.z, v = a * y, z = max(wi.z, 0.0f), q = u * u + v * v + z * z;
    return a * a * z * kInvPi / max(q * q, 1e-20f);
  }
  PRIMRAY_INLINE vvec3<W> sample(vfloat<W> u, vfloat<W> v) const {
    const vfloat<W> r = sqrt(u);
    const SinCos<W> phi = sincos_turns(v);
    const vfloat<W> z = safe_sqrt(1.0f - u), x = (r * phi.cos - b * z) / a, y = r * phi.sin / a;
    const vvec3<W> w = normalize(vvec3<W>(x, y, z));
    return {cos_phi * w.x - sin_phi * w.y, cos_phi * w.y + sin_phi * w.x, w.z};
  }
};

}  // namespace primray
