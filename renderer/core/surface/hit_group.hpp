// Group and instance of W hits.
#pragma once

#include <functional>

#include "math/matrix.hpp"
#include "motion/motion_table.hpp"
#include "ray/ray.hpp"
#include "scene/scene.hpp"

namespace primray {

// The group that was hit, its geometry, and the instance in which it was hit; with two levels of instances, the inner one and
// `outer`.
template <int W>
struct HitGroup {
  vbool<W> instanced, grouped;
  bool any_instanced, any_grouped;
  vint<W> geom;                               // Embree's number within the group
  vint<W> placement, group, instance, outer;  // 0 if not instanced
  vfloat<W> time;

  PRIMRAY_INLINE HitGroup(const Scene& scene, vbool<W> active, const Hits<W>& h)
      : grouped(false), any_grouped(false), geom(h.geom), placement(0), group(0), instance(0), outer(0), time(h.time) {
    instanced = scene.has_instances ? active & (h.inst != vint<W>(-1)) : vbool<W>(false);
    any_instanced = scene.has_instances && any(instanced);
    if (!any_instanced) return;
    const vint<W> zero(0);
    const int32_t first_id = int32_t(kFirstPlacement) - int32_t(scene.groups[0].placement_base);
    placement = select(instanced, h.inst - vint<W>(first_id), zero);
    if (scene.has_grouped) {
      const GroupedHit<W> hit(instanced, h.geom, h.inst);
      grouped = hit.grouped, any_grouped = any(grouped);
      placement = select(grouped, hit.placement, placement);
      geom = select(grouped, hit.geom, geom);
      outer = select(grouped, hit.outer, zero);
    }
    group = select(instanced, gather<W>(scene.placement_group.data(), placement), zero);
    instance = select(instanced, gather<W>(scene.placement_instance.data(), placement) + h.inst_prim, zero);
  }
  PRIMRAY_INLINE vbool<W> is(vbool<W> active, uint32_t geometry) const { return active & (geom == vint<W>(int32_t(geometry))); }
  PRIMRAY_INLINE vbool<W> is_triangle(const Scene& scene, vbool<W> active) const {
    vbool<W> found = is(active, kTriangleGeometry);
    if (scene.has_pairs) found |= is(active, kPairGeometry);
    if (scene.has_cutouts) found |= is(active, kCutoutGeometry);
    if (scene.motion.any_points) found |= moves(active);
    return found;
  }
  // Returns the lanes of `active` that hit triangles with moving vertices.
  PRIMRAY_INLINE vbool<W> moves(vbool<W> active) const {
    return is(active, kMovingGeometry) | is(active, kMovingCutoutGeometry);
  }
  // Stores the motion of the vertices that lanes `active` hit in the new `v`.
  PRIMRAY_INLINE void note_motion(const Scene& scene, vbool<W> active, VertexMotion<W>& v) const {
    if (!scene.motion.any_points) return;
    if (const vbool<W> m = moves(active); any(m))
      v.set(scene.motion, m, base(scene, &Group::clock), base(scene, &Group::moving_vertex_count), time);
  }
  // World from group, in instanced lanes; `rounded`: magnitude of what was rounded in composing it.
  PRIMRAY_INLINE AffineLanes<W> matrix(const Scene& scene, vvec3<W>& rounded) const {
    AffineLanes<W> m(scene.world_from_group.data(), instance * vint<W>(12));
    if (scene.motion.any_instances) move_instances(scene.motion, instanced, instance, time, m);
    rounded = vvec3<W>(vfloat<W>(0.0f));
    if (!any_grouped) return m;
    AffineLanes<W> around(scene.world_from_group.data(), outer * vint<W>(12));
    if (scene.motion.any_instances) move_instances(scene.motion, grouped, outer, time, around);
    rounded = m.move(grouped, around);
    return m;
  }
  // Gathers `field(group)` for each lane's group.
  template <class Field>
  PRIMRAY_INLINE vint<W> base(const Scene& scene, const Field& field) const {
    if (!any_instanced) return vint<W>(int32_t(std::invoke(field, scene.groups[0])));
    vint<W> b;
    for (int i = 0; i < W; ++i) b.set(i, int32_t(std::invoke(field, scene.groups[group[i]])));
    return b;
  }
  // Triangles that were hit, by index over the scene; 0 in other lanes.
  PRIMRAY_INLINE vint<W> triangle(const Scene& scene, vbool<W> is_triangle, const Hits<W>& h) const {
    vint<W> first = base(scene, &Group::triangle_base);
    if (scene.has_pairs) {
      const vbool<W> alone = is(vbool<W>(true), kTriangleGeometry);
      if (any(alone & is_triangle)) first = first + select(alone, base(scene, &Group::paired_count), vint<W>(0));
    }
    if (scene.has_cutouts) {
      const vbool<W> cutout = is(vbool<W>(true), kCutoutGeometry);
      first = first + select(cutout, base(scene, &Group::triangle_count), vint<W>(0));
    }
    if (scene.motion.any_points) {
      const vint<W> still = base(scene, &Group::still_count), zero(0);
      first = first + select(is(is_triangle, kMovingGeometry), still, zero);
      const vbool<W> cutout = is(is_triangle, kMovingCutoutGeometry);
      if (any(cutout)) first = first + select(cutout, still + base(scene, &Group::moving_count), zero);
    }
    return select(is_triangle, first + h.prim, vint<W>(0));
  }
};

}  // namespace primray
