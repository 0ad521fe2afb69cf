// Lobes of UsdPreviewSurface (diffuse, specular, clearcoat and transmission) and of plain Lambert surfaces; OpenPBR's lobes are
// added in bsdf_with_open_pbr.hpp.
//
// Directions are in a local frame whose +z is the shading normal on the side of wo (unit, away from the surface; so is wi).
// f_cos = f |cos theta_i|. Base layer according to the specification: diffuse albedo / pi (1 - F(wo.h)) plus GGX with F =
// lerp(F0, F90, (1 - wo.h)^5). That sum reflects more than it receives at grazing angles, so the diffuse lobe is multiplied by
// k(wo) k(wi), k = min(1, (1 - E) / D) with E and D the albedos of both lobes: 1 where the specification conserves energy,
// reciprocal, and never above it (docs/decisions/surfaces). The clearcoat attenuates the base by what it reflects: (1 - c
// Ec(wo)) (1 - c Ec(wi)). Light that is not absorbed by opacity passes without roughness: refracted if the geometry is closed,
// otherwise straight. Radiance along refracted paths is kept as L / n^2, so no factor appears.
#pragma once

#include "bsdf/basics/albedo.hpp"
#include "bsdf/basics/scattering.hpp"
#include "bsdf/ggx.hpp"
#include "bsdf/surface.hpp"

namespace primray {

template <int W>
PRIMRAY_INLINE vvec3<W> lerp(const vvec3<W>& a, const vvec3<W>& b, vfloat<W> t) {
  return a + (b - a) * t;
}
template <int W>
PRIMRAY_INLINE vvec3<W> min(const vvec3<W>& a, float b) {
  return {min(a.x, b), min(a.y, b), min(a.z, b)};
}
template <int W>
PRIMRAY_INLINE vvec3<W> divide(const vvec3<W>& a, const vvec3<W>& b) {
  return {a.x / b.x, a.y / b.y, a.z / b.z};
}

// Least probability of a direction of smooth glass that paths follow beside the other.
constexpr float kLeastBranch = 1e-4f;

template <int W>
struct Bsdf {
  static constexpr bool kInMedium = false;      // not a surface
  static constexpr bool kFollowsMedia = false;  // media are followed at these vertices (integrator/media.hpp)
  static constexpr bool kFibres = false;        // some lanes may be hair
  static constexpr bool kEndsWalk = false;      // light leaves a random walk below the surface

  vbool<W> preview;  // otherwise Lambert
  bool any_preview;
  vvec3<W> diffuse;
  // Valid where `preview`:
  vvec3<W> f0, f90, k_out, transmission;
  vfloat<W> alpha, roughness, presence, eta;  // eta: index of refraction on wi's side of a refraction over that on wo's side
  vfloat<W> coat, coat_alpha, coat_roughness, coat_f0, coat_keep;  // coat_keep = 1 - c Ec(wo)
  vfloat<W> p_diffuse, p_specular, p_coat;  // probabilities of the lobes, given presence; the rest transmits
  vbool<W> thin, mirror;
  bool any_coat, any_transmission, any_presence;

