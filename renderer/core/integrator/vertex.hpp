// Path vertex: the surface that was hit, its frame and lobes, and queries that scattering makes to the scene.
#pragma once

#include "accel/query.hpp"
#include "guiding/guided_scattering.hpp"
#include "integrator/media.hpp"
#include "integrator/rays/path_pool.hpp"
#include "integrator/rays/ray_recorder.hpp"
#include "integrator/round.hpp"
#include "surface/interaction.hpp"
#include "surface/ray_origin.hpp"

namespace primray {

// Surface that W rays hit, and the side of it that they came from.
template <int W>
struct SurfaceHit {
  const Hits<W>& hits;
  Interaction<W> it;
  SurfaceRows<W> rows;
  vfloat<W> cosine;  // between the outward normal and the direction that the ray came from
  vbool<W> front;    // whether the ray came from outside
  // Geometric normal and shading frame on that side; the frame is valid after set_frame().
  vvec3<W> ng;
  Frame<vfloat<W>> frame;

  PRIMRAY_INLINE SurfaceHit(const Scene& scene, vbool<W> hit, const Rays<W>& rays, const Hits<W>& h)
      : hits(h),
        it(interact(scene, hit, rays, h)),
        rows(scene.surfaces, it.surface, hit),
        cosine(dot(it.ng, -rays.d)),
        front(cosine > vfloat<W>(0.0f)),
        ng(it.ng * side()) {}

  // Factor that turns outward normals to the side of the ray.
  PRIMRAY_INLINE vfloat<W> side() const { return select(front, vfloat<W>(1.0f), vfloat<W>(-1.0f)); }
  // Sets the shading frame for rays from `wo`, once normal maps have bent the shading normal; one that faces away from `wo` is
  // replaced by the geometric normal.
  PRIMRAY_INLINE void set_frame(const vvec3<W>& wo) {
    const vvec3<W> ns = it.ns * side();
    frame = Frame<vfloat<W>>(select(dot(ns, wo) > vfloat<W>(1e-4f), ns, ng));
  }
};

// Continues paths straight, from behind the surface that they hit. `state`: their medium state, if media are followed.
template <int W>
PRIMRAY_RARE void continue_straight(Round& round, vbool<W> lanes, const PathLanes<W>& p, const SurfaceHit<W>& surface,
                                    const MediumState<W>* state = nullptr) {
  const Compaction<W> c(lanes);
  PathLanes<W> n = p;
  const vfloat<W> distance = dot(surface.it.p - p.ray.o, p.ray.d);
  n.ray.o = surface.it.p - surface.ng * surface.it.offset;
  n.ray.tnear = vfloat<W>(0.0f);
  n.ray.tfar = p.ray.tfar - dot(n.ray.o - p.ray.o, p.ray.d);
  n.vertex = p.vertex + vint<W>(1);
  n.travelled = p.travelled + distance, n.cone_width = p.cone_width + p.cone_spread * distance;
  if (state) round.worker.medium_states->next->put(round.worker.next->count, c, *state);
  round.worker.next->append(c, n, round.needs);
}

// Parts of a split path: each carries an equal share of the throughput, and they take consecutive indices of a sample sequence
// that is `parts` times longer.

// Numbers of parts of paths that have not come to the surface where they split, or where they take several light samples:
// before they have followed both directions of smooth glass, and after it.
constexpr float kUnbranched = 0, kBranched = -1;

// Returns the lanes whose path has one of these numbers.
template <int W>
PRIMRAY_INLINE vbool<W> is_whole(const PathLanes<W>& p) {
  return p.splits <= vfloat<W>(kUnbranched);
}
template <int W>
PRIMRAY_INLINE vfloat<W> parts_of(const PathLanes<W>& p) {
  return select(is_whole(p), vfloat<W>(1.0f), p.splits);
}

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
  GuideLocation<W, Lobes::kInMedium> place;  // region -1: sampled by the BSDF alone
  const CausticLanes<W>* caustics;           // null: no caustic guiding
  const MediumInterface<W>* media;           // null: media are not followed
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
  return round.settings.guide ? mixed_pdf(*round.settings.guide, v.place, wi, dot(wi, v.frame.n), by_bsdf) : by_bsdf;
}

// Confirms hits on a triangle's edge: whether a ray a little further inside hits the same triangle.
template <int W>
vbool<W> confirm_edge_hit(Round& round, vbool<W> m, const PathLanes<W>& p, const SurfaceHit<W>& surface) {
  const Hits<W>& h = surface.hits;
  const SurfacePoint<W> at(round.scene, m, h);
  const vvec3<W> to = surface.it.p + (at.e1 * (1.0f / 3 - at.u) + at.e2 * (1.0f / 3 - at.v)) * kEdgeInset - p.ray.o;
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
