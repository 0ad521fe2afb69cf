// See grouped_geometry.hpp. Rays change their space in double and are rounded once.
#include "accel/grouped_geometry.hpp"

#include <algorithm>
#include <cmath>

#include "math/matrix.hpp"
#include "ray/grouped_hit.hpp"
#include "scene/scene.hpp"

namespace primray {
namespace {

daffine matrix_of(const GroupedPlacement& g, uint32_t instance) {
  const float* m = g.matrices + size_t(instance) * 12;
  return {{m[0], m[1], m[2]}, {m[3], m[4], m[5]}, {m[6], m[7], m[8]}, {m[9], m[10], m[11]}};
}

void bounds(const rtc::BoundsArguments* args) {
  const GroupedPlacement& g = *static_cast<const GroupedPlacement*>(args->user);
  const daffine m = matrix_of(g, args->prim_id);
  const rtc::Bounds& b = g.bounds;
  const dvec3 lower{b.lower_x, b.lower_y, b.lower_z}, upper{b.upper_x, b.upper_y, b.upper_z};
  const dvec3 center = m.point((lower + upper) * 0.5), half = (upper - lower) * 0.5;
  const double c[] = {center.x, center.y, center.z},
               rows[3][3] = {{m.x.x, m.y.x, m.z.x}, {m.x.y, m.y.y, m.z.y}, {m.x.z, m.y.z, m.z.z}};
  float lo[3], hi[3];
  for (int k = 0; k < 3; ++k) {
    // Arvo 1990, "Transforming Axis-Aligned Bounding Boxes"; a little more for the rounding of rays.
    const double r = std::fabs(rows[k][0]) * half.x + std::fabs(rows[k][1]) * half.y + std::fabs(rows[k][2]) * half.z;
    const double slack = 1e-6 * (r + std::fabs(c[k]));
    lo[k] = float(c[k] - r - slack), hi[k] = float(c[k] + r + slack);
  }
  *args->bounds = {lo[0], lo[1], lo[2], 0, hi[0], hi[1], hi[2], 0};
}

// Ray `i` of `n` in the instance's space; false where that has no finite answer. Embree must see no NaN.
bool moved_ray(const GroupedPlacement& g, uint32_t instance, const float* rays, uint32_t n, uint32_t i, rtc::Ray<1>& r) {
  const daffine m = matrix_of(g, instance);
  const double determinant = m.determinant();
  if (!(std::fabs(determinant) > 0)) return false;
  const daffine a = inverse(m);
  const auto field = [&](int f) { return rays[f * n + i]; };
  const dvec3 o = a.point({field(0), field(1), field(2)}), d = a.vector({field(4), field(5), field(6)});
  r = {{float(o.x)}, {float(o.y)}, {float(o.z)}, {field(3)},    {float(d.x)}, {float(d.y)},
       {float(d.z)}, {field(7)},   {field(8)},   {0xffffffffu}, {0u},         {0u}};
  const float sum = r.org_x[0] * 0 + r.org_y[0] * 0 + r.org_z[0] * 0 + r.dir_x[0] * 0 + r.dir_y[0] * 0 + r.dir_z[0] * 0;
  return sum == 0;
}

void intersect(const rtc::IntersectArguments* args) {
  const GroupedPlacement& g = *static_cast<const GroupedPlacement*>(args->user);
  const uint32_t n = args->n;
  rtc::QueryArguments query;
  query.context = args->context;  // names no instance here, as Embree wants it for the next scene
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
    const uint32_t inner = g.inner_base + r.hit.inst_id[0] - kFirstPlacement;
    ids[5 * n + i] = r.hit.prim_id[0], ids[6 * n + i] = r.hit.geom_id[0] | inner << kGeometryBits;
    ids[7 * n + i] = kGroupedBit | (g.first_instance + args->prim_id), ids[8 * n + i] = r.hit.inst_prim_id[0];
  }
}

void occluded(const rtc::OccludedArguments* args) {
  const GroupedPlacement& g = *static_cast<const GroupedPlacement*>(args->user);
  rtc::QueryArguments query;
  query.context = args->context;
  for (uint32_t i = 0; i < args->n; ++i) {
    rtc::Ray<1> r;
    if (!args->valid[i] || !moved_ray(g, args->prim_id, args->ray, args->n, i, r)) continue;
    embree().rtcOccluded1(g.accel, &r, &query);
    if (r.tfar[0] < 0) args->ray[8 * args->n + i] = r.tfar[0];
  }
}

}  // namespace

GroupedPlacement make_grouped(const float* matrices, uint32_t first_instance, uint32_t count, uint32_t inner_base,
                              rtc::Scene accel) {
  GroupedPlacement g{matrices, first_instance, count, inner_base, accel, {}};
  embree().rtcGetSceneBounds(accel, &g.bounds);
  return g;
}

OwnedGeometry make_grouped_geometry(const GroupedPlacement* record) {
  const rtc::Api& e = embree();
  OwnedGeometry g(e.rtcNewGeometry(embree_device(), rtc::kUser));
  e.rtcSetGeometryUserPrimitiveCount(g.get(), record->count);
  e.rtcSetGeometryUserData(g.get(), const_cast<GroupedPlacement*>(record));
  e.rtcSetGeometryBoundsFunction(g.get(), bounds, nullptr);
  e.rtcSetGeometryIntersectFunction(g.get(), intersect);
  e.rtcSetGeometryOccludedFunction(g.get(), occluded);
  e.rtcCommitGeometry(g.get());
  return g;
}

}  // namespace primray