  // Lobes of the surfaces in rows `field`, seen along wo (local) from the geometry's front or back.
  PRIMRAY_INLINE Bsdf(const SurfaceTable& table, vint<W> surface, vbool<W> active, const vvec3<W>& wo, vbool<W> front)
      : Bsdf(SurfaceRows<W>(table, surface), active, wo, front) {}
  PRIMRAY_INLINE Bsdf(const SurfaceRows<W>& field, vbool<W> active, const vvec3<W>& wo, vbool<W> front) {
    const auto color = [&](int f) { return field.color(f); };
    const vint<W> flags = field.flags();
    diffuse = color(kDiffuse);
    preview = ((flags & vint<W>(kPreview)) != vint<W>(0)) & active;
    any_preview = any(preview);
    any_presence = false;
    presence = vfloat<W>(1.0f);
    mirror = vbool<W>(false);
    if (!any_preview) return;
    f0 = color(kF0), f90 = color(kF90);
    alpha = field(kAlpha), roughness = field(kRoughness), presence = field(kPresence);
    thin = (flags & vint<W>(kThin)) != vint<W>(0);
    mirror = preview & (alpha == vfloat<W>(0.0f));
    any_presence = any(preview & (presence < vfloat<W>(1.0f)));
    const vfloat<W> pass = field(kTransmission), ior = field(kIor);
    const vfloat<W> cos_out = wo.z;
    any_transmission = any(preview & (pass > vfloat<W>(0.0f)));
    eta = select(front, ior, 1.0f / ior);
    const vbool<W> to_rarer = preview & !thin & (pass > vfloat<W>(0.0f)) & (eta < vfloat<W>(1.0f));
    vbool<W> reflects_all(false);
    if (any(to_rarer)) {
      // From the denser side, Schlick's term takes the angle on the other side, and all light is reflected beyond the critical
      // angle.
      const vfloat<W> sin2 = (1.0f - cos_out * cos_out) / (eta * eta);
      const vfloat<W> rarer = safe_sqrt(1.0f - sin2), s = pow5(1.0f - rarer);
      reflects_all = to_rarer & (sin2 >= vfloat<W>(1.0f));
      const vvec3<W> f = select(reflects_all, vvec3<W>(vfloat<W>(1.0f)), lerp(f0, f90, s));
      f0 = select(to_rarer, f, f0), f90 = select(to_rarer, f, f90);
    }
    const vvec3<W> e = specular_albedo(cos_out);
    k_out = keep_diffuse(cos_out, e);
    // A rough lobe's albedo stays below 1 even under total reflection: nothing is transmitted there all the same.
    transmission = select(reflects_all, vvec3<W>(vfloat<W>(0.0f)), (vvec3<W>(vfloat<W>(1.0f)) - min(e, 1.0f)) * pass);
    coat = field(kClearcoat);
    any_coat = any(preview & (coat > vfloat<W>(0.0f)));
    coat_keep = vfloat<W>(1.0f);
    vfloat<W> w_coat(0.0f);
    if (any_coat) {
      coat_alpha = field(kClearcoatAlpha), coat_roughness = field(kClearcoatRoughness), coat_f0 = field(kClearcoatF0);
      w_coat = coat * coat_albedo(cos_out);
      coat_keep = 1.0f - w_coat;
    }
    const vfloat<W> w_diffuse = luminance(diffuse * k_out) * coat_keep, w_specular = luminance(e) * coat_keep;
    const vfloat<W> w_pass = luminance(transmission) * coat_keep;
    const vfloat<W> total = w_diffuse + w_specular + w_coat + w_pass;
    const vfloat<W> scale = 1.0f / max(total, 1e-20f);
    p_diffuse = select(preview, w_diffuse * scale, vfloat<W>(1.0f));
    p_specular = w_specular * scale, p_coat = w_coat * scale;
  }

  // Returns the lanes of smooth glass and nothing else: light is reflected with the probability p_specular, and else passes.
  PRIMRAY_INLINE vbool<W> is_smooth_glass() const {
    const vfloat<W> zero(0.0f), one(1.0f);
    return preview & mirror & (presence == one) & (p_diffuse == zero) & (p_coat == zero) &
           (abs(p_specular - 0.5f) < vfloat<W>(0.5f - kLeastBranch));
  }

  // Returns the lanes in which directions below the surface receive light by non-delta lobes.
  static vbool<W> lets_through() { return vbool<W>(false); }

  PRIMRAY_INLINE vvec3<W> specular_albedo(vfloat<W> cos_theta) const {
    const LobeAlbedo<W> a = ggx_albedo(cos_theta, roughness);
    const vfloat<W> s = pow5(1.0f - cos_theta);
    return select(mirror, lerp(f0, f90, s), f0 * a.f0 + f90 * a.f90);
  }
  PRIMRAY_INLINE vfloat<W> coat_albedo(vfloat<W> cos_theta) const {
    const LobeAlbedo<W> a = ggx_albedo(cos_theta, coat_roughness);
    return coat_f0 * a.f0 + a.f90;
  }
  // k: share of the specified diffuse lobe at this angle, given the specular albedo there.
  PRIMRAY_INLINE vvec3<W> keep_diffuse(vfloat<W> cos_theta, const vvec3<W>& e) const {
    const vfloat<W> loss = diffuse_fresnel_loss(cos_theta);
    const vvec3<W> one(vfloat<W>(1.0f));
    const vvec3<W> d = one - lerp(f0, f90, loss);
    const vvec3<W> k = divide(one - min(e, 1.0f), vvec3<W>(max(d.x, 1e-6f), max(d.y, 1e-6f), max(d.z, 1e-6f)));
    return min(k, 1.0f);
  }

