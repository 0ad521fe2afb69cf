// Intersection of a ray with the unit sphere, in the sphere's space and in double, so that the discriminant of a far or small
// sphere is precise.
#include "scene/curved/sphere.hpp"

#include <cmath>

#include "accel/geometry.hpp"

namespace primray {
namespace {

void bounds(const rtc::BoundsArguments* args) {
  const SphereShape::Record& s = static_cast<const SphereShape::Record*>(args->user)[args->prim_id];
  const float* m = s.group_from_object;
  float lo[3], hi[3];
  for (int k = 0; k < 3; ++k) {
    // The ellipsoid's extent along an axis is the length of that row of its matrix; slightly more for rounding.
    const double r = std::sqrt(double(m[k]) * m[k] + double(m[3 + k]) * m[3 + k] + double(m[6 + k]) * m[6 + k]);
    const double slack = 1e-6 * (r + std::fabs(m[9 + k]));
    lo[k] = float(m[9 + k] - r - slack), hi[k] = float(m[9 + k] + r + slack);
  }
  *args->bounds = {lo[0], lo[1], lo[2], 0, hi[0], hi[1], hi[2], 0};
}

struct Root {
  double t;
  dvec3 p;
};

// Nearest root within (tnear, tfar).
bool nearest_root(const SphereShape::Record& s, const float* ray, uint32_t n, uint32_t i, Root& root) {
  const auto field = [&](int f) { return double(ray[f * n + i]); };
  const dvec3 o{field(0), field(1), field(2)}, d{field(4), field(5), field(6)};
  const daffine a = affine_from_columns(s.object_from_group);
  const dvec3 po = a.point(o), pd = a.vector(d);
  const double dd = dot(pd, pd), b = -dot(po, pd);
  const dvec3 closest = po + pd * (b / dd);
  const double discriminant = dd * (1.0 - dot(closest, closest));
  if (!(discriminant >= 0)) return false;
  const double c = dot(po, po) - 1.0, q = b + std::copysign(std::sqrt(discriminant), b);
  double t0 = q != 0 ? c / q : 0.0, t1 = q / dd;
  if (t0 > t1) std::swap(t0, t1);
  const double tnear = field(3), tfar = field(8);
  double t = t0;
  if (!(t > tnear)) t = t1;
  if (!(t > tnear && t < tfar)) return false;
  const dvec3 p = po + pd * t;
  root = {t, p * (1.0 / std::sqrt(dot(p, p)))};
  return true;
}

void intersect(const rtc::IntersectArguments* args) {
  const SphereShape::Record& s = static_cast<const SphereShape::Record*>(args->user)[args->prim_id];
  const uint32_t n = args->n;
  for (uint32_t i = 0; i < n; ++i) {
    if (!args->valid[i]) continue;
    float* ray = args->rayhit;
    Root root;
    if (!nearest_root(s, ray, n, i, root)) continue;
    ray[8 * n + i] = float(root.t);
    float* hit = ray + 12 * n;
    hit[0 * n + i] = float(root.p.x), hit[1 * n + i] = float(root.p.y), hit[2 * n + i] = float(root.p.z);
    hit[3 * n + i] = hit[4 * n + i] = 0;
    uint32_t* ids = reinterpret_cast<uint32_t*>(hit);
    ids[5 * n + i] = args->prim_id, ids[6 * n + i] = args->geom_id;
    ids[7 * n + i] = args->context->inst_id, ids[8 * n + i] = args->context->inst_prim_id;
  }
}

void occluded(const rtc::OccludedArguments* args) {
  const SphereShape::Record& s = static_cast<const SphereShape::Record*>(args->user)[args->prim_id];
  for (uint32_t i = 0; i < args->n; ++i) {
    Root root;
    if (args->valid[i] && nearest_root(s, args->ray, args->n, i, root)) args->ray[8 * args->n + i] = -INFINITY;
  }
}

}  // namespace

OwnedGeometry SphereShape::geometry(const SphereShape::Record* records, uint32_t count) {
  return make_user_geometry(records, count, {bounds, intersect, occluded});
}

}  // namespace primray
