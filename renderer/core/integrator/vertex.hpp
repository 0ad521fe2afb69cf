// Path vertex: its interaction, frame and lobes, and queries that scattering makes to the scene.
#pragma once

#include "accel/query.hpp"
#include "guiding/guided_scattering.hpp"
#include "integrator/media.hpp"
#include "integrator/rays/path_pool.hpp"
#include "integrator/rays/ray_recorder.hpp"
#include "integrator/round.hpp"
#include "surface/ray_origin.hpp"

namespace primray {

// Parts of a split path: each carries an equal share of the throughput, and they take consecutive indices of a sample sequence
// that is `parts` times longer.

// Returns one of `parts` parts in lanes `split`, not yet numbered; other lanes keep the path.
template <int W>
PRIMRAY_INLINE PathLanes<W> split_part(const PathLanes<W>& p, vbool<W> split, int parts) {
  PathLanes<W> part = p;
  part.beta = select(split, p.beta * (1.0f / float(parts)), p.beta);
  return part;
}

// Makes `part` the k-th of its path.
template <int W>
PRIMRAY_INLINE void number_part(PathLanes<W>& part, const PathLanes<W>& p, vbool<W> split, int parts, int k) {
  const vuint<W> number = reverse_bits(p.sampler.reversed_index) * vuint<W>(uint32_t(parts)) + vuint<W>(uint32_t(k));
  part.sampler.reversed_index = select(split, reverse_bits(number), p.sampler.reversed_index);
}

// Distance inside a triangle, as a fraction of the way to its centroid, at which hits on its edge are tested again.
constexpr float kEdgeInset = 0x1p-12f;

// Path vertex in W lanes. `Lobes` is a Bsdf, or one with OpenPBR or hair lobes if the scene has such surfaces.
template <int W, class Lobes>
struct Vertex {
  Interaction<W> it;
  vvec3<W> ng;  // on the side that the ray came from
  Frame<vfloat<W>> frame;
  vvec3<W> wo;  // in that frame
  Lobes bsdf;
  const Hits<W>& hits;
  GuideLocation<W> place;           // region -1: sampled by the BSDF alone
  const CausticLanes<W>* caustics;  // null: no caustic guiding
  const Crossing<W>* crossing;      // null: no media
};

// Normal of the hemisphere in which lights are chosen; 0 if the surface transmits light from both sides.
template <int W, class Lobes>
PRIMRAY_INLINE vvec3<W> facing(const Vertex<W, Lobes>& v) {
  return select(v.bsdf.lets_through(), vvec3<W>(vfloat<W>(0.0f)), v.frame.n);
}

// Density of `wi` (world space) without caustic photons.
template <int W, class Lobes>
PRIMRAY_INLINE vfloat<W> scattered_density(const Round& round, const Vertex<W, Lobes>& v, const vvec3<W>& wi,
                                           vfloat<W> by_bsdf) {
  return round.settings.guide ? mixed_pdf(*round.settings.guide, v.place, wi, by_bsdf) : by_bsdf;
}

// Confirms hits on a triangle's edge: whether a ray a little further inside hits the same triangle.
template <int W>
vbool<W> confirm_edge_hit(Round& round, vbool<W> m, const PathLanes<W>& p, const Hits<W>& h, const Interaction<W>& it) {
  const SurfacePoint<W> at(round.scene, m, h);
  const vvec3<W> to = it.p + (at.e1 * (1.0f / 3 - at.u) + at.e2 * (1.0f / 3 - at.v)) * kEdgeInset - p.ray.o;
  const Rays<W> rays{p.ray.o, normalize(to), vfloat<W>(0.0f), vfloat<W>(kInfinity), p.ray.time};
  if (round.recorder) round.recorder->record(false, false, m, rays);
  round.worker.scattered_rays += __builtin_popcount(bits(m));
  const Hits<W> seen = intersect(round.scene, false, m, rays);
  return m & (seen.geom == h.geom) & (seen.prim == h.prim) & (seen.inst == h.inst) & (seen.inst_prim == h.inst_prim);
}

// Moves the origins of rays along `wi` in lanes `below`, which start below the triangle's plane at a smooth surface, up to `o`
// on that surface; returns the lanes for which it succeeds. Nothing may block the way there, or light would leak.
template <int W, class Lobes>
vbool<W> lift_origins(Round& round, vbool<W> below, const Vertex<W, Lobes>& v, const vvec3<W>& wi, vfloat<W> time,
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
