// Embree geometry of tubes and their ends. Ends are intersected in double, a ray at a time: discs, and wedges of balls between
// the last discs of two segments. A hit carries its position on the disc or ball as Ng, in parts of the radius.
#include "accel/geometry.hpp"

#include <algorithm>
#include <cmath>

namespace primray {
namespace {

struct PlacedEnd {
  CurveEndKind kind;
  dvec3 p, before, after;  // unit directions along the curve, before and after
  double r;
};

// Embree's times are evenly spaced: for a group whose motion samples are not, they are warped before (placed_geometry.cpp).
PlacedEnd place(const TubeEnds& t, uint32_t number, float time) {
  const CurveTable& table = t.scene->curves;
  const Group& group = t.scene->groups[t.group];
  const CurveEnd& end = table.ends[t.first + number];
  int step = 0;
  double within = 0;
  if (t.steps > 1) {
    const double x = double(time) * (t.steps - 1);
    step = std::clamp(int(x), 0, t.steps - 2), within = x - step;
  }
  const auto at = [&](uint32_t point) {
    const float* a = &table.points[4 * (size_t(group.curves.point_base) + point + size_t(step) * group.curves.moving_points)];
    const float* b = t.steps > 1 ? a + 4 * size_t(group.curves.moving_points) : a;
    std::array<double, 4> r;
    for (int k = 0; k < 4; ++k) r[k] = a[k] + (double(b[k]) - a[k]) * within;
    return r;
  };
  auto p = at(end.at);
  if (end.kind == CurveEndKind::kJoint) {  // where the segment begins without continuing the one before
    const double t = kBeyond, s = 1 - t;
    const auto a = at(end.at + 1), b = at(end.at + 2), c = at(end.at + 3);
    for (int k = 0; k < 4; ++k) p[k] = p[k] * s * s * s + 3 * t * s * (a[k] * s + b[k] * t) + c[k] * t * t * t;
  }
  const auto way = [&](uint32_t from, uint32_t to) {
    if (from == to) return dvec3(0.0);
    const auto a = at(from), b = at(to);
    const dvec3 d{b[0] - a[0], b[1] - a[1], b[2] - a[2]};
    const double size = length(d);
    return size > 0 ? d * (1 / size) : dvec3(0.0);
  };
  return {end.kind, {p[0], p[1], p[2]}, way(end.before, end.at), way(end.at, end.after), std::max(p[3], 0.0)};
}

dvec3 outwards(const PlacedEnd& e) { return e.kind == CurveEndKind::kStart ? e.after * -1.0 : e.before; }

// Extent along an axis, from its centre.
void extent(const PlacedEnd& e, bool tight, double (&low)[3], double (&high)[3]) {
  const auto part = [](const dvec3& v, int k) { return k == 0 ? v.x : k == 1 ? v.y : v.z; };
  for (int k = 0; k < 3; ++k) low[k] = -e.r, high[k] = e.r;
  if (!tight) return;
  if (e.kind != CurveEndKind::kJoint) {
    const dvec3 n = outwards(e);
    for (int k = 0; k < 3; ++k) high[k] = e.r * std::sqrt(std::max(0.0, 1 - part(n, k) * part(n, k))), low[k] = -high[k];
    return;
  }
  // The wedge is on the outer side of the bend, and its thickness follows from the angle.
  const dvec3 out = e.before - e.after, along = e.before + e.after;
  const double o = length(out), a = length(along);
  if (!(o > 1e-9 && a > 1e-9)) return;
  const dvec3 b = out * (1 / o), m = along * (1 / a), side = cross(b, m);
  const double thick = e.r * std::min(1.0, o / 2);  // |before - after| = 2 sin(angle / 2)
  for (int k = 0; k < 3; ++k) {
    const double more = std::fabs(part(m, k)) * thick + std::fabs(part(side, k)) * e.r;
    low[k] = std::min(0.0, part(b, k) * e.r) - more, high[k] = std::max(0.0, part(b, k) * e.r) + more;
  }
}

void bounds(const rtc::BoundsArguments* args) {
  const TubeEnds& t = *static_cast<const TubeEnds*>(args->user);
  const bool moves = t.steps > 1;
  const PlacedEnd e = place(t, args->prim_id, moves ? float(args->time_step) / float(t.steps - 1) : 0.0f);
  double low[3], high[3];
  extent(e, !moves, low, high);
  const double c[3] = {e.p.x, e.p.y, e.p.z};
  float lo[3], hi[3];
  for (int k = 0; k < 3; ++k) {
    const double slack = 1e-6 * (e.r + std::fabs(c[k]));
    lo[k] = float(c[k] + low[k] - slack), hi[k] = float(c[k] + high[k] + slack);
  }
  *args->bounds = {lo[0], lo[1], lo[2], 0, hi[0], hi[1], hi[2], 0};
}

struct EndHit {
  double t;
  dvec3 offset;  // from the centre, in parts of the radius
  bool leaves;   // the ray comes from within the tube
};

bool intersect_disc(const PlacedEnd& e, const dvec3& o, const dvec3& d, double tnear, double tfar, EndHit& hit) {
  const dvec3 n = outwards(e);
  const double cosine = dot(d, n);
  if (cosine == 0) return false;
  const double t = dot(e.p - o, n) / cosine;
  if (!(t > tnear && t < tfar)) return false;
  dvec3 h = o + d * t - e.p;
  h = h - n * dot(h, n);
  if (!(dot(h, h) <= e.r * e.r)) return false;
  hit = {t, h * (1 / e.r), cosine > 0};
  return true;
}

bool intersect_wedge(const PlacedEnd& e, const dvec3& o, const dvec3& d, double tnear, double tfar, EndHit& hit) {
  const double dd = dot(d, d), middle = dot(e.p - o, d) / dd;
  const dvec3 closest = o + d * middle - e.p;
  const double left = e.r * e.r - dot(closest, closest);
  if (!(left >= 0)) return false;
  const double half = std::sqrt(left / dd);
  for (const double t : {middle - half, middle + half}) {
    if (!(t > tnear && t < tfar)) continue;
    const dvec3 h = o + d * t - e.p;
    if (dot(h, e.before) < 0 || dot(h, e.after) > 0) continue;
    hit = {t, h * (1 / std::sqrt(dot(h, h))), t > middle};
    return true;
  }
  return false;
}

bool intersect_end(const TubeEnds& ends, uint32_t number, const float* ray, uint32_t n, uint32_t i, EndHit& hit) {
  const auto field = [&](int f) { return double(ray[f * n + i]); };
  const PlacedEnd e = place(ends, number, ray[7 * n + i]);
  if (!(e.r > 0)) return false;
  const dvec3 o{field(0), field(1), field(2)}, d{field(4), field(5), field(6)};
  return (e.kind == CurveEndKind::kJoint ? intersect_wedge : intersect_disc)(e, o, d, field(3), field(8), hit);
}

bool is_gone(const TubeEnds& ends, uint32_t number, const rtc::RayQueryContext& context) {
  return ends.scene->has_cutouts && is_end_hole(*ends.scene, int32_t(ends.first + number), context);
}

void intersect(const rtc::IntersectArguments* args) {
  const TubeEnds& ends = *static_cast<const TubeEnds*>(args->user);
  const uint32_t n = args->n;
  for (uint32_t i = 0; i < n; ++i) {
    float* ray = args->rayhit;
    EndHit found;
    if (!args->valid[i] || !intersect_end(ends, args->prim_id, ray, n, i, found) ||
        is_gone(ends, args->prim_id, *args->context))
      continue;
    ray[8 * n + i] = float(found.t);
    float* hit = ray + 12 * n;
    hit[0 * n + i] = float(found.offset.x), hit[1 * n + i] = float(found.offset.y), hit[2 * n + i] = float(found.offset.z);
    hit[3 * n + i] = hit[4 * n + i] = 0;
    uint32_t* ids = reinterpret_cast<uint32_t*>(hit);
    ids[5 * n + i] = args->prim_id, ids[6 * n + i] = args->geom_id;
    ids[7 * n + i] = args->context->inst_id, ids[8 * n + i] = args->context->inst_prim_id;
  }
}

void occluded(const rtc::OccludedArguments* args) {
  const TubeEnds& ends = *static_cast<const TubeEnds*>(args->user);
  for (uint32_t i = 0; i < args->n; ++i) {
    EndHit found;
    if (args->valid[i] && intersect_end(ends, args->prim_id, args->ray, args->n, i, found) &&
        !(found.leaves && is_fibre(*ends.scene, size_t(ends.scene->curves.ends[ends.first + args->prim_id].segment))) &&
        !is_gone(ends, args->prim_id, *args->context))
      args->ray[8 * args->n + i] = -INFINITY;
  }
}

}  // namespace

OwnedGeometry make_tubes(const Scene& scene, const Group& group, const CurveRange& range, int steps) {
  const rtc::Api& e = embree();
  const CurveTable& table = scene.curves;
  const CurveGroup& curves = group.curves;
  OwnedGeometry g(e.rtcNewGeometry(embree_device(), rtc::kRoundBezierCurve));
  if (steps > 1) e.rtcSetGeometryTimeStepCount(g.get(), uint32_t(steps));
  for (int k = 0; k < steps; ++k)
    e.rtcSetSharedGeometryBuffer(g.get(), rtc::kVertexBuffer, uint32_t(k), rtc::kFloat4, table.points.data(),
                                 (size_t(curves.point_base) + size_t(k) * curves.moving_points) * 16, 16, curves.point_count);
  e.rtcSetSharedGeometryBuffer(g.get(), rtc::kIndexBuffer, 0, rtc::kUint, table.first_point.data(), size_t(range.segment) * 4,
                               4, range.segments);
  return g;
}

OwnedGeometry make_tube_ends(const TubeEnds* record) {
  return make_user_geometry(record, record->count, {bounds, intersect, occluded}, uint32_t(record->steps));
}

}  // namespace primray
