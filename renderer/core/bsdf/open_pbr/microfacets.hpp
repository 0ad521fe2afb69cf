// Anisotropic GGX in the local frame with normal +z and tangent +x: density, Smith's shadowing, sampling of visible normals.
#pragma once

#include "math/transcendental.hpp"

namespace primray {

// Widths along both axes for roughness r and anisotropy a: OpenPBR 1.1.1, "Microfacet model".
template <int W>
struct Widths {
  vfloat<W> t, b;
};
template <int W>
PRIMRAY_INLINE Widths<W> widths_of(vfloat<W> alpha, vfloat<W> anisotropy) {
  const vfloat<W> aspect = 1.0f - anisotropy, t = alpha * sqrt(2.0f / (1.0f + aspect * aspect));
  return {t, aspect * t};
}

template <int W>
struct Facets {
  vfloat<W> alpha_t, alpha_b;
  vvec3<W> wo;
  vfloat<W> lambda_out;
  vvec3<W> stretched;  // wo in the space where the microfacets form a hemisphere, unit
  vfloat<W> length;    // its length before normalization

  PRIMRAY_INLINE Facets() = default;
  PRIMRAY_INLINE Facets(vfloat<W> t, vfloat<W> b, const vvec3<W>& out) : alpha_t(t), alpha_b(b), wo(out) {
    lambda_out = lambda(wo);
    const vvec3<W> s{wo.x * t, wo.y * b, wo.z};
    length = sqrt(max(dot(s, s), 1e-30f));
    stretched = s * (1.0f / length);
  }
  // Heitz 2014, eq. 72 and 85.
  PRIMRAY_INLINE vfloat<W> lambda(const vvec3<W>& w) const {
    const vfloat<W> x = w.x * alpha_t, y = w.y * alpha_b;
    return 0.5f * (sqrt(1.0f + (x * x + y * y) / max(w.z * w.z, 1e-18f)) - 1.0f);
  }
  // D(h), h.z > 0.
  PRIMRAY_INLINE vfloat<W> distribution(const vvec3<W>& h) const {
    const vfloat<W> x = h.x / alpha_t, y = h.y / alpha_b, q = x * x + y * y + h.z * h.z;
    return 1.0f / (kPi * alpha_t * alpha_b * q * q);
  }
  // D G2 / wo.z, with correlated heights (Heitz 2014, eq. 99), for light that leaves along wi on either side.
  PRIMRAY_INLINE vfloat<W> seen_both_ways(const vvec3<W>& h, const vvec3<W>& wi) const {
    return distribution(h) / (max(wo.z, 1e-9f) * (1.0f + lambda_out + lambda(wi)));
  }
  // Bound of the cap of visible normals, beyond which wo would be reflected below the surface: Eto and Tokuyoshi 2023.
  PRIMRAY_INLINE vfloat<W> cap() const {
    const vfloat<W> a = min(min(alpha_t, alpha_b), 1.0f), s = 1.0f + safe_sqrt(wo.x * wo.x + wo.y * wo.y), s2 = s * s,
                    a2 = a * a;
    return (1.0f - a2) * s2 / (s2 + a2 * wo.z * wo.z);
  }
  // Samples a normal: Dupuy and Benyoub 2023, over all visible normals (`part` 1) or the cap.
  PRIMRAY_INLINE vvec3<W> sample(vfloat<W> part, vfloat<W> u, vfloat<W> v) const {
    const vfloat<W> lowest = part * stretched.z, z = (1.0f - v) * (1.0f + lowest) - lowest, s = safe_sqrt(1.0f - z * z);
    const SinCos<W> phi = sincos_turns(u);
    const vvec3<W> h{s * phi.cos + stretched.x, s * phi.sin + stretched.y, z + stretched.z};
    return normalize(vvec3<W>(h.x * alpha_t, h.y * alpha_b, max(h.z, 1e-9f)));
  }
  // Density of reflections, per solid angle, for normals of the cap.
  PRIMRAY_INLINE vfloat<W> reflection_density(const vvec3<W>& h) const {
    return 0.5f * distribution(h) / max(cap() * wo.z + length, 1e-20f);
  }
  // Density among all visible normals.
  PRIMRAY_INLINE vfloat<W> normal_density(const vvec3<W>& h) const {
    return 2.0f * distribution(h) * max(dot(wo, h), 0.0f) / max(wo.z + length, 1e-20f);
  }
};

}  // namespace primray
