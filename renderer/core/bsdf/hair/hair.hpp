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

  V ap[kHairLobes];                                                      // attenuation A_p
  F ap_pdf[kHairLobes];                                                  // probability of sampling lobe p
  F sin_theta_op[kHairLobes], cos_theta_op[kHairLobes];                  // inclination of wo, tilted by the cuticle scales
  F variance[kHairLobes], scale[kHairLobes], logistic_norm[kHairLobes];  // logistic_norm: integral within [-pi, pi]
  F phi_p[kHairLobes];                                                   // azimuth relative to wo at which lobe p peaks
  F gamma_o;                                                             // azimuth of wo about the fibre, from the normal

  PRIMRAY_INLINE Hair(const HairRows<W>& row, const V& wo) {
    const F one(1.0f), sin_theta_o = clamp(wo.x, -1.0f, 1.0f), cos_theta_o = safe_sqrt(1.0f - sin_theta_o * sin_theta_o);
    gamma_o = atan2(wo.y, wo.z);
    // An inclined cross-section refracts like one of a higher index (d'Eon et al. 2011).
    const F ior = row(kHairIor), sin_theta_t = sin_theta_o / ior, cos_theta_t = safe_sqrt(1.0f - sin_theta_t * sin_theta_t);
    const F h = clamp(wo.y / max(cos_theta_o, 1e-6f), -1.0f, 1.0f);
    const F etap = safe_sqrt(ior * ior - sin_theta_o * sin_theta_o) / max(cos_theta_o, 1e-6f);
    const F sin_gamma_t = clamp(h / max(etap, 1e-6f), -1.0f, 1.0f), cos_gamma_t = safe_sqrt(1.0f - sin_gamma_t * sin_gamma_t);
    const F gamma_t = atan2(sin_gamma_t, cos_gamma_t);
    const F exponent_per_absorption = -1.44269504f * 2.0f * cos_gamma_t / max(cos_theta_t, 1e-6f);
    const V absorption = row.color(kHairAbsorption);
    const V transmittance{exp2_negative<W>(absorption.x * exponent_per_absorption),
                          exp2_negative<W>(absorption.y * exponent_per_absorption),
                          exp2_negative<W>(absorption.z * exponent_per_absorption)};
    const F f = dielectric_fresnel<W>(wo.z, ior), through = (1.0f - f) * (1.0f - f);
    ap[0] = V(f);
    ap[1] = transmittance * through;
    ap[2] = ap[1] * transmittance * f;
    const V rest = ap[2] * transmittance * f;
    const auto series = [&](F r, F t) { return r / max(one - t * f, 1e-6f); };
    ap[3] = V(series(rest.x, transmittance.x), series(rest.y, transmittance.y), series(rest.z, transmittance.z));
    F total(0.0f);
    for (int p = 0; p < kHairLobes; ++p) {
      const int k = p < 3 ? p : 2;
      ap[p] = ap[p] * row.color(kHairTint + 3 * k);
      ap_pdf[p] = (ap[p].x + ap[p].y + ap[p].z) * (1.0f / 3), total += ap_pdf[p];
      variance[p] = row(kHairVariance + k), scale[p] = row(kHairScale + k);
      const F e = exp_minus<W>(kPi / scale[p]);
      logistic_norm[p] = (1.0f - e) / (1.0f + e);
      const F sin_tilt = p < 3 ? row(kHairTilt + 2 * k) : F(0.0f), cos_tilt = p < 3 ? row(kHairTilt + 2 * k + 1) : one;
      sin_theta_op[p] = sin_theta_o * cos_tilt + cos_theta_o * sin_tilt;
      cos_theta_op[p] = abs(cos_theta_o * cos_tilt - sin_theta_o * sin_tilt);
      phi_p[p] = gamma_t * (2.0f * float(p)) - gamma_o * 2.0f + float(p & 1) * kPi;
    }
    const F scaled = 1.0f / max(total, 1e-20f);
    for (F& c : ap_pdf) c *= scaled;
  }

  PRIMRAY_INLINE BsdfEval<W> eval(const V& wi) const {
    const F sin_theta_i = clamp(wi.x, -1.0f, 1.0f), cos_theta_i = safe_sqrt(1.0f - sin_theta_i * sin_theta_i);
    const F phi = atan2(wi.y, wi.z) - gamma_o;
    BsdfEval<W> r{V(F(0.0f)), V(F(0.0f)), F(0.0f)};
    for (int p = 0; p < kHairLobes; ++p) {
      const F np = p < 3 ? logistic(p, phi - phi_p[p]) : F(0.5f * kInvPi);
      const F density = mp(p, sin_theta_i, cos_theta_i) * np;
      r.specular = r.specular + ap[p] * density;
      r.pdf += ap_pdf[p] * density;
    }
    return r;
  }

  // `lobe` in [0, 1) chooses a lobe; its position within that lobe's share is reused as a third random number.
  PRIMRAY_INLINE BsdfSample<W> sample(F lobe, F u, F v) const {
    using B = vbool<W>;
    F remapped = lobe, sin_o(0.0f), cos_o(1.0f), var(1.0f), s(1.0f), c(1.0f), peak(0.0f);
    B even(false);
    F sum(0.0f);
    for (int p = 0; p < kHairLobes; ++p) {
      const B m = (lobe >= sum) & ((p == kHairLobes - 1 ? B(true) : B(false)) | (lobe < sum + ap_pdf[p]));
      const F share = (lobe - sum) / max(ap_pdf[p], 1e-20f);
      remapped = select(m, share, remapped);
      sin_o = select(m, sin_theta_op[p], sin_o), cos_o = select(m, cos_theta_op[p], cos_o), var = select(m, variance[p], var);
      s = select(m, scale[p], s), c = select(m, logistic_norm[p], c), peak = select(m, phi_p[p], peak);
      if (p == 3) even = m;
      sum += ap_pdf[p];
    }
    remapped = clamp(remapped, 0.0f, 0x1.fffffep-1f);
    // Longitudinal: 1 - cos theta' = -v log(u + (1 - u) e^(-2 / v)) about the mirrored inclination (d'Eon et al. 2013).
    const F u_cos = max(u, 1e-12f) + (1.0f - u) * exp_minus<W>(2.0f / var);
    const F one_minus_cos = clamp(var * -0.693147181f * log2<W>(max(u_cos, 1e-30f)), 0.0f, 2.0f);
    const F cos_theta = 1.0f - one_minus_cos, sin_theta = sqrt(max(one_minus_cos * (2.0f - one_minus_cos), 0.0f));
    const F sin_theta_i = clamp(sin_theta * sincos_turns(remapped).cos * cos_o - cos_theta * sin_o, -1.0f, 1.0f);
    const F cos_theta_i = safe_sqrt(1.0f - sin_theta_i * sin_theta_i);
    // Azimuthal: inverse of the logistic, whose ends are half a turn away.
    const F least = 0.5f * (1.0f - c), q = clamp(v * c + least, 1e-7f, 1.0f - 1e-7f);
    const F logit = 0.693147181f * (log2<W>(q) - log2<W>(1.0f - q));
    const F phi = select(even, v * (2 * kPi), peak + clamp(s * logit, -kPi, kPi));
    const SinCos<W> azimuth = sincos_turns((gamma_o + phi) * (0.5f * kInvPi));
    const V wi{sin_theta_i, cos_theta_i * azimuth.sin, cos_theta_i * azimuth.cos};
    const BsdfEval<W> e = eval(wi);
    const V weight = select(e.pdf > F(0.0f), e.specular * (1.0f / max(e.pdf, 1e-30f)), V(F(0.0f)));
    return {wi, weight, e.pdf, B(false), wi.z < F(0.0f), B(false), V(F(0.0f))};
  }

 private:
  // Longitudinal distribution M_p: e^(-(sin sin) / v) I0(cos cos / v) / (2 v sinh(1 / v)), with the exponent as a difference,
  // which keeps narrow lobes precise.
  PRIMRAY_INLINE F mp(int p, F sin_theta_i, F cos_theta_i) const {
    const F v = variance[p], inverse = 1.0f / v;
    const F x = cos_theta_i - cos_theta_op[p], y = sin_theta_i + sin_theta_op[p];
    const F distance = 0.5f * (x * x + y * y) * inverse;
    return exp_minus<W>(distance) * scaled_bessel_i0<W>(cos_theta_i * cos_theta_op[p] * inverse) * inverse /
           (1.0f - exp_minus<W>(2.0f * inverse));
  }
  // Azimuthal distribution N_p: a logistic function, truncated to [-pi, pi].
  PRIMRAY_INLINE F logistic(int p, F phi) const {
    const F turns = phi * (0.5f * kInvPi), x = abs(turns - to_float(floor_to_int(turns + 0.5f))) * (2 * kPi);
    const F e = exp_minus<W>(x / scale[p]), d = 1.0f + e;
    return e / (scale[p] * d * d * logistic_norm[p]);
  }
};

}  // namespace primray