  // Probability of the lobe whose density is the cosine over pi; it has the lowest lobe numbers. For surfaces that are there as
  // a whole.
  PRIMRAY_INLINE vfloat<W> cosine_lobe() const { return any_preview ? select(preview, p_diffuse, 1.0f) : vfloat<W>(1.0f); }

  // Evaluates all but the delta lobes.
  PRIMRAY_INLINE BsdfEval<W> eval(const vvec3<W>& wo, const vvec3<W>& wi) const {
    const vbool<W> reflects = (wi.z > vfloat<W>(0.0f)) & (wo.z > vfloat<W>(0.0f));
    const vfloat<W> cos_in = select(reflects, wi.z, vfloat<W>(0.0f));
    const vfloat<W> lambert = cos_in * kInvPi;
    BsdfEval<W> r{diffuse * lambert, vvec3<W>(vfloat<W>(0.0f)), lambert};
    if (!any_preview) return r;
    const vvec3<W> h = normalize(wo + wi);
    const vfloat<W> s = pow5(max(1.0f - dot(wo, h), 0.0f));
    const vvec3<W> f = lerp(f0, f90, s), one(vfloat<W>(1.0f));
    const vvec3<W> k_in = keep_diffuse(cos_in, specular_albedo(cos_in));
    vvec3<W> d = diffuse * (one - f) * k_out * k_in * lambert;
    vvec3<W> g(vfloat<W>(0.0f));
    vfloat<W> pdf = p_diffuse * lambert;
    const vbool<W> glossy = reflects & preview & !mirror;
    if (any(glossy)) {
      const vfloat<W> lambda_out = ggx_lambda(wo, alpha), lambda_in = ggx_lambda(wi, alpha);
      const vfloat<W> a = max(alpha, kMinAlpha), density = ggx_density(h, a);
      g = select(glossy, f * (density / (4.0f * wo.z * (1.0f + lambda_out + lambda_in))), g);
      pdf += select(glossy, p_specular * density * ggx_reflection_density(wo, a), vfloat<W>(0.0f));
    }
    if (any_coat) {
      const vfloat<W> keep = coat_keep * (1.0f - coat * coat_albedo(cos_in));
      const vfloat<W> lambda_out = ggx_lambda(wo, coat_alpha), lambda_in = ggx_lambda(wi, coat_alpha);
      const vfloat<W> density = ggx_density(h, coat_alpha), fc = coat * (coat_f0 + (1.0f - coat_f0) * s);
      const vbool<W> coated = reflects & (coat > vfloat<W>(0.0f));
      const vfloat<W> c = select(coated, fc * density / (4.0f * wo.z * (1.0f + lambda_out + lambda_in)), vfloat<W>(0.0f));
      d *= keep;
      g = g * keep + vvec3<W>(c);
      pdf += select(coated, p_coat * density * ggx_reflection_density(wo, max(coat_alpha, kMinAlpha)), vfloat<W>(0.0f));
    }
    r.diffuse = select(preview, d * presence, r.diffuse);
    r.specular = select(preview, g * presence, r.specular);
    r.pdf = select(preview, pdf * presence, r.pdf);
    return r;
  }

