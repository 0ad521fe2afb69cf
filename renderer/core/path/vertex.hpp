// What scattering at a vertex needs to know of it, and what a vertex asks the scene.
#pragma once

#include "accel/query.hpp"
#include "guide/caustics.hpp"
#include "guide/guided_scattering.hpp"
#include "path/interiors/crossing.hpp"
#include "path/round.hpp"
#include "surface/smooth_origin.hpp"

namespace primray {

// How far inside a triangle, of the way to its middle, a hit on its edge is looked at again.
constexpr float kWithin = 0x1p-12f;

// `Lobes`: a Bsdf, or one with OpenPBR's where the scene has such surfaces.
template <int W, class Lobes>
struct Vertex {
  Interaction<W> it;
  vvec3<W> ng;  // on the side where the ray came from
  Frame<vfloat<W>> frame;
  vvec3<W> wo;  // in that frame
  Lobes bsdf;
  const Hits<W>& hits;
  GuidePlace<W> place;              // region -1: scattered by the BSDF alone
  const CausticLanes<W>* caustics;  // null: no ray is guided into them
  const Crossing<W>* crossing;      // null: no bodies are followed
};

// The side by which lights are chosen: none where light from both is sent on.
template <int W, class Lobes>
PRIMRAY_INLINE vvec3<W> facing(const Vertex<W, Lobes>& v) {
  return select(v.bsdf.lets_through(), vvec3<W>(vfloat<W>(0.0f)), v.frame.n);
}

// The density of `wi` (of the world) without photons.
template <int W, class Lobes>
PRIMRAY_INLINE vfloat<W> scattered_density(const Round& round, const Vertex<W, Lobes>& v, const vvec3<W>& wi,
                                           vfloat<W> by_bsdf) {
  return round.settings.guide ? mixed_pdf(*round.settings.guide, v.place, wi, by_bsdf) : by_bsdf;
}

// Whether a ray that met the edge of a triangle also meets it a little further inside.
template <int W>
vbool<W> sees_within(Round& round, vbool<W> m, const PathLanes<W>& p, const Hits<W>& h, const Interaction<W>& it) {
  const SurfacePoint<W> at(round.scene, m, h);
  const vvec3<W> to = it.p + (at.e1 * (1.0f / 3 - at.u) + at.e2 * (1.0f / 3 - at.v)) * kWithin - p.ray.o;
  const Rays<W> rays{p.ray.o, normalize(to), vfloat<W>(0.0f), vfloat<W>(kInfinity), p.ray.time};
  if (round.recorder) round.recorder->record(false, false, m, rays);
  round.worker.scattered_rays += __builtin_popcount(bits(m));
  const Hits<W> seen = intersect(round.scene, false, m, rays);
  return m & (seen.geom == h.geom) & (seen.prim == h.prim) & (seen.inst == h.inst) & (seen.inst_prim == h.inst_prim);
}

// Which rays along `wi` of lanes `below`, smooth ones and below the triangle's plane, go out all the same: from `o`. Nothing
// may stand on the way there, or light would come through it.
template <int W, class Lobes>
vbool<W> start_lifted(Round& round, vbool<W> below, const Vertex<W, Lobes>& v, const vvec3<W>& wi, vfloat<W> time,
                      vvec3<W>& o) {
  vvec3<W> shift;
  vbool<W> lifted = lift_to_smooth(round.scene, below, v.hits, v.it.offset, v.ng, wi, shift);
  if (!any(lifted)) return lifted;
  const vvec3<W> from = v.it.p + v.ng * v.it.offset;
  const vfloat<W> far = length(shift);
  const Rays<W> way{from, shift * (1.0f / far), vfloat<W>(0.0f), far + 2.0f * v.it.offset, time};
  if (round.recorder) round.recorder->record(true, false, lifted, way);
  round.worker.shadow_rays += __builtin_popcount(bits(lifted));
  lifted &= !occluded(round.scene, false, lifted, way);
  o = select(lifted, from + shift, o);
  return lifted;
}

}  // namespace primray
