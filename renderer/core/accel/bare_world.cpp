// Construction of bare_world.hpp.
#include "accel/bare_world.hpp"

#include "accel/geometry.hpp"
#include "base/error.hpp"

namespace primray {
namespace {

void must(bool holds, const char* what) {
  if (!holds) throw Error("internal", std::string("a bare world does not support ") + what);
}

// Attaches `count` triangles of the group from `first` on, with vertices at `steps` times.
void attach_triangles(rtc::Scene target, const Scene& scene, const Group& group, uint32_t first, uint32_t count, int steps) {
  if (count == 0) return;
  const OwnedGeometry g = make_triangles(scene, group, first, count, steps);
  embree().rtcCommitGeometry(g.get());
  embree().rtcAttachGeometryByID(target, g.get(), first == 0 ? 0 : 1);
}

// RTCQuaternionDecomposition: scale, skew, shift, quaternion (real part first), translation.
void put_decomposition(const PoseSegment& t, const daffine& undo, std::vector<float>& to) {
  const dvec3* s = t.stretch;
  const double size = std::fabs(s[0].x) + std::fabs(s[1].y) + std::fabs(s[2].z);
  const double skew = std::fabs(s[1].x) + std::fabs(s[2].x) + std::fabs(s[2].y);
  must(skew < 1e-6 * size && undo.x.x == undo.y.y && undo.x.x == undo.z.z, "rotating instances with non-uniform scale");
  const double u = undo.x.x;
  const Quaternion& q = t.rotation;
  for (const double value : {s[0].x * u, s[1].y * u, s[2].z * u, 0.0, 0.0, 0.0, s[0].x * undo.o.x, s[1].y * undo.o.y,
                             s[2].z * undo.o.z, q.w, q.x, q.y, q.z, t.translation.x, t.translation.y, t.translation.z})
    to.push_back(float(value));
}

}  // namespace

void BareWorld::set_steps(rtc::Geometry geometry, const MotionTable& table, const MovingInstances& moving) {
  const rtc::Api& e = embree();
  const size_t steps = table.clocks[size_t(moving.clock)].times.size(), count = size_t(moving.count);
  e.rtcSetGeometryTimeStepCount(geometry, uint32_t(steps));
  for (size_t k = 0; k < steps; ++k) {
    if (!moving.turns) {
      e.rtcSetSharedGeometryBuffer(geometry, rtc::kTransformBuffer, uint32_t(k), rtc::kFloat3x4ColumnMajor, table.linear.data(),
                                   (moving.base + k) * 48, steps * 48, count);
      continue;
    }
    std::vector<float>& rows = turning_.emplace_back();
    for (size_t i = 0; i < count; ++i) put_decomposition(table.turning[moving.base + i * steps + k], moving.undo_center, rows);
    e.rtcSetSharedGeometryBuffer(geometry, rtc::kTransformBuffer, uint32_t(k), rtc::kQuaternionDecomposition, rows.data(), 0,
                                 64, count);
  }
}

OwnedGeometry BareWorld::instances(const Scene& scene, const Group& group, uint32_t placement) {
  const rtc::Api& e = embree();
  prototypes_.push_back(make(scene, group));
  OwnedGeometry g(e.rtcNewGeometry(embree_device(), rtc::kInstanceArray));
  e.rtcSetGeometryInstancedScene(g.get(), prototypes_.back().get());
  const size_t first = size_t(scene.placement_instance[placement]);
  if (const MovingInstances* moving = scene.motion.find(int32_t(first))) {
    must(scene.motion.clocks[size_t(moving->clock)].uniform, "uneven clocks");
    set_steps(g.get(), scene.motion, *moving);
  } else {
    const bool last = placement + 1 == scene.placement_group.size();
    const size_t end = last ? scene.world_from_group.size() / 12 : size_t(scene.placement_instance[placement + 1]);
    e.rtcSetSharedGeometryBuffer(g.get(), rtc::kTransformBuffer, 0, rtc::kFloat3x4ColumnMajor, scene.world_from_group.data(),
                                 first * 48, 48, end - first);
  }
  e.rtcCommitGeometry(g.get());
  return g;
}

OwnedScene BareWorld::make(const Scene& scene, const Group& group) {
  must(group.cutout_count + group.moving_cutout_count == 0, "cut-outs");
  must(!group.curved.any() && !group.curves.any(), "curved shapes");
  must(group.clock < 0 || scene.motion.clocks[size_t(group.clock)].uniform, "uneven clocks");
  OwnedScene made = new_embree_scene();
  attach_triangles(made.get(), scene, group, 0, group.triangle_count, 1);
  attach_triangles(made.get(), scene, group, group.still_count(), group.moving_count, vertex_steps(scene, group));
  for (uint32_t i = 0; i < group.placement_count; ++i) {
    const uint32_t placement = group.placement_base + i;
    const Group& placed = scene.groups[size_t(scene.placement_group[placement])];
    must(placed.placement_count == 0, "instances of instances");
    embree().rtcAttachGeometryByID(made.get(), instances(scene, placed, placement).get(), kFirstPlacement + i);
  }
  embree().rtcCommitScene(made.get());
  check_embree();
  return made;
}

BareWorld::BareWorld(const Scene& scene) : world_(make(scene, scene.groups[0])) {}

}  // namespace primray
