// Ray queries of a scene: by Embree, or without it if the world consists of triangles alone.
#pragma once

#include "accel/trace.hpp"
#include "bvh/few_triangles.hpp"
#include "bvh/interleaved.hpp"
#include "scene/scene.hpp"

namespace primray {

// Nearest hits of the `active` rays, as a packet or one by one; the bits are the same.
template <int W>
PRIMRAY_INLINE Hits<W> intersect(const Scene& scene, bool packet, vbool<W> active, const Rays<W>& rays) {
  if (scene.few_triangles.any()) return intersect_few(scene.few_triangles, active, rays);
  if (scene.triangle_bvh.any()) return intersect_interleaved(scene.triangle_bvh, active, rays);
  Hits<W> h = packet ? intersect_packet(scene.accel(), active, rays) : intersect_single(scene.accel(), active, rays);
  h.time = rays.time;
  return h;
}

// Returns the lanes of `active` whose rays are blocked.
template <int W>
PRIMRAY_INLINE vbool<W> occluded(const Scene& scene, bool packet, vbool<W> active, const Rays<W>& rays) {
  if (scene.few_triangles.any()) return occluded_few(scene.few_triangles, active, rays);
  if (scene.triangle_bvh.any()) return occluded_interleaved(scene.triangle_bvh, active, rays);
  return packet ? occluded_packet(scene.accel(), active, rays) : occluded_single(scene.accel(), active, rays);
}

}  // namespace primray
