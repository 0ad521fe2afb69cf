// Scattering by a guide and the surface's BSDF together, with a one-sample MIS density: by the path guide, and towards
// caustics. Kept apart from the path loop, as few scenes have guides.
#pragma once

#include <cmath>

#include "bsdf/bsdf.hpp"
#include "guiding/caustic_guide.hpp"
#include "guiding/guide.hpp"
#include "medium/phase_function.hpp"
#include "ray/ray.hpp"
#include "sampler/sampler.hpp"

namespace primray {

// Scattering guided towards caustics (guiding/caustic_guide.hpp): a mixture with the surface's own sampling, in lanes.

// Smallest alpha of lobes that are guided: narrower ones (roughness 0.14) find the light themselves.
constexpr float kFollowsAlpha = 0.02f;
// Upper limit of the factor by which guided paths are favoured in Russian roulette, to compensate for their low throughput.
constexpr float kMostBoost = 1e7f;
// A lobe of lower density counts as diffuse.
constexpr float kDiffuseDensity = 1;

// Returns the lanes whose surfaces scatter widely enough to benefit from another density.
template <int W, class Lobes>
PRIMRAY_INLINE vbool<W> follows_caustics(const Lobes& b) {
  if (!b.any_preview) return vbool<W>(true);
  return (!b.lets_through()) &
         ((!b.preview) | (b.p_diffuse > vfloat<W>(0.1f)) | ((!b.mirror) & (b.alpha > vfloat<W>(kFollowsAlpha))));
}

// Response towards `wo` to light from about unit `wi` (local), a lobe of that squared width, relative to a white Lambert
// surface; reduced where the surface's own lobe is narrower.
template <int W, class Lobes>
PRIMRAY_INLINE vfloat<W> suits(const Lobes& b, const vvec3<W>& wo, const vvec3<W>& wi, vfloat<W> width2) {
  const vbool<W> above = wi.z > vfloat<W>(0.0f);
  if (!b.any_preview) return select(above, vfloat<W>(1.0f), vfloat<W>(0.0f));
  const vvec3<W> h = wo + wi;
  const vfloat<W> cos2 = h.z * h.z / max(dot(h, h), 1e-20f), a2 = b.alpha * b.alpha, wide2 = a2 + 0.25f * width2;
  const vfloat<W> q = wide2 + (1.0f - cos2) / max(cos2, 1e-6f);
  const vfloat<W> glossy = select(b.mirror, vfloat<W>(0.0f), b.p_specular * 0.25f * a2 / (q * q));
  return select(above, select(b.preview, b.p_diffuse + glossy, vfloat<W>(1.0f)), vfloat<W>(0.0f));
}

// Samples like Bsdf::sample(). `own` is the density without photons, for MIS: photons lead to casters of caustics, not to
// lights, so light samples need not evaluate them. `sample(lobe)` and `density(wi, by the BSDF)` sample without photons, by the
// BSDF or another guide as well. `splits`, a factor in Russian roulette, is multiplied by the ratio of the densities.
template <int W, class Lobes, class Sample, class Density>
PRIMRAY_RARE BsdfSample<W> sample_guided(const CausticLanes<W>& guide, const Lobes& bsdf, const Frame<vfloat<W>>& frame,
                                         const vvec3<W>& wo, vfloat<W> lobe, const Pair<W>& u, int path_splits,
                                         const Sample& sample, const Density& density, vfloat<W>& splits, vfloat<W>& own) {
  const vfloat<W> zero(0.0f), rest = 1.0f - guide.share;
  const vbool<W> guided = lobe < guide.share;
  const vfloat<W> own_lobe = min((lobe - guide.share) / rest, 0x1.fffffep-1f);
  BsdfSample<W> s = sample(max(own_lobe, 0.0f));
  const vbool<W> any_share = guide.share > zero;
  vvec3<W> wi = frame.to_world(s.wi);
  if (any(guided)) {
    wi = select(guided, guide.sample(min(lobe / max(guide.share, 1e-20f), 0x1.fffffep-1f), u.u, u.v), wi);
    s.wi = select(guided, frame.to_local(wi), s.wi);
    const BsdfEval<W> e = bsdf.eval(wo, s.wi);
    const vbool<W> up = s.wi.z > zero;
    // f_cos itself, and the density by the surface; divided by the density of the mixture below.
    s.weight = select(guided, select(up, e.diffuse + e.specular, vvec3<W>(zero)), s.weight);
    s.pdf = select(guided, density(wi, e.pdf), s.pdf);
    s.is_delta = s.is_delta & !guided, s.transmits = s.transmits & !guided, s.straight = s.straight & !guided;
    const vvec3<W> sum = e.diffuse + e.specular;
    const vvec3<W> share = divide(e.diffuse, {max(sum.x, 1e-30f), max(sum.y, 1e-30f), max(sum.z, 1e-30f)});
    s.diffuse_share = select(guided, share, s.diffuse_share);
  }
  own = select(guided, max(s.pdf, 1e-20f), s.pdf);  // 0 would mean that no light sample leads there
  const vfloat<W> mixed = own * rest + guide.share * guide.pdf(wi);
  const vfloat<W> factor = select(guided, 1.0f / max(mixed, 1e-30f), select(s.is_delta, 1.0f / rest, own / max(mixed, 1e-30f)));
  s.weight = select(any_share, s.weight * factor, s.weight);
  s.pdf = select(any_share & !s.is_delta, mixed, s.pdf);
  const vfloat<W> boost = clamp(mixed / max(own, 1e-20f), 1.0f, kMostBoost);
  splits = select(guided, min(splits, float(path_splits)) * boost, splits);
  return s;
}

// Smallest probability of a diffuse lobe for which directions are guided.
constexpr float kLeastDiffuse = 0.3f;

// Locates the lanes in the guide: those on surfaces that have a diffuse lobe and transmit nothing.
template <int W, class Lobes>
PRIMRAY_RARE GuideLocation<W> find_place(const Guide& guide, vbool<W> scatters, const vvec3<W>& p, const vvec3<W>& ng,
                                         const Lobes& bsdf) {
  const vfloat<W> one(1.0f);
  vbool<W> wide = scatters;
  if (bsdf.any_preview) {
    const vbool<W> opaque = (bsdf.p_diffuse + bsdf.p_specular + bsdf.p_coat > vfloat<W>(0.9999f)) & (bsdf.presence >= one);
    wide &= !bsdf.lets_through();
    wide &= (!bsdf.preview) | (opaque & (bsdf.cosine_lobe() > vfloat<W>(kLeastDiffuse)));
  }
  GuideLocation<W> place = guide.place_of<W>(p, ng);
  place.diffuse = bsdf.cosine_lobe();
  place.region = select(wide, place.region, vint<W>(-1));
  return place;
}

// Locates points inside media in the guide. The narrower the phase function, the less the guide is used, which knows nothing of
// it: a path along which light is scattered forwards many times would have a weight of 1 / (1 - share) more for each of them.
// Henyey and Greenstein's covers a part of the sphere, as 1 over the integral of its square, of (1 - g^2)^2 / (1 + g^2).
template <int W>
PRIMRAY_RARE GuideLocation<W, true> find_place_inside(const Guide& guide, const vvec3<W>& p, vfloat<W> phase) {
  const vfloat<W> g = mean_cosine(phase), g2 = g * g, rest = 1.0f - g2;
  return {guide.region_inside(p), kGuideShare * rest * rest / (1.0f + g2)};
}

// Location with a region to read in every lane.
template <bool kInMedium, int W>
PRIMRAY_INLINE GuideLocation<W, kInMedium> valid_place(const GuideLocation<W, kInMedium>& place) {
  GuideLocation<W, kInMedium> valid = place;
  valid.region = max(place.region, vint<W>(0));
  return valid;
}

// Density of directions `wi` (world space; `cosine` to the shading normal) of the mixture, from the BSDF's density. On surfaces
// the guide stands in for a share of the diffuse lobe alone, as its directions are those of radiance times cosine: glossy lobes
// keep their probabilities.
template <bool kInMedium, int W>
PRIMRAY_RARE vfloat<W> mixed_pdf(const Guide& guide, const GuideLocation<W, kInMedium>& place, const vvec3<W>& wi,
                                 vfloat<W> cosine, vfloat<W> bsdf_pdf) {
  const vbool<W> known = place.region >= vint<W>(0);
  vfloat<W> pdf = guide.pdf(valid_place(place), wi);
  if constexpr (!kInMedium) {
    const vfloat<W> zero(0.0f), by_diffuse = place.diffuse * (max(cosine, zero) * kInvPi);
    pdf = pdf * place.diffuse + max(bsdf_pdf - by_diffuse, zero);
  }
  return select(known, bsdf_pdf * (1.0f - place.share) + pdf * place.share, bsdf_pdf);
}

// Chooses the lanes whose direction the guide samples, on surfaces among those whose number `lobe` is the diffuse lobe's. One
// random number chooses and is rescaled, so that its strata serve both.
template <bool kInMedium, int W>
PRIMRAY_RARE vbool<W> choose_guide(const GuideLocation<W, kInMedium>& place, vfloat<W> lobe, vfloat<W>& u) {
  vbool<W> known = place.region >= vint<W>(0);
  if constexpr (!kInMedium) known &= lobe < place.diffuse;
  const vbool<W> by_guide = known & (u < vfloat<W>(place.share));
  const vfloat<W> rest = select(by_guide, u * (1.0f / place.share), (u - place.share) * (1.0f / (1.0f - place.share)));
  u = select(known, min(rest, 0x1.fffffep-1f), u);
  return by_guide;
}

// Samples the direction of lanes `by_guide` from the guide in place of the BSDF or the phase function, and weights by the
// mixture's density wherever the guide is valid.
template <bool kInMedium, int W, class Lobes>
PRIMRAY_RARE void sample_guided(const Guide& guide, const GuideLocation<W, kInMedium>& place, vbool<W> by_guide,
                                const Pair<W>& u, const Frame<vfloat<W>>& frame, const vvec3<W>& wo, const Lobes& bsdf,
                                BsdfSample<W>& s) {
  // Of a polished surface the mirror's direction stays as it is.
  const vbool<W> known = (place.region >= vint<W>(0)) & !s.is_delta;
  if (!any(known)) return;
  if (any(by_guide)) s.wi = select(by_guide, frame.to_local(guide.sample(valid_place(place), u.u, u.v)), s.wi);
  vbool<W> reflects = known;
  if constexpr (kInMedium)
    s.transmits = select(by_guide, s.wi.z < vfloat<W>(0.0f), s.transmits);
  else
    reflects &= s.wi.z > vfloat<W>(0.0f);
  const BsdfEval<W> f = bsdf.eval(wo, s.wi);
  const vvec3<W> sum = f.diffuse + f.specular;
  const vfloat<W> pdf = max(mixed_pdf(guide, place, frame.to_world(s.wi), s.wi.z, f.pdf), 1e-30f);
  s.weight = select(known, select(reflects, sum * (1.0f / pdf), vvec3<W>(vfloat<W>(0.0f))), s.weight);
  s.pdf = select(known, pdf, s.pdf);
  const vvec3<W> some(max(sum.x, 1e-30f), max(sum.y, 1e-30f), max(sum.z, 1e-30f));
  s.diffuse_share = select(known, divide(f.diffuse, some), s.diffuse_share);
}

// Lower limit of the survival probability in Russian roulette by expected contribution (Vorba and Krivanek 2016,
// "Adjoint-Driven Russian Roulette and Splitting"): radiance from the direction of the next ray over that received at the first
// surface. Without the limit, errors of the guide would cause noise. On a door, an uplight and ledges (error times rays,
// relative to roulette by throughput alone): 1/2 0.49, 0.52, 0.71; 1/4 0.56, 0.45, 0.83; 0.1 1.07, 0.54; if all survive 0.79,
// 0.81.
constexpr float kLeastSurvival = 0.5f;
// Lower limit of the radiance received at the first surface, as a share of the mean; a relMSE does not require more precision.
constexpr float kLeastReceived = 0.01f;

// Factor by which directions `d` are expected to bring more light than the path's first surface receives; 0 before a path has
// hit a surface in the guide. `first`: radiance received there, 0 before.
template <bool kInMedium, int W>
PRIMRAY_RARE vfloat<W> expected_light(const Guide& guide, const GuideLocation<W, kInMedium>& place, const vvec3<W>& d,
                                      vfloat<W>& first) {
  const vbool<W> known = place.region >= vint<W>(0);
  const GuideLocation<W, kInMedium> valid = valid_place(place);
  const vfloat<W> zero(0.0f), least(guide.usual * kLeastReceived);
  first = select(known & (first == zero), max(gather<W>(guide.received.data(), valid.region), least), first);
  const vfloat<W> light = select(known, guide.radiance(valid, d), vfloat<W>(guide.usual));
  return select(first > zero, light / max(first, 1e-30f), zero);
}

// Records vertices `p` and the rays `n` sampled there with density `pdf` and survival probability `survival`, for learning.
template <bool kInMedium, int W>
PRIMRAY_RARE void keep_vertex(GuideLog& log, vbool<W> m, const vvec3<W>& p, const vvec3<W>& ng, const vvec3<W>& ns,
                              vfloat<W> pdf, vfloat<W> survival, const PathLanes<W>& n) {
  const vfloat<W> beta = n.beta.x + n.beta.y + n.beta.z, cosine = kInMedium ? vfloat<W>(1.0f) : abs(dot(ns, n.ray.d));
  const vvec3<W>& d = n.ray.d;
  for (uint32_t b = bits(m); b; b &= b - 1) {
    const int i = __builtin_ctz(b);
    log.add_vertex(n.slot[i], {{p.x[i], p.y[i], p.z[i]},
                               {ng.x[i], ng.y[i], ng.z[i]},
                               {d.x[i], d.y[i], d.z[i]},
                               pdf[i],
                               n.bsdf_pdf[i],
                               survival[i],
                               beta[i],
                               cosine[i],
                               0.0f,
                               log.round,
                               kInMedium});
  }
}

}  // namespace primray
