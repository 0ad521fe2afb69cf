// Embree scenes and triangle geometry over the flat arrays, which are shared, not copied.
#pragma once

#include "embree/embree.hpp"
#include "scene/scene.hpp"

namespace primray {

inline OwnedScene new_embree_scene(bool is_compact = false) {
  OwnedScene s(embree().rtcNewScene(embree_device()));
  embree().rtcSetSceneFlags(s.get(), rtc::kRobust | (is_compact ? rtc::kCompact : 0));
  embree().rtcSetSceneBuildQuality(s.get(), rtc::BuildQuality(2));
  return s;
}

// Geometry of the group's vertices, without indices yet: at `steps` times, where the last of them move.
inline OwnedGeometry over_positions(rtc::GeometryType type, const Scene& scene, const Group& group, int steps = 1) {
  const rtc::Api& e = embree();
  OwnedGeometry g(e.rtcNewGeometry(embree_device(), type));
  if (steps > 1) e.rtcSetGeometryTimeStepCount(g.get(), uint32_t(steps));
  for (int k = 0; k < steps; ++k)
    e.rtcSetSharedGeometryBuffer(g.get(), rtc::kVertexBuffer, uint32_t(k), rtc::kFloat3, scene.positions.data(),
                                 (size_t(group.vertex_base) + size_t(k) * group.moving_vertex_count) * 12, 12,
                                 group.vertex_count);
  return g;
}

// Geometry of `count` of the group's triangles from `first` on.
inline OwnedGeometry make_triangles(const Scene& scene, const Group& group, uint32_t first, uint32_t count, int steps = 1) {
  OwnedGeometry g = over_positions(rtc::kTriangle, scene, group, steps);
  embree().rtcSetSharedGeometryBuffer(g.get(), rtc::kIndexBuffer, 0, rtc::kUint3, scene.indices.data(),
                                      (size_t(group.triangle_base) + first) * 12, 12, count);
  return g;
}

// Number of time steps of the group's moving vertices; 1 if none move.
inline int vertex_steps(const Scene& scene, const Group& group) {
  return group.clock < 0 ? 1 : scene.motion.clocks[size_t(group.clock)].segments() + 1;
}

}  // namespace primray
