// Hair fibres: Chiang, Bitterli, Tappan and Burley 2016, "A Practical and Controllable Hair and Fur Model for Production Path
// Tracing", after Marschner et al. 2003 and d'Eon et al. 2011.
//
// Directions are in a local frame whose +x is the fibre's direction and +z the normal of the tube at the hit, on the side of
// wo. Lobe p is light that crosses the fibre p times: R, TT, TRT, and the sum of all further ones. Each is the product of its
// longitudinal distribution (d'Eon's), its attenuation, and its azimuthal distribution (a logistic function, truncated at half
// a turn). Their sum is f cos, which integrates to the total attenuation. The model is near-field: the offset h of the hit
// across the fibre follows from the normal.
#pragma once

#include "bsdf/basics/scattering.hpp"
#include "bsdf/hair/row.hpp"
#include "bsdf/open_pbr/fresnel.hpp"
#include "math/transcendental.hpp"

namespace primray {

// e^-x for x >= 0.
template <int W>
PRIMRAY_INLINE vfloat<W> exp_minus(vfloat<W> x) {
  return exp2_negative<W>(x * -1.44269504f);
}

// e^-x I0(x), x >= 0: Abramowitz and Stegun 9.8.1 and 9.8.2, relative error below 1e-6.
template <int W>
PRIMRAY_INLINE vfloat<W> scaled_bessel_i0(vfloat<W> x) {
  const vfloat<W> t = x * (1 / 3.75f), t2 = min(t * t, 1.0f), u = 1.0f / max(t, 1.0f);
  const vfloat<W> series =
      1.0f +
      t2 * (3.5156229f + t2 * (3.0899424f + t2 * (1.2067492f + t2 * (0.2659732f + t2 * (0.0360768f + t2 * 0.0045813f)))));
  const vfloat<W> high = 0.00916281f + u * (-0.02057706f + u * (0.02635537f + u * (-0.01647633f + u * 0.00392377f)));
  const vfloat<W> far = 0.39894228f + u * (0.01328592f + u * (0.00225319f + u * (-0.00157565f + u * high)));
  return select(t < vfloat<W>(1.0f), series * exp_minus<W>(min(x, 3.75f)), far / sqrt(max(x, 1.0f)));
}

template <int W>
struct Hair {
  using F = vfloat<W>;
  using V = vvec3<W>;

  V left[kHairLobes];                                          // attenuation of each lobe
  F chance[kHairLobes];                                        // probability of sampling each lobe
  F sin_tilted[kHairLobes], cos_tilted[kHairLobes];            // inclination of wo, tilted by the scales
  F variance[kHairLobes], scale[kHairLobes], cut[kHairLobes];  // cut: integral of the logistic within half a turn
  F turned[kHairLobes];                                        // azimuth relative to wo at which the lobe peaks
  F gamma;                                                     // azimuth of wo relative to the normal

  PRIMRAY_INLINE Hair(const HairRows<W>& row, const V& wo) {
    const F one(1.0f), sin_out = clamp(wo.x, -1.0f, 1.0f), cos_out = safe_sqrt(1.0f - sin_out * sin_out);
    gamma = atan2(wo.y, wo.z);
    // An inclined cross-section refracts like one of a higher index (d'Eon et al. 2011).
    const F ior = row(kHairIor), sin_in = sin_out / ior, cos_in = safe_sqrt(1.0f - sin_in * sin_in);
    const F h = clamp(wo.y / max(cos_out, 1e-6f), -1.0f, 1.0f);
    const F bent = safe_sqrt(ior * ior - sin_out * sin_out) / max(cos_out, 1e-6f);
    const F sin_gamma = clamp(h / max(bent, 1e-6f), -1.0f, 1.0f), cos_gamma = safe_sqrt(1.0f - sin_gamma * sin_gamma);
    const F gamma_in = atan2(sin_gamma, cos_gamma);
    const F way = -1.44269504f * 2.0f * cos_gamma / max(cos_in, 1e-6f);
    const V absorption = row.color(kHairAbsorption);
    const V transmittance{exp2_negative<W>(absorption.x * way), exp2_negative<W>(absorption.y * way),
                          exp2_negative<W>(absorption.z * way)};
    const F f = dielectric_fresnel<W>(wo.z, ior), through = (1.0f - f) * (1.0f - f);
    left[0] = V(f);
    left[1] = transmittance * through;
    left[2] = left[1] * transmittance * f;
    const V rest = left[2] * transmittance * f;
    const auto series = [&](F r, F t) { return r / max(one - t * f, 1e-6f); };
    left[3] = V(series(rest.x, transmittance.x), series(rest.y, transmittance.y), series(rest.z, transmittance.z));
    F total(0.0f);
    for (int p = 0; p < kHairLobes; ++p) {
      const int k = p < 3 ? p : 2;
      left[p] = left[p] * row.color(kHairTint + 3 * k);
      chance[p] = (left[p].x + left[p].y + left[p].z) * (1.0f / 3), total += chance[p];
      variance[p] = row(kHairVariance + k), scale[p] = row(kHairScale + k);
      const F e = exp_minus<W>(kPi / scale[p]);
      cut[p] = (1.0f - e) / (1.0f + e);
      const F sin_tilt = p < 3 ? row(kHairTilt + 2 * k) : F(0.0f), cos_tilt = p < 3 ? row(kHairTilt + 2 * k + 1) : one;
      sin_tilted[p] = sin_out * cos_tilt + cos_out * sin_tilt;
      cos_tilted[p] = abs(cos_out * cos_tilt - sin_out * sin_tilt);
      turned[p] = gamma_in * (2.0f * float(p)) - gamma * 2.0f + float(p & 1) * kPi;
    }
    const F scaled = 1.0f / max(total, 1e-20f);
    for (F& c : chance) c *= scaled;
  }

