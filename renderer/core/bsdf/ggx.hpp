// GGX microfacet distribution in a local frame (normal = +z): density, Smith shadowing, sampling of visible normals.
#pragma once

#include "math/transcendental.hpp"

namespace primray {

// D(h), Walter et al. 2007, "Microfacet Models for Refraction through Rough Surfaces", eq. 33, expressed by h's components,
// which keeps a narrow peak precise.
template <int W>
PRIMRAY_INLINE vfloat<W> ggx_density(const vvec3<W>& h, vfloat<W> alpha) {
  const vfloat<W> a2 = alpha * alpha, q = h.x * h.x + h.y * h.y + a2 * h.z * h.z;
  return a2 / (kPi * q * q);
}

// Smith's Lambda; Heitz 2014, "Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs", eq. 72.
template <int W>
PRIMRAY_INLINE vfloat<W> ggx_lambda(const vvec3<W>& w, vfloat<W> alpha) {
  const vfloat<W> tan2 = (w.x * w.x + w.y * w.y) / max(w.z * w.z, 1e-18f);
  return 0.5f * (sqrt(1.0f + alpha * alpha * tan2) - 1.0f);
}

// Bound of the sampled cap of visible normals, beyond which wo would be reflected below the surface; Eto and Tokuyoshi 2023,
// "Bounded VNDF Sampling for Smith-GGX Reflections", their k for alpha <= 1.
template <int W>
PRIMRAY_INLINE vfloat<W> ggx_cap(const vvec3<W>& wo, vfloat<W> alpha) {
  const vfloat<W> s = 1.0f + safe_sqrt(wo.x * wo.x + wo.y * wo.y), s2 = s * s, a2 = alpha * alpha;
  return (1.0f - a2) * s2 / (s2 + a2 * wo.z * wo.z);
}

// Samples a normal h about which to reflect wo (wo.z > 0, alpha from 0 to 1): Dupuy and Benyoub 2023, "Sampling Visible GGX
// Normals with Spherical Caps", on the bounded cap.
template <int W>
PRIMRAY_INLINE vvec3<W> ggx_sample_normal(const vvec3<W>& wo, vfloat<W> alpha, vfloat<W> u, vfloat<W> v) {
  const vvec3<W> std = normalize(vvec3<W>(wo.x * alpha, wo.y * alpha, wo.z));
  const vfloat<W> lowest = ggx_cap(wo, alpha) * std.z, z = (1.0f - v) * (1.0f + lowest) - lowest;
  const vfloat<W> s = safe_sqrt(1.0f - z * z);
  const SinCos<W> phi = sincos_turns(u);
  const vvec3<W> h{s * phi.cos + std.x, s * phi.sin + std.y, z + std.z};
  return normalize(vvec3<W>(h.x * alpha, h.y * alpha, h.z));
}

// Density of wi = reflect(wo, h) per solid angle, divided by D(h).
template <int W>
PRIMRAY_INLINE vfloat<W> ggx_reflection_density(const vvec3<W>& wo, vfloat<W> alpha) {
  const vfloat<W> side2 = wo.x * wo.x + wo.y * wo.y;
  return 0.5f / (ggx_cap(wo, alpha) * wo.z + sqrt(alpha * alpha * side2 + wo.z * wo.z));
}

}  // namespace primray
