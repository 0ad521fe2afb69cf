// Medium state of paths: the media that a path is in, stored beside the columns of the path pool (only present where
// Interiors::followed); vertices on boundaries of media; and phase functions in the place of a surface's lobes.
#pragma once

#include "bsdf/basics/scattering.hpp"
#include "bsdf/bsdf.hpp"
#include "bsdf/surface.hpp"
#include "integrator/rays/path_pool.hpp"
#include "medium/medium.hpp"
#include "medium/medium_stack.hpp"
#include "medium/phase_function.hpp"
#include "medium/ray_medium.hpp"
#include "medium/walk_guide.hpp"

namespace primray {

// Phase function in the place of a surface's lobes, for vertices inside a medium: all directions are transmitted.

// Local frame: +z points back along the ray.
template <int W>
struct PhaseLobes : Bsdf<W> {
  static constexpr bool kInMedium = true, kFollowsMedia = true;
  vfloat<W> phase;
  vint<W> path{-1};  // of the pool when its ray was traced; -1: no lights are sampled along the ray (integrator/along_rays.hpp)

  explicit PhaseLobes(vfloat<W> phase)
      : Bsdf<W>(plain(), vbool<W>(false), {vfloat<W>(0.0f), vfloat<W>(0.0f), vfloat<W>(1.0f)}, vbool<W>(true)), phase(phase) {}

  static vbool<W> lets_through() { return vbool<W>(true); }
  PRIMRAY_INLINE BsdfEval<W> eval(const vvec3<W>&, const vvec3<W>& wi) const {
    const vfloat<W> density = phase_density(-wi.z, phase);
    return {vvec3<W>(density), vvec3<W>(vfloat<W>(0.0f)), density};
  }
  PRIMRAY_INLINE BsdfSample<W> sample(const vvec3<W>&, vfloat<W>, vfloat<W> u, vfloat<W> v) const {
    const vbool<W> never(false);
    const vvec3<W> one(vfloat<W>(1.0f)), on = sample_phase(phase, u, v), wi{on.x, on.y, -on.z};
    return {wi, one, phase_density(on.z, phase), never, wi.z < vfloat<W>(0.0f), never, one};
  }

 private:
  // Row of a surface without lobes; nothing of it is evaluated.
  static SurfaceRows<W> plain() {
    static const float row[kSurfaceFields] = {};
    return SurfaceRows<W>(row);
  }
};

// Medium state of one packet of paths. `subsurface` is the subsurface medium of paths that have entered an opaque surface,
// until they leave it.
template <int W>
struct MediumState {
  MediumStack<W> stack;
  Medium<W> subsurface;
  vfloat<W> origin_distance{
      0.0f};           // distance between the surface point and the ray's offset origin, which the medium also fills
  vint<W> volumes{0};  // number of a set (medium/volume_sets.hpp)
  WalkGuide<W> guide;  // in the subsurface medium

  PRIMRAY_INLINE vbool<W> in_subsurface() const { return subsurface.exists(); }
  // Medium that surrounds each path.
  PRIMRAY_INLINE Medium<W> medium(const Scene& scene) const {
    const vbool<W> in_walk = in_subsurface();
    if (!any(in_walk)) return medium_of(scene, stack);
    Medium<W> r = medium_of(scene, stack);
    r.extinction = select(in_walk, subsurface.extinction, r.extinction);
    r.scattering = select(in_walk, subsurface.scattering, r.scattering);
    r.phase = select(in_walk, subsurface.phase, r.phase);
    return r;
  }
};

// Calls f(k, lanes) for the lanes of each of the disjoint masks `kinds`. If samples are split (`parted`), parts of one sample
// may be adjacent lanes whose contributions are added in the order of the calls; the masks are then processed in runs of lanes,
// so that the result has the same bits for every lane count.
template <int W, int K, class F>
PRIMRAY_INLINE void for_kinds(bool parted, const vbool<W> (&kinds)[K], const F& f) {
  uint32_t masks[K], all = 0;
  for (int k = 0; k < K; ++k) masks[k] = bits(kinds[k]), all |= masks[k];
  for (int k = 0; k < K; ++k)
    if (masks[k] == all) parted = false;
  if (!parted) {
    for (int k = 0; k < K; ++k)
      if (masks[k]) f(k, kinds[k]);
    return;
  }
  for (uint32_t left = all; left;) {
    int k = 0;
    while (!(masks[k] & left & -left)) ++k;
    const uint32_t others = left & ~masks[k], run = others ? left & ((others & -others) - 1) : left;
    left &= ~run;
    vbool<W> lanes(false);
    lanes = (lane_numbers<W>() >= vint<W>(__builtin_ctz(run))) & (lane_numbers<W>() <= vint<W>(31 - __builtin_clz(run)));
    f(k, lanes & kinds[k]);
  }
}

struct MediumStateColumns {
  alignas(64) int32_t surfaces[kMaxNestedMedia][kPadded];
  alignas(64) float subsurface[7][kPadded], origin_distance[kPadded];
  alignas(64) int32_t volumes[kPadded];
  alignas(64) float guide[8][kPadded];  // present if light walks below some surface
  bool walks = false;

