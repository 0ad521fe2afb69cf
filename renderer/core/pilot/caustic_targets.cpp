// Collection of caustic targets.
#include "pilot/caustic_targets.hpp"

#include <algorithm>
#include <cmath>

#include "build/inputs/input_facts.hpp"
#include "math/box.hpp"

namespace primray {
namespace {

constexpr size_t kMostTargets = 4096;

bool casts(const float* row) {
  if (!(int(row[kFlags]) & kPreview) || row[kPresence] <= 0) return false;
  const bool clear = !(int(row[kFlags]) & kOpenPbr) || row[kAlpha] < kCasterAlpha;  // UsdPreviewSurface does not blur
                                                                                    // transmission
  const bool passes = row[kTransmission] > 0 && !(int(row[kFlags]) & kThin) && clear;
  const bool reflects = row[kAlpha] < kCasterAlpha && std::max({row[kF0], row[kF0 + 1], row[kF0 + 2]}) > 0.01f;
  return passes || reflects || (row[kClearcoat] > 0 && row[kClearcoatAlpha] < kCasterAlpha);
}

// Adds the boxes of objects that cast caustics in a group: runs of triangles of one mesh, and curved shapes.
void add_boxes(const Scene& scene, const Group& group, const std::vector<uint8_t>& caster, std::vector<Box>& boxes) {
  const size_t end = size_t(group.triangle_base) + group.triangle_count + group.cutout_count;
  int32_t last = -1;
  for (size_t t = group.triangle_base; t < end; ++t) {
    const int32_t mesh = scene.triangle_mesh[t];
    if (!caster[size_t(scene.meshes.surface[size_t(mesh)])]) continue;
    if (mesh != last) boxes.emplace_back();
    last = mesh;
    for (int k = 0; k < 3; ++k) {
      const float* p = &scene.positions[3 * (size_t(group.vertex_base) + scene.indices[3 * t + size_t(k)])];
      boxes.back().add({p[0], p[1], p[2]});
    }
  }
  for_curved_kinds([&]<class K>(K) {
    const CurvedRange& r = group.curved.of<K>();
    for (uint32_t i = 0; i < r.count; ++i)
      if (caster[size_t(scene.curved.surface[r.first_row + i])])
        boxes.push_back(K::box(scene.curved.records<K>()[r.first + i]));
  });
}

CausticTarget ball_about(const Box& b) { return {(b.low + b.high) * 0.5f, 0.5f * length(b.high - b.low)}; }

}  // namespace

std::vector<CausticTarget> caustic_targets(const Scene& scene) {
  std::vector<uint8_t> caster;
  bool any = false;
  for (size_t i = 0; i < scene.surfaces.rows.size() / kSurfaceFields; ++i) {
    float row[kSurfaceFields];
    average_row(scene, int32_t(i), row);
    caster.push_back(casts(row));
    any |= caster.back() != 0;
  }
  std::vector<CausticTarget> targets;
  if (!any) return targets;
  std::vector<Box> boxes;
  add_boxes(scene, scene.groups[0], caster, boxes);
  for (const Box& box : boxes) targets.push_back(ball_about(box));
  // Targets of instances; nested instances are left to chance.
  const Group& world = scene.groups[0];
  for (uint32_t k = world.placement_base; k < world.placement_base + world.placement_count; ++k) {
    const Group& group = scene.groups[size_t(scene.placement_group[k])];
    boxes.clear();
    add_boxes(scene, group, caster, boxes);
    Box all;
    for (const Box& b : boxes) all.add(b);
    if (!all.any()) continue;
    const CausticTarget ball = ball_about(all);
    const size_t first = size_t(scene.placement_instance[k]);
    const size_t end =
        k + 1 < scene.placement_instance.size() ? size_t(scene.placement_instance[k + 1]) : scene.world_from_group.size() / 12;
    for (size_t i = first; i < end && targets.size() < kMostTargets; ++i) {
      const float* m = &scene.world_from_group[12 * i];
      const auto axis = [m](int c) { return vec3{m[3 * c], m[3 * c + 1], m[3 * c + 2]}; };
      const vec3 at = axis(0) * ball.center.x + axis(1) * ball.center.y + axis(2) * ball.center.z + axis(3);
      targets.push_back({at, ball.radius * std::max({length(axis(0)), length(axis(1)), length(axis(2))})});
    }
  }
  return targets;
}

}  // namespace primray