  PRIMRAY_INLINE BsdfEval<W> eval(const V& wi) const {
    const F sin_in = clamp(wi.x, -1.0f, 1.0f), cos_in = safe_sqrt(1.0f - sin_in * sin_in);
    const F turn = atan2(wi.y, wi.z) - gamma;
    BsdfEval<W> r{V(F(0.0f)), V(F(0.0f)), F(0.0f)};
    for (int p = 0; p < kHairLobes; ++p) {
      const F about = p < 3 ? logistic(p, turn - turned[p]) : F(0.5f * kInvPi);
      const F density = along(p, sin_in, cos_in) * about;
      r.specular = r.specular + left[p] * density;
      r.pdf += chance[p] * density;
    }
    return r;
  }

  // `lobe` in [0, 1) chooses a lobe; its position within that lobe's share is reused as a third random number.
  PRIMRAY_INLINE BsdfSample<W> sample(F lobe, F u, F v) const {
    using B = vbool<W>;
    F below(0.0f), within = lobe, sin_o(0.0f), cos_o(1.0f), var(1.0f), s(1.0f), c(1.0f), to(0.0f);
    B even(false);
    F sum(0.0f);
    for (int p = 0; p < kHairLobes; ++p) {
      const B m = (lobe >= sum) & ((p == kHairLobes - 1 ? B(true) : B(false)) | (lobe < sum + chance[p]));
      const F share = (lobe - sum) / max(chance[p], 1e-20f);
      within = select(m, share, within);
      sin_o = select(m, sin_tilted[p], sin_o), cos_o = select(m, cos_tilted[p], cos_o), var = select(m, variance[p], var);
      s = select(m, scale[p], s), c = select(m, cut[p], c), to = select(m, turned[p], to);
      if (p == 3) even = m;
      sum += chance[p];
    }
    within = clamp(within, 0.0f, 0x1.fffffep-1f);
    // Longitudinal: 1 - cos theta' = -v log(u + (1 - u) e^(-2 / v)) about the mirrored inclination (d'Eon et al. 2013).
    const F drawn = max(u, 1e-12f) + (1.0f - u) * exp_minus<W>(2.0f / var);
    const F lost = clamp(var * -0.693147181f * log2<W>(max(drawn, 1e-30f)), 0.0f, 2.0f);
    const F cos_theta = 1.0f - lost, sin_theta = sqrt(max(lost * (2.0f - lost), 0.0f));
    const F sin_in = clamp(sin_theta * sincos_turns(within).cos * cos_o - cos_theta * sin_o, -1.0f, 1.0f);
    const F cos_in = safe_sqrt(1.0f - sin_in * sin_in);
    // Azimuthal: inverse of the logistic, whose ends are half a turn away.
    const F least = 0.5f * (1.0f - c), q = clamp(v * c + least, 1e-7f, 1.0f - 1e-7f);
    const F logit = 0.693147181f * (log2<W>(q) - log2<W>(1.0f - q));
    const F turn = select(even, v * (2 * kPi), to + clamp(s * logit, -kPi, kPi));
    const SinCos<W> azimuth = sincos_turns((gamma + turn) * (0.5f * kInvPi));
    const V wi{sin_in, cos_in * azimuth.sin, cos_in * azimuth.cos};
    const BsdfEval<W> e = eval(wi);
    const V weight = select(e.pdf > F(0.0f), e.specular * (1.0f / max(e.pdf, 1e-30f)), V(F(0.0f)));
    return {wi, weight, e.pdf, B(false), wi.z < F(0.0f), B(false), V(F(0.0f))};
  }

 private:
  // Longitudinal distribution e^(-(sin sin) / v) I0(cos cos / v) / (2 v sinh(1 / v)), with the exponent as a difference, which
  // keeps narrow lobes precise.
  PRIMRAY_INLINE F along(int p, F sin_in, F cos_in) const {
    const F v = variance[p], inverse = 1.0f / v;
    const F x = cos_in - cos_tilted[p], y = sin_in + sin_tilted[p];
    const F distance = 0.5f * (x * x + y * y) * inverse;
    return exp_minus<W>(distance) * scaled_bessel_i0<W>(cos_in * cos_tilted[p] * inverse) * inverse /
           (1.0f - exp_minus<W>(2.0f * inverse));
  }
  PRIMRAY_INLINE F logistic(int p, F turn) const {
    const F turns = turn * (0.5f * kInvPi), x = abs(turns - to_float(floor_to_int(turns + 0.5f))) * (2 * kPi);
    const F e = exp_minus<W>(x / scale[p]), d = 1.0f + e;
    return e / (scale[p] * d * d * cut[p]);
  }
};

}  // namespace primray