  template <int W>
  PRIMRAY_INLINE MediumState<W> at(int i) const {
    MediumState<W> r;
    for (int k = 0; k < kMaxNestedMedia; ++k) r.stack.surfaces[k] = load<W>(surfaces[k] + i);
    const auto column = [&](int k) { return load<W>(subsurface[k] + i); };
    r.subsurface.extinction = {column(0), column(1), column(2)}, r.subsurface.scattering = {column(3), column(4), column(5)};
    r.subsurface.phase = column(6);
    r.origin_distance = load<W>(origin_distance + i), r.volumes = load<W>(volumes + i);
    return r;
  }
  template <int W>
  PRIMRAY_INLINE WalkGuide<W> guide_at(int i) const {
    const auto column = [&](int k) { return load<W>(guide[k] + i); };
    return {{column(0), column(1), column(2)}, column(3), column(4), {column(5), column(6), column(7)}};
  }
  void reorder(const int32_t* order, int count) {
    for (int32_t (&column)[kPadded] : surfaces) reorder_column(column, order, count);
    for (float (&column)[kPadded] : subsurface) reorder_column(column, order, count);
    reorder_column(origin_distance, order, count), reorder_column(volumes, order, count);
    // Guides are read before hits are sorted.
  }
  // Stores at `i` the lanes that `c` selects.
  template <int W>
  PRIMRAY_INLINE void put(int i, const Compaction<W>& c, const MediumState<W>& r) {
    for (int k = 0; k < kMaxNestedMedia; ++k) c.append(surfaces[k] + i, r.stack.surfaces[k]);
    const Medium<W>& m = r.subsurface;
    const vfloat<W>* columns[7] = {&m.extinction.x, &m.extinction.y, &m.extinction.z, &m.scattering.x,
                                   &m.scattering.y, &m.scattering.z, &m.phase};
    for (int k = 0; k < 7; ++k) c.append(subsurface[k] + i, *columns[k]);
    c.append(origin_distance + i, r.origin_distance), c.append(volumes + i, r.volumes);
    if (!walks) return;
    const WalkGuide<W>& g = r.guide;
    const vfloat<W>* guides[8] = {&g.normal.x, &g.normal.y, &g.normal.z, &g.middle, &g.phase_pdf, &g.nu.x, &g.nu.y, &g.nu.z};
    for (int k = 0; k < 8; ++k) c.append(guide[k] + i, *guides[k]);
  }
};

// Medium stacks at the origins of shadow rays, which may pass straight through boundaries.
struct ShadowMediaColumns {
  alignas(64) int32_t surfaces[kMaxNestedMedia][ShadowQueue::kSize];
  alignas(64) float origin_distance[ShadowQueue::kSize];
  alignas(64) int32_t volumes[ShadowQueue::kSize];

  template <int W>
  PRIMRAY_INLINE ShadowMedia<W> at(int i) const {
    ShadowMedia<W> r;
    for (int k = 0; k < kMaxNestedMedia; ++k) r.stack.surfaces[k] = load<W>(surfaces[k] + i);
    r.origin_distance = load<W>(origin_distance + i), r.volumes = load<W>(volumes + i);
    return r;
  }
  template <int W>
  PRIMRAY_INLINE void put(int i, const Compaction<W>& c, const ShadowMedia<W>& r) {
    for (int k = 0; k < kMaxNestedMedia; ++k) c.append(surfaces[k] + i, r.stack.surfaces[k]);
    c.append(origin_distance + i, r.origin_distance), c.append(volumes + i, r.volumes);
  }
};

// Medium state of one worker: for its two path pools and its shadow queues, and the sets of volumes that these name.
struct MediumStateStore {
  MediumStateColumns columns[2]{};
  MediumStateColumns* pool = &columns[0];
  MediumStateColumns* next = &columns[1];
  ShadowMediaColumns shadows{}, special_shadows{};
  VolumeSets sets;

  explicit MediumStateStore(const Interiors& interiors) : sets(interiors) {
    for (MediumStateColumns& c : columns) c.walks = interiors.walks;
  }
  // Keeps the number of sets small; no path may be alive. Lanes without a path read what earlier ones left.
  void forget_sets() {
    if (!sets.forget_if_many()) return;
    for (MediumStateColumns& c : columns) std::fill(std::begin(c.volumes), std::end(c.volumes), 0);
    for (ShadowMediaColumns* c : {&shadows, &special_shadows}) std::fill(std::begin(c->volumes), std::end(c->volumes), 0);
  }
};

// Media at a vertex: that of the incoming path, those on both sides of the surface, and the one below an opaque surface.
template <int W>
struct MediumInterface {
  MediumState<W> incoming;  // of the path that hit the surface
  Boundary<W> boundary;
  Medium<W> below;  // medium below opaque surfaces that light may enter (subsurface scattering)

  // State of the path after the scattering event `s`.
  PRIMRAY_INLINE MediumState<W> state_after(const BsdfSample<W>& s) const {
    MediumState<W> r;
    r.stack = select(s.transmits & !s.enters, boundary.beyond, boundary.here);
    r.subsurface.extinction = select(s.enters, below.extinction, incoming.subsurface.extinction);
    r.subsurface.scattering = select(s.enters, below.scattering, incoming.subsurface.scattering);
    r.subsurface.phase = select(s.enters, below.phase, incoming.subsurface.phase);
    r.volumes = incoming.volumes;
    return r;
  }
  // Transmittance over distance `t` from here, times the radiance scale of the medium; in lanes `beyond` on the far side of the
  // surface.
  PRIMRAY_RARE vvec3<W> transmittance_towards(const Scene& scene, vbool<W> beyond, vfloat<W> t) const {
    const MediumStack<W> stack = select(beyond, boundary.beyond, boundary.here);
    return medium_of(scene, stack).transmittance(t) * radiance_scale(scene, stack);
  }
};

}  // namespace primray
