// Mesh lights (build/emitters/emitters.hpp), in lanes: samples a triangle by its importance at the point, then a point on it by
// solid angle or area; and the density of that for a given point.
#pragma once

#include "base/flush_denormals.hpp"
#include "light/light.hpp"
#include "light/mesh/moving_emitter.hpp"
#include "light/sampler/selection.hpp"
#include "light/shape/triangle.hpp"
#include "motion/motion_table.hpp"
#include "sampler/sampler.hpp"
#include "scene/scene.hpp"
#include "surface/interaction.hpp"
#include "surface/surface_emission.hpp"

namespace primray {

// Placement of a mesh light and the motion of its vertices, at the times of W rays.
template <int W>
struct MeshPlace {
  AffineLanes<W> world_from_group;
  VertexMotion<W> vertices;

  // For lanes `m`, whose light is `row` and whose index in the EmitterTable is `shape`.
  PRIMRAY_INLINE MeshPlace(const Scene& scene, vbool<W> m, const LightRow<W>& row, vint<W> shape, vfloat<W> time) {
    AffineLanes<W>& to = world_from_group;
    to.x = row.vector(kAxisX), to.y = row.vector(kAxisY), to.z = row.vector(kAxisZ), to.o = row.vector(kOrigin);
    if (scene.motion.any_instances) {
      const vint<W> placement = row.integer(kMeshPlacement) - vint<W>(1), zero(0);
      const vbool<W> placed = m & (placement >= zero);
      const vint<W> first = gather<W>(scene.placement_instance.data(), select(placed, placement, zero));
      if (any(placed)) move_instances(scene.motion, placed, first + row.integer(kMeshInstance), time, to);
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

// Mesh light that is a rectangle of two triangles (build/emitters/emitters.hpp), in lanes: sampled as in
// light/types/rect.hpp, from both of its sides, without a choice among triangles.
template <int W>
struct MeshRectangle {
  vvec3<W> center, half_x, half_y, x, y, z;  // x, y, z: unit
  vfloat<W> hx, hy;

  PRIMRAY_INLINE explicit MeshRectangle(const LightRow<W>& row)
      : center(row.vector(kMeshCenter)), half_x(row.vector(kMeshHalfX)), half_y(row.vector(kMeshHalfY)) {
    hx = length(half_x), hy = length(half_y);
    x = half_x * (1.0f / hx), y = half_y * (1.0f / hy), z = cross(x, y);
  }
  // p in the frame of light/types/rect.hpp: in front.
  PRIMRAY_INLINE vvec3<W> local(const vvec3<W>& p) const {
    const vvec3<W> to = p - center;
    return {dot(to, x), dot(to, y), -abs(dot(to, z))};
  }
  // Density per solid angle of the point that a ray along unit d hit `distance` away from p.
  PRIMRAY_INLINE vfloat<W> pdf(const vvec3<W>& p, const vvec3<W>& d, vfloat<W> distance) const {
    const vvec3<W> at = local(p);
    const vvec3<W> to{dot(d, x) * distance, dot(d, y) * distance, -at.z};
    const vfloat<W> r = rect_pdf(at, hx, hy, to);
    return select(at.z < vfloat<W>(0.0f), r, vfloat<W>(0.0f));
  }
};

// Sampled point of a rectangle: which of its two triangles, its barycentrics there, and its density per solid angle.
template <int W>
struct RectanglePoint {
  vint<W> triangle;
  vfloat<W> b1, b2, pdf;

  // `corners`: see ShapeHalves::corners.
  PRIMRAY_INLINE RectanglePoint(const MeshRectangle<W>& r, vint<W> corners, const vvec3<W>& p, vfloat<W> u, vfloat<W> v) {
    const vvec3<W> at = r.local(p);
    const LocalSample<W> s = rect_sample(at, r.hx, r.hy, u, v);
    pdf = s.pdf;
    const vfloat<W> one(1.0f), zero(0.0f);
    const vfloat<W> a = clamp(0.5f + 0.5f * (at.x + s.w.x * s.t) / r.hx, 0.0f, 1.0f);
    const vfloat<W> b = clamp(0.5f + 0.5f * (at.y + s.w.y * s.t) / r.hy, 0.0f, 1.0f);
    const vbool<W> second = a + b > one;
    triangle = select(second, vint<W>(1), vint<W>(0));
    // Weights of the triangle's own corner and of the two after it. The second triangle is the first, rotated by half a turn.
    const vfloat<W> next = select(second, one - a, a), last = select(second, one - b, b), own = max(one - next - last, zero);
    const vint<W> third = truncate(to_float(corners) * (1.0f / 3)),
                  corner = select(second, third, corners - third * vint<W>(3));
    const vbool<W> first = corner == vint<W>(0), middle = corner == vint<W>(1);
    b1 = select(first, next, select(middle, own, last));
    b2 = select(first, last, select(middle, next, own));
  }
};

// Triangle of a mesh light in world space; the same code for sampled and hit points gives both the same numbers.
template <int W>
struct EmitterTriangle {
  vvec3<W> p0, e1, e2;
  vfloat<W> reach;  // largest coordinate involved, which bounds rounding errors

  PRIMRAY_INLINE EmitterTriangle(const Scene& scene, const MeshPlace<W>& place, vint<W> vertex_base, vint<W> triangle) {
    const int32_t* indices = reinterpret_cast<const int32_t*>(scene.indices.data());
    vvec3<W> p[3];
    for (int k = 0; k < 3; ++k) {
      const vint<W> corner = vertex_base + gather<W>(indices + k, triangle * vint<W>(3));
      p[k] = place.vertices.any ? gather_moving_position(scene, corner, place.vertices)
                                : gather_vec3<W>(scene.positions.data(), corner * vint<W>(3));
    }
    e1 = place.to_world(p[1] - p[0]), e2 = place.to_world(p[2] - p[0]);
    const vvec3<W> o = place.world_from_group.o;
    p0 = place.to_world(p[0]) + o;
    reach = max(max_component(abs(p0)), max_component(abs(o))) + max_component(abs(e1)) + max_component(abs(e2));
  }
};

// Density per solid angle, from `distance` away, of a point chosen uniformly on a triangle.
template <int W>
PRIMRAY_INLINE vfloat<W> area_to_solid_angle(const vvec3<W>& doubled_area, const vvec3<W>& wi, vfloat<W> distance) {
  // 1 / area * d^2 / |cos|, where |n| cos = 2 area cos.
  return 2.0f * distance * distance / max(abs(dot(doubled_area, wi)), kLeastNormal);
}

// The shading point with normal `n` in the space of the group of the shape whose light is `row`, where its triangles are
// weighed. A degenerate placement has no such space; triangles are then weighed as from afar.
template <int W>
struct PlaceBeforeMesh {
  vvec3<W> p, n;

  PRIMRAY_INLINE PlaceBeforeMesh(const AffineLanes<W>& world_from_group, const vvec3<W>& at, const vvec3<W>& normal) {
    const vvec3<W> x = world_from_group.x, y = world_from_group.y, z = world_from_group.z, to = at - world_from_group.o;
    const vvec3<W> yz = cross(y, z);
    const vfloat<W> inverse = 1.0f / dot(x, yz), far(1e9f), none(0.0f);
    p = vvec3<W>(dot(yz, to), dot(cross(z, x), to), dot(cross(x, y), to)) * inverse;
    const vfloat<W> size = max_component(abs(p));
    const vbool<W> is_finite = size < far;  // false if not a number
    p = select(is_finite, p, vvec3<W>(far));
    const vvec3<W> local(dot(x, normal), dot(y, normal), dot(z, normal));
    const vfloat<W> length2 = dot(local, local);
    const vbool<W> known = is_finite & (length2 > none) & (length2 < vfloat<W>(kInfinity));
    n = select(known, local * (1.0f / sqrt(select(known, length2, vfloat<W>(1.0f)))), vvec3<W>(none));
  }
};

// Returns the last i in [0, count) with cdf[base + i] <= u.
template <int W>
PRIMRAY_INLINE vint<W> find_triangle(const EmitterTable& table, vint<W> base, vint<W> count, vint<W> u, int largest) {
  vint<W> lo(0);
  for (int step = 1 << (31 - __builtin_clz(unsigned(largest))); step > 0; step >>= 1) {
    const vint<W> mid = lo + vint<W>(step);
    const vbool<W> inside = mid < count;
    const vint<W> c = gather<W>(table.cdf.data(), base + select(inside, mid, vint<W>(0)));
    lo = select(inside & (c <= u), mid, lo);
  }
  return lo;
}

// Run of adjacent triangles in each lane: its index, its first triangle, and how many there are.
template <int W>
struct TriangleRun {
  vint<W> run, first, count, cdf;
  vbool<W> several;

  // `number`: of a run, or, if `of_triangles`, of one of its triangles.
  TriangleRun(const EmitterTable& table, vbool<W> m, vint<W> shape, vint<W> number, bool of_triangles)
      : run(number), first(number), count(1), cdf(0), several(false) {
    const vint<W> shift = gather<W>(table.run_shift.data(), shape);
    several = m & (shift > vint<W>(0));
    if (!any(several)) return;
    cdf = gather<W>(table.cdf_base.data(), shape);
    const vint<W> all = gather<W>(table.count.data(), shape);
    for (uint32_t left = bits(several); left; left &= left - 1) {
      const int i = __builtin_ctz(left), own = of_triangles ? number[i] >> shift[i] : number[i], begin = own << shift[i];
      run.set(i, own), first.set(i, begin), count.set(i, std::min(1 << shift[i], all[i] - begin));
    }
  }
  vint<W> below(const EmitterTable& table) const {
    return gather<W>(table.cdf.data(), select(several, cdf + first, vint<W>(0)));
  }
  vint<W> width(const EmitterTable& table) const {
    return gather<W>(table.cdf.data(), select(several, cdf + first + count, vint<W>(0))) - below(table);
  }
  // Probability of a triangle within its run.
  PRIMRAY_RARE vfloat<W> probability(const EmitterTable& table, vint<W> triangle) const {
    const vint<W> at = select(several, cdf + triangle, vint<W>(0));
    const vint<W> own = gather<W>(table.cdf.data() + 1, at) - gather<W>(table.cdf.data(), at);
    return select(several, to_float(own) / max(to_float(width(table)), 1.0f), vfloat<W>(1.0f));
  }
};

// Chooses a triangle of each lane's `shape` by 32 random bits; returns its index in the shape, and its probability.
template <int W>
PRIMRAY_RARE vint<W> choose_triangle(const EmitterTable& table, vbool<W> m, vint<W> shape, const PlaceBeforeMesh<W>& from,
                                     vuint<W> number, vfloat<W>& probability) {
  vint<W> triangle;
  choose_in_tree(table.by_place, gather<W>(table.root.data(), shape), m, from.p, from.n, number, triangle, probability);
  const TriangleRun<W> run(table, m, shape, triangle, false);
  if (!any(run.several)) return triangle;
  // Use other bits, since these have led to the run.
  const vfloat<W> wanted = unit_float(mix(number)) * to_float(run.width(table));
  int largest = 1;
  for (uint32_t left = bits(run.several); left; left &= left - 1) largest = std::max(largest, run.count[__builtin_ctz(left)]);
  const vint<W> base = select(run.several, run.cdf + run.first, vint<W>(0));
  const vint<W> found = run.first + find_triangle<W>(table, base, run.count, run.below(table) + truncate(wanted), largest);
  triangle = select(run.several, found, triangle);
  probability *= run.probability(table, triangle);
  return triangle;
}

// Probability with which that function chooses a given triangle.
template <int W>
PRIMRAY_RARE vfloat<W> probability_of_triangle(const EmitterTable& table, vbool<W> m, vint<W> shape, vint<W> triangle,
                                               const PlaceBeforeMesh<W>& from) {
  const TriangleRun<W> in(table, m, shape, triangle, true);
  const vint<W> place = gather<W>(table.place_base.data(), shape) + in.run;
  vbool<W> chosen = m;
  for (uint32_t left = bits(m); left; left &= left - 1) {
    const int i = __builtin_ctz(left);
    if (table.by_place.tree.places[size_t(place[i])].node < 0) chosen &= lane_numbers<W>() != vint<W>(i);
  }
  const vfloat<W> p = probability_in_tree(table.by_place, table.by_place.tree.places.data(), place, chosen, from.p, from.n);
  return any(in.several) ? p * in.probability(table, triangle) : p;
}

// Sampling of a point of triangle `t` from p: by its solid angle, or by its area where that is as good or safer.
template <int W>
struct SeenTriangle {
  vvec3<W> a;  // from p to its first corner
  vbool<W> near;
  SphericalTriangle<W> sphere;  // valid if some lane of `m` is near

  PRIMRAY_INLINE SeenTriangle(vbool<W> m, const EmitterTriangle<W>& t, const vvec3<W>& p)
      : a(t.p0 - p), near(m & !triangle_is_far(a, t.e1, t.e2)) {
    if (!any(near)) return;
    sphere = SphericalTriangle<W>(a, a + t.e1, a + t.e2);
    near &= sphere.solid_angle > vfloat<W>(kSmallTriangle);
  }
  // Density per solid angle; `by_area`: that of area sampling.
  PRIMRAY_INLINE vfloat<W> pdf(vfloat<W> by_area) const {
    return any(near) ? select(near, 1.0f / sphere.solid_angle, by_area) : by_area;
  }
};

// Returns the lanes of `m` whose mesh is a rectangle.
template <int W>
PRIMRAY_INLINE vbool<W> rectangles_of(const EmitterTable& table, vbool<W> m, const LightRow<W>& row) {
  if (!table.rectangles) return vbool<W>(false);
  return table.others ? m & ((row.flags() & vint<W>(kRectangle)) != vint<W>(0)) : m;
}

// Replaces the samples of lanes `m`, whose `light` is a mesh, seen from p on a surface with normal `n` (0: from all around).
// `number`: 32 random bits.
template <int W>
PRIMRAY_INLINE void sample_mesh(const Scene& scene, vbool<W> m, vint<W> light, const vvec3<W>& p, const vvec3<W>& n,
                                vuint<W> number, vfloat<W> u, vfloat<W> v, vfloat<W> time, LightSample<W>& s) {
  const EmitterTable& table = scene.emitters;
  const LightRow<W> row(scene.lights, select(m, light, vint<W>(light[__builtin_ctz(bits(m))])));
  const vint<W> shape = row.integer(kMeshIndex);
  const vbool<W> whole = rectangles_of(table, m, row), parts = m & !whole;
  vfloat<W> probability(1.0f);
  vint<W> chosen(0);
  const MeshPlace<W> place(scene, m, row, shape, time);
  if (any(parts))
    chosen = choose_triangle(table, parts, shape, PlaceBeforeMesh<W>(place.world_from_group, p, n), number, probability);
  vfloat<W> b1, b2, whole_pdf(0.0f);
  if (any(whole)) {
    const RectanglePoint<W> q(MeshRectangle<W>(row), gather<W>(table.corners.data(), shape), p, u, v);
    chosen = select(whole, q.triangle, chosen), b1 = q.b1, b2 = q.b2, whole_pdf = q.pdf;
  }
  const vint<W> triangle = gather<W>(table.first.data(), shape) + chosen;
  const vint<W> vertex_base = gather<W>(table.vertex_base.data(), shape);
  const EmitterTriangle<W> t(scene, place, vertex_base, triangle);
  const SeenTriangle<W> seen(parts, t, p);
  if (any(parts)) {
    vfloat<W> c1, c2;
    triangle_by_area(u, v, c1, c2);
    b1 = select(whole, b1, c1), b2 = select(whole, b2, c2);
  }
  if (any(seen.near)) {
    vfloat<W> c1, c2;
    triangle_along(seen.sphere.sample(u, v), seen.a, t.e1, t.e2, c1, c2);
    b1 = select(seen.near, c1, b1), b2 = select(seen.near, c2, b2);
  }
  const vvec3<W> doubled_area = cross(t.e1, t.e2), exact = t.p0 + t.e1 * b1 + t.e2 * b2;
  // End the shadow ray a little in front of the triangle on p's side, so that rounding does not block it; but not beyond p,
  // which may be on the triangle itself.
  const vvec3<W> to = exact - p, normal = direction_of(doubled_area);
  const vfloat<W> height = -dot(to, normal);
  const vvec3<W> d = to + normal * copysign(min(t.reach * kOffsetUlps, 0.5f * abs(height)), height);
  const vfloat<W> distance = length(d);
  const vvec3<W> wi = d * (1.0f / distance);
  const vfloat<W> by_area = area_to_solid_angle(doubled_area, wi, distance);
  const vfloat<W> pdf = select(whole, whole_pdf, probability * seen.pdf(by_area));
  const vbool<W> usable = (distance > vfloat<W>(0.0f)) & (pdf < vfloat<W>(kInfinity));
  const bool lights = scene.geometry_lights.any();
  const vbool<W> own = lights ? (row.flags() & vint<W>(kOwnRadiance)) != vint<W>(0) : vbool<W>(false);
  vvec3<W> L = triangle_emission(scene, m, triangle, vertex_base, row.integer(kMeshPlacement) - vint<W>(1),
                                 row.integer(kMeshInstance), b1, b2, own);
  if (lights) L *= row.vector(kEmissionFactor);
  if (scene.lights.has_shaping) L *= emitter_shaping(scene, row, m, light, wi, time);
  s.wi = select(m, wi, s.wi), s.t = select(m, distance, s.t), s.L = select(m, L, s.L);
  s.pdf = select(m, select(usable, pdf, vfloat<W>(0.0f)), s.pdf);
}

// Density with which sampling chooses the point of `triangle`, an index over the scene, at `distance` along unit d.
template <int W>
PRIMRAY_INLINE vfloat<W> mesh_pdf(const Scene& scene, vbool<W> m, const LightRow<W>& row, vint<W> triangle, const vvec3<W>& p,
                                  const vvec3<W>& n, const vvec3<W>& d, vfloat<W> distance, vfloat<W> time) {
  const EmitterTable& table = scene.emitters;
  const vint<W> shape = select(m, row.integer(kMeshIndex), vint<W>(0)), first = gather<W>(table.first.data(), shape);
  triangle = select(m, triangle, first);
  const vbool<W> whole = rectangles_of(table, m, row), parts = m & !whole;
  const vfloat<W> whole_pdf = any(whole) ? MeshRectangle<W>(row).pdf(p, d, distance) : vfloat<W>(0.0f);
  if (!any(parts)) return whole_pdf;
  const MeshPlace<W> place(scene, m, row, shape, time);
  const EmitterTriangle<W> t(scene, place, gather<W>(table.vertex_base.data(), shape), triangle);
  const SeenTriangle<W> seen(parts, t, p);
  const vfloat<W> by_area = area_to_solid_angle(cross(t.e1, t.e2), d, distance);
  const vfloat<W> chosen =
      probability_of_triangle(table, parts, shape, triangle - first, PlaceBeforeMesh<W>(place.world_from_group, p, n));
  return select(whole, whole_pdf, chosen * seen.pdf(by_area));
}

}  // namespace primray