  PRIMRAY_INLINE BsdfSample<W> sample(const vvec3<W>& wo, vfloat<W> lobe, vfloat<W> u, vfloat<W> v) const {
    const vbool<W> never(false);
    const vfloat<W> zero(0.0f);
    // Cosine-weighted direction for the diffuse lobe: Malley's method on the polar map, whose strata remain compact enough
    // here.
    const vfloat<W> r = sqrt(u);
    const SinCos<W> phi = sincos_turns(v);
    vvec3<W> wi{r * phi.cos, r * phi.sin, sqrt(1.0f - u)};
    if (!any_preview) return {wi, diffuse, wi.z * kInvPi, never, never, never, vvec3<W>(vfloat<W>(1.0f))};
    vbool<W> gone = never;
    if (any_presence) {
      gone = preview & (lobe >= presence);
      lobe = min(lobe / max(presence, 1e-20f), 0x1.fffffep-1f);
    }
    const vbool<W> is_specular = preview & (lobe >= p_diffuse) & (lobe < p_diffuse + p_specular);
    const vbool<W> is_coat = preview & (lobe >= p_diffuse + p_specular) & (lobe < p_diffuse + p_specular + p_coat);
    const vbool<W> passes = preview & (lobe >= p_diffuse + p_specular + p_coat);
    const vbool<W> is_mirror = is_specular & mirror;
    // Reflection about a visible normal.
    const vbool<W> about_normal = (is_specular & !mirror) | is_coat;
    if (any(about_normal)) {
      const vfloat<W> a = any_coat ? select(is_coat, coat_alpha, alpha) : alpha;
      const vvec3<W> h = ggx_sample_normal(wo, max(a, kMinAlpha), u, v);
      wi = select(about_normal, h * (2.0f * dot(wo, h)) - wo, wi);
    }
    wi = select(is_mirror, vvec3<W>(-wo.x, -wo.y, wo.z), wi);
    vbool<W> straight = gone;
    if (any_transmission) {
      // Snell's law about +z; under total reflection, transmission is 0.
      const vfloat<W> ratio = 1.0f / eta;
      const vfloat<W> cos_in = safe_sqrt(1.0f - ratio * ratio * (1.0f - wo.z * wo.z));
      wi = select(passes, select(thin, -wo, vvec3<W>(-wo.x * ratio, -wo.y * ratio, -cos_in)), wi);
      straight = gone | (passes & thin);
    }
    wi = select(gone, -wo, wi);
    const vbool<W> is_delta = gone | passes | is_mirror;
    // Full weight of the smooth lobes, whichever was sampled.
    const BsdfEval<W> e = eval(wo, wi);
    vvec3<W> weight = (e.diffuse + e.specular) * (1.0f / max(e.pdf, 1e-30f));
    weight = select(e.pdf > zero, weight, vvec3<W>(zero));
    // Must equal the early return above exactly, or a lane's bits would depend on its neighbours.
    weight = select(preview, weight, diffuse);
    const vfloat<W> keep = any_coat ? coat_keep : vfloat<W>(1.0f);
    const vvec3<W> f = lerp(f0, f90, pow5(1.0f - wo.z));
    weight = select(is_mirror, f * (keep * keep / max(p_specular, 1e-20f)), weight);
    weight = select(passes, transmission * (keep / max(1.0f - p_diffuse - p_specular - p_coat, 1e-7f)), weight);
    weight = select(gone, vvec3<W>(vfloat<W>(1.0f)), weight);
    const vvec3<W> sum = e.diffuse + e.specular, tiny(vfloat<W>(1e-30f));
    const vvec3<W> share = divide(e.diffuse, {max(sum.x, tiny.x), max(sum.y, tiny.y), max(sum.z, tiny.z)});
    return {
        wi, weight, select(is_delta, zero, e.pdf), is_delta, passes | gone, straight, select(is_delta, vvec3<W>(zero), share)};
  }
};

// Straight transmittance of a shadow ray that crosses a surface: where the surface is absent, and what passes if it is thin.
template <int W>
PRIMRAY_INLINE vvec3<W> straight_transmittance(const Bsdf<W>& b) {
  const vvec3<W> zero(vfloat<W>(0.0f));
  if (!b.any_preview) return zero;
  const vvec3<W> thin = b.any_transmission ? select(b.preview & b.thin, b.transmission * b.coat_keep, zero) : zero;
  return thin * b.presence + vvec3<W>(1.0f - b.presence);
}

}  // namespace primray
