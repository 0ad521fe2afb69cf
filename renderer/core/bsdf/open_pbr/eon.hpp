// Diffuse lobe: energy-preserving Oren-Nayar; Portsmouth, Kutz and Hill 2025, "EON: A Practical Energy-Preserving Rough Diffuse
// BRDF", with the exact albedo of its single scattering.
#pragma once

#include "math/transcendental.hpp"

namespace primray {

template <int W>
struct Eon {
  vfloat<W> roughness, scale;  // scale: A in the paper
  vfloat<W> lost_out, lost_mean;

  PRIMRAY_INLINE Eon() = default;
  PRIMRAY_INLINE Eon(vfloat<W> sigma, vfloat<W> cos_out) : roughness(sigma) {
    scale = 1.0f / (1.0f + (0.5f - 2.0f / (3.0f * kPi)) * sigma);
    lost_out = lost(cos_out);
    lost_mean = 1.0f - scale * (1.0f + (2.0f / 3.0f - 28.0f / (15.0f * kPi)) * sigma);
  }
  // Share of light that single scattering loses on a white surface.
  PRIMRAY_INLINE vfloat<W> lost(vfloat<W> cosine) const {
    const vfloat<W> c = clamp(cosine, 0.0f, 1.0f), s = safe_sqrt(1.0f - c * c);
    const vfloat<W> g = s * (acos(c) - s * c) + (2.0f / 3.0f) * (s * c * (1.0f + s + s * s) / (1.0f + s) - s);
    return max(1.0f - scale * (1.0f + roughness * kInvPi * g), 0.0f);
  }
  // f for albedo `rho`, both cosines not negative.
  PRIMRAY_INLINE vvec3<W> operator()(const vvec3<W>& rho, const vvec3<W>& wo, const vvec3<W>& wi) const {
    const vfloat<W> side = wo.x * wi.x + wo.y * wi.y, larger = max(max(wo.z, wi.z), 1e-6f);
    const vfloat<W> ratio = select(side > vfloat<W>(0.0f), side / larger, side);
    const vfloat<W> single = kInvPi * scale * (1.0f + roughness * ratio);
    const vfloat<W> multiple = kInvPi * lost_out * lost(wi.z) * (1.0f - lost_mean) / max(lost_mean, 1e-7f);
    const auto channel = [&](vfloat<W> r) { return r * single + r * r * multiple / (1.0f - r * lost_mean); };
    return {channel(rho.x), channel(rho.y), channel(rho.z)};
  }
};

}  // namespace primray
