// Intersection callbacks of placed_geometry.hpp. Rays are transformed in double and rounded once.
#include "accel/placed_geometry.hpp"

#include <algorithm>
#include <cmath>

#include "accel/moving_bounds.hpp"
#include "accel/user_geometry.hpp"
#include "math/matrix.hpp"
#include "ray/grouped_hit.hpp"
#include "scene/scene.hpp"

namespace primray {
namespace {

daffine matrix_of(const PlacedGroup& g, uint32_t instance, float time) {
  if (g.moving) return g.scene->motion.at(*g.moving, instance, time);
  return affine_from_columns(g.scene->world_from_group.data() + (size_t(g.first_instance) + instance) * 12);
}

void bounds(const rtc::BoundsArguments* args) {
  const PlacedGroup& g = *static_cast<const PlacedGroup*>(args->user);
  if (g.moving) {
    *args->bounds = moving_bounds(g.scene->motion, *g.moving, g.bound_segments, args->prim_id, args->time_step, g.bounds);
    return;
  }
  *args->bounds = bounds_around(matrix_of(g, args->prim_id, 0), g.bounds, 0);
}

// Ray `i` of `n` in the instance's space; false if that has no finite result. Embree must see no NaN.
bool moved_ray(const PlacedGroup& g, uint32_t instance, const float* rays, uint32_t n, uint32_t i, rtc::Ray<1>& r) {
  const auto field = [&](int f) { return rays[f * n + i]; };
  const float time = field(7);
  const daffine m = matrix_of(g, instance, time);
  const double determinant = m.determinant();
  if (!(std::fabs(determinant) > 0)) return false;
  const daffine a = inverse(m);
  const dvec3 o = a.point({field(0), field(1), field(2)}), d = a.vector({field(4), field(5), field(6)});
  const float inner_time = g.warp ? g.warp->even(time) : time;
  r = {{float(o.x)}, {float(o.y)}, {float(o.z)}, {field(3)},    {float(d.x)}, {float(d.y)},
       {float(d.z)}, {inner_time}, {field(8)},   {0xffffffffu}, {0u},         {0u}};
  const float sum = r.org_x[0] * 0 + r.org_y[0] * 0 + r.org_z[0] * 0 + r.dir_x[0] * 0 + r.dir_y[0] * 0 + r.dir_z[0] * 0;
  return sum == 0;
}

// While rays are in an instance that holds shapes, filters and user geometry are passed its number. One that holds instances
// leaves that to these: Embree has room for one.
struct InInstance {
  rtc::RayQueryContext* context;
  InInstance(const PlacedGroup& g, rtc::RayQueryContext* c, uint32_t geometry, uint32_t instance)
      : context(g.grouped ? nullptr : c) {
    if (context) context->inst_id = geometry, context->inst_prim_id = instance;
  }
  ~InInstance() {
    if (context) context->inst_id = context->inst_prim_id = rtc::kInvalidId;
  }
};

void intersect(const rtc::IntersectArguments* args) {
  const PlacedGroup& g = *static_cast<const PlacedGroup*>(args->user);
  const uint32_t n = args->n;
  rtc::QueryArguments query;
  query.context = args->context;
  const InInstance in(g, args->context, args->geom_id, args->prim_id);
  for (uint32_t i = 0; i < n; ++i) {
    rtc::RayHit<1> r;
    if (!args->valid[i] || !moved_ray(g, args->prim_id, args->rayhit, n, i, r.ray)) continue;
    r.hit.geom_id[0] = r.hit.inst_id[0] = r.hit.inst_prim_id[0] = rtc::kInvalidId;
    embree().rtcIntersect1(g.accel, &r, &query);
    if (r.hit.geom_id[0] == rtc::kInvalidId) continue;
    args->rayhit[8 * n + i] = r.ray.tfar[0];
    float* hit = args->rayhit + 12 * n;
    hit[0 * n + i] = r.hit.ng_x[0], hit[1 * n + i] = r.hit.ng_y[0], hit[2 * n + i] = r.hit.ng_z[0];
    hit[3 * n + i] = r.hit.u[0], hit[4 * n + i] = r.hit.v[0];
    uint32_t* ids = reinterpret_cast<uint32_t*>(hit);
    ids[5 * n + i] = r.hit.prim_id[0];
    if (!g.grouped) {
      ids[6 * n + i] = r.hit.geom_id[0], ids[7 * n + i] = args->geom_id, ids[8 * n + i] = args->prim_id;
      continue;
    }
    const uint32_t inner = g.inner_base + r.hit.inst_id[0] - kFirstPlacement;
    ids[6 * n + i] = r.hit.geom_id[0] | inner << kGeometryBits;
    ids[7 * n + i] = kGroupedBit | (g.first_instance + args->prim_id), ids[8 * n + i] = r.hit.inst_prim_id[0];
  }
}

void occluded(const rtc::OccludedArguments* args) {
  const PlacedGroup& g = *static_cast<const PlacedGroup*>(args->user);
  rtc::QueryArguments query;
  query.context = args->context;
  const InInstance in(g, args->context, args->geom_id, args->prim_id);
  for (uint32_t i = 0; i < args->n; ++i) {
    rtc::Ray<1> r;
    if (!args->valid[i] || !moved_ray(g, args->prim_id, args->ray, args->n, i, r)) continue;
    embree().rtcOccluded1(g.accel, &r, &query);
    if (r.tfar[0] < 0) args->ray[8 * args->n + i] = r.tfar[0];
  }
}

// Motion samples of the group, if they are not evenly spaced as Embree's steps are; otherwise null.
const MotionClock* warp_of(const Scene& scene, const Group& group) {
  if (group.clock < 0) return nullptr;
  const MotionClock& clock = scene.motion.clocks[size_t(group.clock)];
  return clock.uniform ? nullptr : &clock;
}

}  // namespace

bool needs_placed_geometry(const Scene& scene, size_t placement) {
  const Group& group = scene.groups[size_t(scene.placement_group[placement])];
  return group.placement_count > 0 || scene.motion.find(scene.placement_instance[placement]) || warp_of(scene, group);
}

PlacedGroup make_placed(const Scene& scene, size_t placement, uint32_t first, uint32_t end) {
  const Group& group = scene.groups[size_t(scene.placement_group[placement])];
  PlacedGroup g{&scene,
                first,
                end - first,
                group.placement_count > 0,
                group.placement_base,
                group.accel.get(),
                {},
                scene.motion.find(int32_t(first)),
                0,
                warp_of(scene, group)};
  if (g.moving) g.bound_segments = bound_segments(scene.motion, *g.moving);
  embree().rtcGetSceneBounds(g.accel, &g.bounds);
  return g;
}

OwnedGeometry make_placed_geometry(const PlacedGroup* record) {
  const uint32_t steps = record->moving ? uint32_t(record->bound_segments) + 1 : 1;
  return make_user_geometry(record, record->count, {bounds, intersect, occluded}, steps);
}

}  // namespace primray
