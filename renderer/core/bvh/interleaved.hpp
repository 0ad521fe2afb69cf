// Interleaved traversal of a TriangleBvh: many rays at once, each traversing alone; while one waits for its next node, others
// are tested.
//
// With one ray after the other, a processor mostly waits: for the node, for the results of its tests, and after mispredicted
// branches. Here a step has no branches: all children of a node that the ray hits are pushed on its stack, the nearest last,
// and the top of the stack is its next. Entries beyond a hit leave the stack when the hit is found. Two dozen rays take turns,
// so their steps overlap. On a terrain of 2 million triangles that takes half of Embree's time
// (docs/decisions/tracing/rays-that-take-turns.md).
//
// Each ray is traversed alone, so that its bits do not depend on the others. Edges are watertight: rays are sheared onto an
// axis, corners with them, which rounds a corner alike for all triangles that share it (Woop, Benthin and Wald 2013,
// "Watertight Ray/Triangle Intersection"), and both triangles of an edge get exactly opposite results for the side on which it
// passes. Boxes are enlarged by more than the error of such a corner.
#pragma once

#include "bvh/triangle_bvh.hpp"
#include "ray/ray.hpp"

namespace primray {

// Rays in columns, as in pools.
struct RayColumns {
  const float *ox, *oy, *oz, *dx, *dy, *dz;
  const float* tnear;  // null: 0
  const float* tfar;
};
// Hit columns: distance, u and v as in Embree, index of the triangle in its group, and geometry: kTriangleGeometry, or -1 if
// nothing was hit, with the distance of the ray's own end.
struct HitColumns {
  float *t, *u, *v;
  int32_t *prim, *geom;
};

void intersect_interleaved(const TriangleBvh& bvh, uint32_t count, const RayColumns& rays, const HitColumns& hits);

// Sets `blocked` to 1 or 0 for each ray.
void occluded_interleaved(const TriangleBvh& bvh, uint32_t count, const RayColumns& rays, int32_t* blocked);

// The active rays of W, compacted, and the lanes that they belong to.
template <int W>
struct DenseRays {
  alignas(64) float ox[W], oy[W], oz[W], dx[W], dy[W], dz[W], tnear[W], tfar[W];
  int lane[W];
  uint32_t count = 0;

  DenseRays(vbool<W> active, const Rays<W>& rays) {
    for (uint32_t m = bits(active); m; m &= m - 1) {
      const int i = __builtin_ctz(m);
      ox[count] = rays.o.x[i], oy[count] = rays.o.y[i], oz[count] = rays.o.z[i];
      dx[count] = rays.d.x[i], dy[count] = rays.d.y[i], dz[count] = rays.d.z[i];
      tnear[count] = rays.tnear[i], tfar[count] = rays.tfar[i], lane[count++] = i;
    }
  }
  RayColumns columns() const { return {ox, oy, oz, dx, dy, dz, tnear, tfar}; }
};

template <int W>
PRIMRAY_RARE Hits<W> intersect_interleaved(const TriangleBvh& bvh, vbool<W> active, const Rays<W>& rays) {
  const DenseRays<W> dense(active, rays);
  alignas(64) float t[W], u[W], v[W];
  alignas(64) int32_t prim[W], geom[W];
  intersect_interleaved(bvh, dense.count, dense.columns(), {t, u, v, prim, geom});
  Hits<W> h;
  h.t = rays.tfar, h.ng = vvec3<W>(vfloat<W>(0.0f)), h.u = h.v = vfloat<W>(0.0f);
  h.prim = h.geom = h.inst = h.inst_prim = vint<W>(-1);
  for (uint32_t k = 0; k < dense.count; ++k) {
    const int i = dense.lane[k];
    h.t.set(i, t[k]), h.u.set(i, u[k]), h.v.set(i, v[k]), h.prim.set(i, prim[k]), h.geom.set(i, geom[k]);
  }
  return h;
}

template <int W>
PRIMRAY_RARE vbool<W> occluded_interleaved(const TriangleBvh& bvh, vbool<W> active, const Rays<W>& rays) {
  const DenseRays<W> dense(active, rays);
  alignas(64) int32_t blocked[W];
  occluded_interleaved(bvh, dense.count, dense.columns(), blocked);
  vint<W> found(0);
  for (uint32_t k = 0; k < dense.count; ++k) found.set(dense.lane[k], blocked[k]);
  return found != vint<W>(0);
}

}  // namespace primray
