// Intersection callbacks of instances as user geometry, and bounding boxes of those that move. Rays are transformed in double
// and rounded once.

#include <algorithm>
#include <cmath>

#include "accel/geometry.hpp"
#include "math/matrix.hpp"
#include "ray/ray.hpp"
#include "scene/scene.hpp"

namespace primray {
namespace {

// More segments give tighter boxes, and hierarchies that need more memory.
constexpr int kMostSegments = 32;
constexpr int kMostSteps = 128;          // limit of Embree
constexpr double kTurnPerSegment = 0.4;  // radians

dvec3 corner_of(const rtc::Bounds& b, int k) {
  return {k & 1 ? b.upper_x : b.lower_x, k & 2 ? b.upper_y : b.lower_y, k & 4 ? b.upper_z : b.lower_z};
}

// Upper bound of the distance of a rotating path, on segment `k` of its motion samples, from its chord over a time `h`: |p''|
// h^2 / 8.
double off_chord(const MotionTable& table, const MovingInstances& moving, size_t first, int k, double h, const rtc::Bounds& b) {
  const std::vector<float>& times = table.clocks[size_t(moving.clock)].times;
  const PoseSegment &from = table.turning[first + size_t(k)], &to = table.turning[first + size_t(k) + 1];
  const double dt = double(times[size_t(k) + 1]) - double(times[size_t(k)]), speed = 2 * from.half_angle / dt;
  double reach = 0, stretching = 0;
  for (int c = 0; c < 8; ++c) {
    const dvec3 p = moving.undo_center.point(corner_of(b, c));
    const auto stretched = [&](const PoseSegment& t) { return t.stretch[0] * p.x + t.stretch[1] * p.y + t.stretch[2] * p.z; };
    const dvec3 a = stretched(from), z = stretched(to);
    reach = std::max({reach, length(a), length(z)}), stretching = std::max(stretching, length(z - a) / dt);
  }
  return (speed * speed * reach + 2 * speed * stretching) * h * h / 8;
}

// Upper bound of the distance of the images of the box's corners from the chord between `begin` and `end`.
double deviation(const MotionTable& table, const MovingInstances& moving, uint32_t instance, double begin, double end,
                 const rtc::Bounds& b) {
  const std::vector<float>& times = table.clocks[size_t(moving.clock)].times;
  const size_t first = moving.base + size_t(instance) * times.size();
  const daffine from = table.at(moving, instance, float(begin)), to = table.at(moving, instance, float(end));
  double kinks = 0, curves = 0;
  for (size_t k = 0; k + 1 < times.size(); ++k) {
    const double low = std::max(begin, double(times[k])), high = std::min(end, double(times[k + 1]));
    if (low >= high) continue;
    if (moving.turns) curves = std::max(curves, off_chord(table, moving, first, int(k), high - low, b));
    if (high >= end) continue;
    const daffine at = table.at(moving, instance, times[k + 1]);
    const double t = (high - begin) / (end - begin);
    for (int c = 0; c < 8; ++c) {
      const dvec3 p = corner_of(b, c);
      kinks = std::max(kinks, length(at.point(p) - (from.point(p) * (1 - t) + to.point(p) * t)));
    }
  }
  return kinks + curves;
}

}  // namespace

rtc::Bounds bounds_around(const daffine& m, const rtc::Bounds& b, double more) {
  const dvec3 lower{b.lower_x, b.lower_y, b.lower_z}, upper{b.upper_x, b.upper_y, b.upper_z};
  const dvec3 center = m.point((lower + upper) * 0.5), half = (upper - lower) * 0.5;
  const double c[] = {center.x, center.y, center.z},
               rows[3][3] = {{m.x.x, m.y.x, m.z.x}, {m.x.y, m.y.y, m.z.y}, {m.x.z, m.y.z, m.z.z}};
  float lo[3], hi[3];
  for (int k = 0; k < 3; ++k) {
    // Arvo 1990, "Transforming Axis-Aligned Bounding Boxes".
    const double r = std::fabs(rows[k][0]) * half.x + std::fabs(rows[k][1]) * half.y + std::fabs(rows[k][2]) * half.z + more;
    const double slack = 1e-6 * (r + std::fabs(c[k]));
    lo[k] = float(c[k] - r - slack), hi[k] = float(c[k] + r + slack);
  }
  return {lo[0], lo[1], lo[2], 0, hi[0], hi[1], hi[2], 0};
}

int bound_segments(const MotionTable& table, const MovingInstances& moving) {
  const MotionClock& clock = table.clocks[size_t(moving.clock)];
  if (!moving.turns)
    return clock.uniform ? std::min(clock.segments(), kMostSteps) : std::min(2 * clock.segments(), kMostSegments);
  double most = 0;
  for (size_t i = 0; i < size_t(moving.count); ++i) {
    double whole = 0;
    for (size_t k = 0; k + 1 < clock.times.size(); ++k)
      whole += 2 * table.turning[moving.base + i * clock.times.size() + k].half_angle;
    most = std::max(most, whole);
  }
  const int wanted = int(std::ceil(std::min(most / kTurnPerSegment, double(kMostSegments))));
  return std::max(std::min(clock.segments(), kMostSegments), wanted);
}

rtc::Bounds moving_bounds(const MotionTable& table, const MovingInstances& moving, int segments, uint32_t instance,
                          uint32_t step, const rtc::Bounds& b) {
  const double now = double(step) / segments, before = std::max(0.0, double(step) - 1) / segments,
               after = std::min(1.0, (double(step) + 1) / segments);
  double more = 0;
  if (before < now) more = std::max(more, deviation(table, moving, instance, before, now, b));
  if (after > now) more = std::max(more, deviation(table, moving, instance, now, after, b));
  return bounds_around(table.at(moving, instance, float(now)), b, more);
}

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
