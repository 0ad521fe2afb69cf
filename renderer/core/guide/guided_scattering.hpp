// Sampling from the guide and the BSDF together, with a one-sample MIS density. Kept apart from the path loop, as few scenes
// have a guide.
#pragma once

#include <cmath>

#include "bsdf/bsdf.hpp"
#include "guide/guide.hpp"
#include "ray/path_lanes.hpp"

namespace primray {

// Locates the lanes in the guide: those on surfaces that scatter widely and transmit nothing.
template <int W, class Lobes>
PRIMRAY_RARE GuidePlace<W> find_place(const Guide& guide, vbool<W> scatters, const vvec3<W>& p, const vvec3<W>& ng,
                                      const Lobes& bsdf) {
  const vfloat<W> one(1.0f);
  vbool<W> wide = scatters;
  if (bsdf.any_preview) {
    const vbool<W> opaque = (bsdf.p_diffuse + bsdf.p_specular + bsdf.p_coat > vfloat<W>(0.9999f)) & (bsdf.presence >= one);
    wide &= !bsdf.lets_through();
    wide &= (!bsdf.preview) | (opaque & !bsdf.mirror & (bsdf.p_diffuse > vfloat<W>(0.3f)));
  }
  GuidePlace<W> place = guide.place_of<W>(p, ng);
  place.region = select(wide, place.region, vint<W>(-1));
  return place;
}

// Density of directions `wi` (world space) of the mixture, from the BSDF's density.
template <int W>
PRIMRAY_RARE vfloat<W> mixed_pdf(const Guide& guide, const GuidePlace<W>& place, const vvec3<W>& wi, vfloat<W> bsdf_pdf) {
  const vbool<W> known = place.region >= vint<W>(0);
  const vfloat<W> pdf = guide.pdf<W>({max(place.region, vint<W>(0)), place.side}, wi);
  return select(known, bsdf_pdf * (1.0f - kGuideShare) + pdf * kGuideShare, bsdf_pdf);
}

// Chooses the lanes whose direction the guide samples. One random number chooses and is rescaled, so that its strata serve
// both.
template <int W>
PRIMRAY_RARE vbool<W> choose_guide(const GuidePlace<W>& place, vfloat<W>& u) {
  const vbool<W> known = place.region >= vint<W>(0), by_guide = known & (u < vfloat<W>(kGuideShare));
  const vfloat<W> rest = select(by_guide, u * (1.0f / kGuideShare), (u - kGuideShare) * (1.0f / (1.0f - kGuideShare)));
  u = select(known, min(rest, 0x1.fffffep-1f), u);
  return by_guide;
}

// Samples the direction of lanes `by_guide` from the guide in place of the BSDF, and weights by the mixture's density wherever
// the guide is valid.
template <int W, class Lobes>
PRIMRAY_RARE void sample_guided(const Guide& guide, const GuidePlace<W>& place, vbool<W> by_guide, const Pair<W>& u,
                                const Frame<vfloat<W>>& frame, const vvec3<W>& wo, const Lobes& bsdf, BsdfSample<W>& s) {
  const vbool<W> known = place.region >= vint<W>(0);
  if (!any(known)) return;
  const GuidePlace<W> valid{max(place.region, vint<W>(0)), place.side};
  if (any(by_guide)) s.wi = select(by_guide, frame.to_local(guide.sample<W>(valid, u.u, u.v)), s.wi);
  const vbool<W> reflects = known & (s.wi.z > vfloat<W>(0.0f));
  const BsdfEval<W> f = bsdf.eval(wo, s.wi);
  const vvec3<W> sum = f.diffuse + f.specular;
  const vfloat<W> pdf = max(mixed_pdf(guide, place, frame.to_world(s.wi), f.pdf), 1e-30f);
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
template <int W>
PRIMRAY_RARE vfloat<W> expected_light(const Guide& guide, const GuidePlace<W>& place, const vvec3<W>& d, vfloat<W>& first) {
  const vbool<W> known = place.region >= vint<W>(0);
  const GuidePlace<W> valid{max(place.region, vint<W>(0)), place.side};
  const vfloat<W> zero(0.0f), least(guide.usual * kLeastReceived);
  first = select(known & (first == zero), max(gather<W>(guide.received.data(), valid.region), least), first);
  const vfloat<W> light = select(known, guide.radiance(valid, d), vfloat<W>(guide.usual));
  return select(first > zero, light / max(first, 1e-30f), zero);
}

// Records vertices `p` and the rays `n` sampled there with density `pdf` and survival probability `survival`, for learning.
template <int W>
PRIMRAY_RARE void keep_vertex(GuideLog& log, vbool<W> m, const vvec3<W>& p, const vvec3<W>& ng, const vvec3<W>& ns,
                              vfloat<W> pdf, vfloat<W> survival, const PathLanes<W>& n) {
  const vfloat<W> beta = n.beta.x + n.beta.y + n.beta.z, cosine = abs(dot(ns, n.ray.d));
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
                               log.round});
  }
}

}  // namespace primray
