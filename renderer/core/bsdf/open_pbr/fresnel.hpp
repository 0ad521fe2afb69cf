// Fresnel reflectance of interfaces for unpolarized light, by the cosine with the (micro)normal, and indices of dispersive
// glass.
#pragma once

#include "bsdf/basics/albedo.hpp"
#include "math/lanes.hpp"

namespace primray {

// Wavelengths of dispersion, one per channel: 611, 549 and 464 nm, at the primaries of Rec.709, as Cauchy's formula has them.
constexpr double inverse_square(double nm) { return 1 / (nm * nm); }
constexpr double kDispersionRange = inverse_square(486.1) - inverse_square(656.3);  // of the Fraunhofer lines F and C
constexpr float channel_at(double nm) { return float((inverse_square(nm) - inverse_square(587.6)) / kDispersionRange); }
constexpr float kCauchyCoordinate[3] = {channel_at(611), channel_at(549), channel_at(464)};

// Value for each lane's channel: 0, 1 or 2.
template <int W>
PRIMRAY_INLINE vfloat<W> channel_of(vint<W> k) {
  using F = vfloat<W>;
  return select(k == vint<W>(0), F(kCauchyCoordinate[0]),
                select(k == vint<W>(1), F(kCauchyCoordinate[1]), F(kCauchyCoordinate[2])));
}

// Cauchy's formula: n = n_d + (n_d - 1) / V (1 / l^2 - 1 / l_d^2) / (1 / l_F^2 - 1 / l_C^2), from `index` n_d, 1 / V, and the
// channel's kCauchyCoordinate.
template <int W>
PRIMRAY_INLINE vfloat<W> dispersed_index(vfloat<W> index, vfloat<W> inverse_abbe, vfloat<W> channel) {
  return index + (index - 1.0f) * inverse_abbe * channel;
}

// Reflectance of a dielectric with eta = eta_t / eta_i; 1 under total internal reflection.
template <int W>
PRIMRAY_INLINE vfloat<W> dielectric_fresnel(vfloat<W> cosine, vfloat<W> eta) {
  const vfloat<W> c = clamp(cosine, 0.0f, 1.0f), inverse = 1.0f / eta, sin2 = (1.0f - c * c) * inverse * inverse;
  const vfloat<W> t = eta * safe_sqrt(1.0f - sin2), e2 = eta * eta * c;
  const vfloat<W> s = (c - t) / max(c + t, 1e-20f), p = (e2 - t) / max(e2 + t, 1e-20f);
  return select(sin2 >= vfloat<W>(1.0f), vfloat<W>(1.0f), 0.5f * (s * s + p * p));
}

// E_F: cosine-weighted hemispherical average of the Fresnel reflectance for eta from 1 to 5, within 8e-4 of quadrature.
template <int W>
PRIMRAY_INLINE vfloat<W> mean_fresnel(vfloat<W> eta) {
  const vfloat<W> e = (eta - 1.0f) / (eta + 1.0f);
  return e * (0.56522418f + e * (-1.19131499f + e * (4.22872656f + e * (-5.11220986f + e * 2.64015372f))));
}

// Internal reflectance of the surface of a coat with relative index `eta` (OpenPBR 1.1.1, "Darkening", K_r).
template <int W>
PRIMRAY_INLINE vfloat<W> internal_reflection(vfloat<W> eta) {
  const vbool<W> denser = eta >= vfloat<W>(1.0f);
  const vfloat<W> mean = mean_fresnel(select(denser, eta, 1.0f / eta));
  return select(denser, 1.0f - (1.0f - mean) / (eta * eta), mean);
}

// Kutz et al. 2021, "Novel Aspects of the Adobe Standard Material": Schlick's curve from `f0`, tinted where the cosine is 1/7.
template <int W>
struct MetalFresnel {
  vvec3<W> f0, dip;  // dip: reduction by the tint there, over mu (1 - mu)^6

  PRIMRAY_INLINE MetalFresnel() = default;
  PRIMRAY_INLINE MetalFresnel(const vvec3<W>& reflected, const vvec3<W>& tint) : f0(reflected) {
    constexpr float kMu = 1.0f / 7, kLeft = 6.0f / 7, kFifth = kLeft * kLeft * kLeft * kLeft * kLeft;
    const vvec3<W> one(vfloat<W>(1.0f)), schlick = f0 + (one - f0) * vfloat<W>(kFifth);
    dip = schlick * (one - tint) * vfloat<W>(1 / (kMu * kFifth * kLeft));
  }
  PRIMRAY_INLINE vvec3<W> operator()(vfloat<W> cosine) const {
    const vfloat<W> mu = clamp(cosine, 0.0f, 1.0f), left = 1.0f - mu, fifth = pow5(left);
    const vvec3<W> f = f0 + (vvec3<W>(vfloat<W>(1.0f)) - f0) * fifth - dip * (mu * fifth * left);
    return {clamp(f.x, 0.0f, 1.0f), clamp(f.y, 0.0f, 1.0f), clamp(f.z, 0.0f, 1.0f)};
  }
};

}  // namespace primray
