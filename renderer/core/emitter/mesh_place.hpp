// Placement of a mesh light and the motion of its vertices, at the times of W rays.
#pragma once

#include "light/light.hpp"
#include "motion/vertex_motion.hpp"
#include "scene/scene.hpp"

namespace primray {

template <int W>
struct MeshPlace {
  AffineLanes<W> world_from_group;
  VertexMotion<W> vertices;

  // For lanes `m`, whose light is `row` and whose index in the EmitterTable is `shape`.
  PRIMRAY_INLINE MeshPlace(const Scene& scene, vbool<W> m, const LightRow<W>& row, vint<W> shape, vfloat<W> time) {
    AffineLanes<W>& to = world_from_group;
    to.x = row.vector(kAxisX), to.y = row.vector(kAxisY), to.z = row.vector(kAxisZ), to.o = row.vector(kOrigin);
    if (scene.motion.any_instances) {
      const vint<W> placement = truncate(row(kMeshPlacement)), zero(0);
      const vbool<W> placed = m & (placement >= zero);
      const vint<W> first = gather<W>(scene.placement_instance.data(), select(placed, placement, zero));
      if (any(placed)) move_instances(scene.motion, placed, first + truncate(row(kMeshInstance)), time, to);
    }
    if (scene.motion.any_points) {
      const vint<W> clock = gather<W>(scene.emitters.clock.data(), select(m, shape, vint<W>(0)));
      const vbool<W> moves = m & (clock >= vint<W>(0));
      if (any(moves))
        vertices.set(scene.motion, moves, clock, gather<W>(scene.emitters.stride.data(), select(m, shape, vint<W>(0))), time);
    }
  }
  PRIMRAY_INLINE vvec3<W> to_world(const vvec3<W>& v) const { return world_from_group.vector(v); }
};

}  // namespace primray
