// Ray queries of a scene: by Embree, or without it if the world consists of triangles alone.
#pragma once

#include "accel/trace.hpp"
#include "bvh/few_triangles.hpp"
#include "bvh/interleaved.hpp"
#include "scene/scene.hpp"

namespace primray {

// Replaces the hits of rays that meet a curve before. `curves` is traced by single rays alone (accel/build.cpp).
template <int W>
PRIMRAY_RARE void intersect_curves(rtc::Scene curves, vbool<W> active, const Rays<W>& rays, Hits<W>& h) {
  Rays<W> left = rays;
  left.tfar = select(h.geom != vint<W>(-1), h.t, rays.tfar);
  const Hits<W> found = intersect_single(curves, active, left);
  const vbool<W> m = active & (found.geom != vint<W>(-1));
  h.t = select(m, found.t, h.t), h.ng = select(m, found.ng, h.ng), h.u = select(m, found.u, h.u), h.v = select(m, found.v, h.v);
  h.prim = select(m, found.prim, h.prim), h.geom = select(m, found.geom, h.geom);
  h.inst = select(m, found.inst, h.inst), h.inst_prim = select(m, found.inst_prim, h.inst_prim);
}

template <int W>
PRIMRAY_RARE vbool<W> occluded_with_curves(const Scene& scene, bool packet, vbool<W> active, const Rays<W>& rays) {
  const vbool<W> blocked = occluded_single(scene.curve_accel(), active, rays), left = active & !blocked;
  if (!any(left)) return blocked;
  return blocked | (packet ? occluded_packet(scene.accel(), left, rays) : occluded_single(scene.accel(), left, rays));
}

// Nearest hits of the `active` rays, as a packet or one by one; the bits are the same.
template <int W>
PRIMRAY_INLINE Hits<W> intersect(const Scene& scene, bool packet, vbool<W> active, const Rays<W>& rays) {
  if (scene.few_triangles.any()) return intersect_few(scene.few_triangles, active, rays);
  if (scene.triangle_bvh.any()) return intersect_interleaved(scene.triangle_bvh, active, rays);
  Hits<W> h = packet ? intersect_packet(scene.accel(), active, rays) : intersect_single(scene.accel(), active, rays);
  if (scene.curve_accel()) intersect_curves(scene.curve_accel(), active, rays, h);
  h.time = rays.time;
  return h;
}

// Returns the lanes of `active` whose rays are blocked.
template <int W>
PRIMRAY_INLINE vbool<W> occluded(const Scene& scene, bool packet, vbool<W> active, const Rays<W>& rays) {
  if (scene.few_triangles.any()) return occluded_few(scene.few_triangles, active, rays);
  if (scene.triangle_bvh.any()) return occluded_interleaved(scene.triangle_bvh, active, rays);
  if (scene.curve_accel()) return occluded_with_curves(scene, packet, active, rays);
  return packet ? occluded_packet(scene.accel(), active, rays) : occluded_single(scene.accel(), active, rays);
}

}  // namespace primray
