// Medium state of paths, stored beside the columns of the path pool; only present where Interiors::followed.
#pragma once

#include "medium/bodies.hpp"
#include "path/rays/pool.hpp"

namespace primray {

// Medium state of one packet of paths. `below` is the subsurface medium of paths that have entered an opaque surface, until
// they leave it.
template <int W>
struct Inside {
  BodyLanes<W> bodies;
  Medium<W> below;
  vfloat<W> lead{0.0f};  // distance between the surface point and the ray's offset origin, which the medium also fills

  PRIMRAY_INLINE vbool<W> walks() const { return below.exists(); }
  // Medium that surrounds each path.
  PRIMRAY_INLINE Medium<W> medium(const Scene& scene) const {
    const vbool<W> walks_on = walks();
    if (!any(walks_on)) return medium_of(scene, bodies);
    Medium<W> r = medium_of(scene, bodies);
    r.extinction = select(walks_on, below.extinction, r.extinction);
    r.scattering = select(walks_on, below.scattering, r.scattering);
    r.phase = select(walks_on, below.phase, r.phase);
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

struct InsideColumns {
  alignas(64) int32_t inside[kMostBodies][kPadded];
  alignas(64) float below[7][kPadded], lead[kPadded];

  template <int W>
  PRIMRAY_INLINE Inside<W> at(int i) const {
    Inside<W> r;
    for (int k = 0; k < kMostBodies; ++k) r.bodies.inside[k] = load<W>(inside[k] + i);
    const auto column = [&](int k) { return load<W>(below[k] + i); };
    r.below.extinction = {column(0), column(1), column(2)}, r.below.scattering = {column(3), column(4), column(5)};
    r.below.phase = column(6);
    r.lead = load<W>(lead + i);
    return r;
  }
  // Stores at `i` the lanes that `c` selects.
  template <int W>
  PRIMRAY_INLINE void put(int i, const Compaction<W>& c, const Inside<W>& r) {
    for (int k = 0; k < kMostBodies; ++k) c.append(inside[k] + i, r.bodies.inside[k]);
    const Medium<W>& m = r.below;
    const vfloat<W>* columns[7] = {&m.extinction.x, &m.extinction.y, &m.extinction.z, &m.scattering.x,
                                   &m.scattering.y, &m.scattering.z, &m.phase};
    for (int k = 0; k < 7; ++k) c.append(below[k] + i, *columns[k]);
    c.append(lead + i, r.lead);
  }
};

// Medium stacks at the origins of shadow rays, which may pass straight through boundaries.
struct ShadowBodies {
  alignas(64) int32_t inside[kMostBodies][ShadowQueue::kSize];
  alignas(64) float lead[ShadowQueue::kSize];

  template <int W>
  PRIMRAY_INLINE BodiesAround<W> at(int i) const {
    BodiesAround<W> r;
    for (int k = 0; k < kMostBodies; ++k) r.bodies.inside[k] = load<W>(inside[k] + i);
    r.lead = load<W>(lead + i);
    return r;
  }
  template <int W>
  PRIMRAY_INLINE void put(int i, const Compaction<W>& c, const BodiesAround<W>& r) {
    for (int k = 0; k < kMostBodies; ++k) c.append(inside[k] + i, r.bodies.inside[k]);
    c.append(lead + i, r.lead);
  }
};

// Medium state of one worker: for its two path pools and its shadow queues.
struct InsideStore {
  InsideColumns columns[2];
  InsideColumns* pool = &columns[0];
  InsideColumns* next = &columns[1];
  ShadowBodies shadows, special_shadows;
};

}  // namespace primray
