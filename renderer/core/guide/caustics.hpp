// Scattering that is guided into caustics (guide/caustic_guide.hpp): a mixture with the surface's own sampling, on lanes.
#pragma once

#include "bsdf/bsdf.hpp"
#include "guide/caustic_guide.hpp"
#include "sampler/sampler.hpp"

namespace primray {

// Narrower lobes (roughness 0.14) find by themselves what they show.
constexpr float kFollowsAlpha = 0.02f;
// Guided paths count in roulette for what surfaces alone would have made of them, up to this factor.
constexpr float kMostBoost = 1e7f;
// A lobe with less density than this is a diffuse one.
constexpr float kDiffuseDensity = 1;

// Surfaces that scatter widely enough for another density to serve them.
template <int W, class Lobes>
PRIMRAY_INLINE vbool<W> follows_caustics(const Lobes& b) {
  if (!b.any_preview) return vbool<W>(true);
  return !b.lets_through() &
         ((!b.preview) | (b.p_diffuse > vfloat<W>(0.1f)) | ((!b.mirror) & (b.alpha > vfloat<W>(kFollowsAlpha))));
}

// How much of the light from about unit `wi` (local), a lobe with that squared width, is sent on towards `wo`, over what a
// white Lambert surface sends; less where the surface's own lobe is the narrower one.
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

// As Bsdf::sample, but `own` is the density without photons, for MIS: those lead to what casts caustics, not to lights, and
// light samples need not ask them. `sample(lobe)` and `density(wi, by the BSDF)` are what is sampled without them, by the BSDF
// or by another guide as well. `splits`, by which roulette multiplies, takes in how much denser than that the sampling was.
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
    // For now f_cos itself and the density by the surface, below divided by the mixture's.
    s.weight = select(guided, select(up, e.diffuse + e.specular, vvec3<W>(zero)), s.weight);
    s.pdf = select(guided, density(wi, e.pdf), s.pdf);
    s.is_delta = s.is_delta & !guided, s.transmits = s.transmits & !guided, s.straight = s.straight & !guided;
    const vvec3<W> sum = e.diffuse + e.specular;
    const vvec3<W> share = divide(e.diffuse, {max(sum.x, 1e-30f), max(sum.y, 1e-30f), max(sum.z, 1e-30f)});
    s.diffuse_share = select(guided, share, s.diffuse_share);
  }
  own = select(guided, max(s.pdf, 1e-20f), s.pdf);  // 0 would say that no light sample leads there
  const vfloat<W> mixed = own * rest + guide.share * guide.pdf(wi);
  const vfloat<W> factor = select(guided, 1.0f / max(mixed, 1e-30f), select(s.is_delta, 1.0f / rest, own / max(mixed, 1e-30f)));
  s.weight = select(any_share, s.weight * factor, s.weight);
  s.pdf = select(any_share & !s.is_delta, mixed, s.pdf);
  const vfloat<W> boost = clamp(mixed / max(own, 1e-20f), 1.0f, kMostBoost);
  splits = select(guided, min(splits, float(path_splits)) * boost, splits);
  return s;
}

}  // namespace primray
