// Embree scenes over the flat arrays, which are shared, not copied.
#include "accel/build.hpp"

#include "accel/cutout.hpp"
#include "accel/sphere_geometry.hpp"
#include "scene/error.hpp"

namespace primray {
namespace {

void attach(rtc::Scene scene, const OwnedGeometry& g, uint32_t id) { embree().rtcAttachGeometryByID(scene, g.get(), id); }

// `count` of the group's triangles from its `first` on.
OwnedGeometry make_triangles(const Scene& scene, const Group& group, uint32_t first, uint32_t count) {
  const rtc::Api& e = embree();
  OwnedGeometry g(e.rtcNewGeometry(embree_device(), rtc::kTriangle));
  e.rtcSetSharedGeometryBuffer(g.get(), rtc::kVertexBuffer, 0, rtc::kFloat3, scene.positions.data(),
                               size_t(group.vertex_base) * 12, 12, group.vertex_count);
  e.rtcSetSharedGeometryBuffer(g.get(), rtc::kIndexBuffer, 0, rtc::kUint3, scene.indices.data(),
                               (size_t(group.triangle_base) + first) * 12, 12, count);
  return g;
}

OwnedGeometry make_placement(const Scene& scene, size_t placement, size_t count) {
  const rtc::Api& e = embree();
  OwnedGeometry g(e.rtcNewGeometry(embree_device(), rtc::kInstanceArray));
  e.rtcSetGeometryInstancedScene(g.get(), scene.groups[scene.placement_group[placement]].accel.get());
  e.rtcSetSharedGeometryBuffer(g.get(), rtc::kTransformBuffer, 0, rtc::kFloat3x4ColumnMajor, scene.world_from_group.data(),
                               size_t(scene.placement_instance[placement]) * 48, 48, count);
  e.rtcCommitGeometry(g.get());
  return g;
}

OwnedScene new_scene() {
  OwnedScene s(embree().rtcNewScene(embree_device()));
  embree().rtcSetSceneFlags(s.get(), rtc::kRobust);
  embree().rtcSetSceneBuildQuality(s.get(), rtc::kMediumQuality);
  return s;
}

void attach_group(const Scene& scene, const Group& group, rtc::Scene target) {
  if (group.triangle_count > 0) {
    const OwnedGeometry g = make_triangles(scene, group, 0, group.triangle_count);
    embree().rtcCommitGeometry(g.get());
    attach(target, g, kTriangleGeometry);
  }
  if (group.cutout_count > 0) {
    const OwnedGeometry g = make_triangles(scene, group, group.triangle_count, group.cutout_count);
    set_cutout_filter(g.get(), scene);
    embree().rtcCommitGeometry(g.get());
    attach(target, g, kCutoutGeometry);
  }
  if (group.sphere_count > 0)
    attach(target, make_sphere_geometry(&scene.spheres[group.sphere_base], group.sphere_count), kSphereGeometry);
}

}  // namespace

void build_accel(Scene& scene) {
  for (size_t i = scene.groups.size(); i-- > 0;) {
    Group& group = scene.groups[i];
    group.accel = new_scene();
    attach_group(scene, group, group.accel.get());
    if (i == 0) {
      const size_t placements = scene.placement_group.size(), instances = scene.world_from_group.size() / 12;
      for (size_t p = 0; p < placements; ++p) {
        const size_t first = scene.placement_instance[p],
                     end = p + 1 < placements ? size_t(scene.placement_instance[p + 1]) : instances;
        attach(group.accel.get(), make_placement(scene, p, end - first), kFirstPlacement + uint32_t(p));
      }
    }
    embree().rtcCommitScene(group.accel.get());
    check_embree();
  }
}

}  // namespace primray
