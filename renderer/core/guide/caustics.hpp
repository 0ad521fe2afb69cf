// Scattering guided towards caustics (guide/caustic_guide.hpp): a mixture with the surface's own sampling, in lanes.
#pragma once

#include "bsdf/bsdf.hpp"
#include "guide/caustic_guide.hpp"
#include "sampler/sampler.hpp"

namespace primray {

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
  return !b.lets_through() &
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

}  // namespace primray
