// Surface interaction: point, normals, surface and colour at W hits, in world space.
//
// Points are computed from barycentrics, since o + t d is less precise, except where triangles or spheres are so large that it
// is far more precise (kNearer). `offset` bounds both this rounding and Embree's, so that a ray that starts that far off the
// surface does not hit it again.
#pragma once

#include "surface/surface_point.hpp"

namespace primray {

template <int W>
struct Interaction {
  vvec3<W> p, ng, ns;  // ng outwards as authored, ns on the same side
  vfloat<W> offset;
  vfloat<W> least_cosine;  // below this cosine the side of the surface that a ray comes from is uncertain
  vbool<W> at_edge;        // on a triangle's edge, within rounding: it may have been missed, and a neighbour behind it hit
  vint<W> surface;
  vint<W> mesh, triangle,
      curved;       // valid if the hit is one: row of the MeshTable and triangle of the scene, or row of the CurvedTable
  vint<W> link;     // row of the lights' LinkTable, 0 if there is none
  vvec3<W> color;   // factor of the diffuse albedo
  vbool<W> smooth;  // ns is interpolated from normals
  // Tubes: `tangent` is the unit tangent dP/du in these lanes, in the direction of the curve's parameter; along ng on the discs
  // at its ends. It is set if any lane is on a curve.
  vbool<W> on_curve{false};
  vvec3<W> tangent;
  vfloat<W> radius;  // radius of a tube, 0 where it is not round, and on its ends; set if any lane is on a curve
};

// Ray offset in multiples of 2^-24 times the largest coordinate involved. Barycentric interpolation, the instance's transform
// and its inverse in Embree each round a few times; 16 is a choice with room for that, neither derived nor minimal.
constexpr float kOffsetUlps = 16 * 0x1p-24f;
// Lower limit of the rounding bound: in a coordinate plane through the origin nothing is rounded, but a ray that starts in a
// triangle's plane hits it at distance 0.
constexpr float kLeastReach = 0x1p-32f;
// Rounding of a normal's direction: some ulps, times |e1| |e2| / |e1 x e2| for thin triangles; for even thinner ones light may
// leak, rather than slivers be black.
constexpr float kNormalUlps = 4 * 0x1p-24f, kThinnest = 64;
// Width of a triangle's edge zone: Embree accepts hits outside a triangle by 2^-23 of it, and more where its signs are rounded.
// With 2^-22, 1 of 2e7 rays at closed boxes still came in past a silhouette; with this value none of 1e8.
constexpr float kEdge = 0x1p-19f;

// Tubes whose axes differ in length by a smaller share count as round.
constexpr float kRoundTube = 1e-3f;

// Rows of normals or colours at the three corners of triangles.
template <int W>
PRIMRAY_INLINE void gather_corners(const Scene& scene, vbool<W> lanes, vint<W> mesh, vint<W> triangle, const vint<W> corner[3],
                                   const float* data, vint<W> kind, vint<W> base, vvec3<W> value[3]) {
  const MeshTable& t = scene.meshes;
  // Vertex values are indexed within the mesh's vertices, triangle and corner values within its triangles.
  const vint<W> local_triangle = triangle - gather<W>(t.triangle_base.data(), mesh),
                first_vertex = gather<W>(t.vertex_base.data(), mesh);
  const vbool<W> by_vertex = kind == vint<W>(int(Attribute::kVertex)), by_corner = kind == vint<W>(int(Attribute::kCorner));
  for (int k = 0; k < 3; ++k) {
    const vint<W> i = select(by_vertex, corner[k] - first_vertex,
                             select(by_corner, local_triangle * vint<W>(3) + vint<W>(k), local_triangle));
    value[k] = gather_vec3<W>(data, select(lanes, base + i * vint<W>(3), vint<W>(0)));
  }
}

// Plane of a triangle with edges e1, e2, for repeated queries.
template <int W>
struct TrianglePlane {
  vfloat<W> size, unit;  // largest component of an edge, and its reciprocal
  vvec3<W> n;            // unit
  vfloat<W> per_area;    // 1 / |e1 x e2|, with edges scaled to size 1

  PRIMRAY_INLINE TrianglePlane(vbool<W> m, const vvec3<W>& e1, const vvec3<W>& e2)
      : size(max(max_component(abs(e1)), max_component(abs(e2)))), unit(1.0f / size), n(cross(e1 * unit, e2 * unit)) {
    // Size 1 keeps the product of the edges of small triangles from underflowing; the square of a sliver's may underflow all
    // the same.
    vfloat<W> square = dot(n, n);
    const vbool<W> sliver = square < vfloat<W>(1e-30f);
    if (any(m & sliver)) [[unlikely]] {
      const vfloat<W> height = max_component(abs(n)), up = 1.0f / height;
      const vvec3<W> raised = n * up;
      per_area = 1.0f / sqrt(select(sliver, dot(raised, raised), square));
      n = select(sliver, raised * per_area, n * per_area);
      per_area = select(sliver, per_area * up, per_area);
      return;
    }
    per_area = 1.0f / sqrt(square);
    n = n * per_area;
  }

  // Height above its plane by which rounding can move a point of the triangle, in multiples of 2^-24 as above: the point's own
  // coordinates are rounded, of which only the part along the normal counts, and Embree computes the edges from corners that it
  // rounded relative to the ray's origin, which tilts the plane about the point. An axis-aligned ground plane of 1e6 units thus
  // has the offset of its height alone, and objects on it keep their contact shadows.
  PRIMRAY_INLINE vfloat<W> reach(const vvec3<W>& p0, const vvec3<W>& e1, const vvec3<W>& e2) const {
    const vvec3<W> extent = abs(e1) + abs(e2), e = extent * unit;
    const vfloat<W> turned = e.x * e.y * e.z * per_area * size;
    return dot(abs(n), abs(p0) + extent) + 2.0f * turned;
  }
  // |e1| |e2| / |e1 x e2|.
  PRIMRAY_INLINE vfloat<W> thinness(const vvec3<W>& e1, const vvec3<W>& e2) const {
    const vvec3<W> a = e1 * unit, b = e2 * unit;
    return sqrt(dot(a, a) * dot(b, b)) * per_area;
  }
};

// Normals at the three corners of triangles, some of which move, at the rays' times; `kind` and `base`: of the mesh's normals.
template <int W>
PRIMRAY_RARE void gather_moving_normals(const Scene& scene, vbool<W> lanes, vint<W> mesh, vint<W> triangle,
                                        const vint<W> corner[3], vint<W> kind, vint<W> base, const VertexMotion<W>& motion,
                                        vvec3<W> value[3]) {
  const vint<W> stride = select(motion.moves, gather<W>(scene.meshes.normal_stride.data(), mesh), vint<W>(0));
  vvec3<W> step[2][3];
  for (int k = 0; k < 2; ++k)
    gather_corners(scene, lanes, mesh, triangle, corner, scene.normals.data(), kind,
                   base + (motion.segment + vint<W>(k)) * stride, step[k]);
  for (int c = 0; c < 3; ++c) value[c] = motion.between([&](int k) { return step[k][c]; });
}
template <int W>
PRIMRAY_INLINE void gather_normals(const Scene& scene, vbool<W> lanes, vint<W> mesh, vint<W> triangle, const vint<W> corner[3],
                                   vint<W> kind, const VertexMotion<W>& motion, vvec3<W> value[3]) {
  const vint<W> base = gather<W>(scene.meshes.normal_base.data(), mesh);
  if (motion.any) return gather_moving_normals(scene, lanes, mesh, triangle, corner, kind, base, motion, value);
  gather_corners(scene, lanes, mesh, triangle, corner, scene.normals.data(), kind, base, value);
}

template <int W>
PRIMRAY_INLINE void add_attributes(const Scene& scene, vbool<W> m, vint<W> mesh, vint<W> triangle, const vint<W> corner[3],
                                   const Hits<W>& h, const VertexMotion<W>& motion, vvec3<W>& normal, vbool<W>& has_normal,
                                   vvec3<W>& color) {
  const MeshTable& t = scene.meshes;
  const vfloat<W> b0 = 1.0f - h.u - h.v;
  const auto interpolate = [&](const vvec3<W>(&value)[3]) { return value[0] * b0 + value[1] * h.u + value[2] * h.v; };
  vvec3<W> value[3];
  const vint<W> zero(0);
  const vint<W> normal_kind = gather<W>(t.normals.data(), mesh), color_kind = gather<W>(t.colors.data(), mesh);
  has_normal = m & (normal_kind != zero);
  if (any(has_normal)) {
    gather_normals(scene, has_normal, mesh, triangle, corner, normal_kind, motion, value);
    normal = interpolate(value);
  }
  const vbool<W> has_color = m & (color_kind != zero);
  if (any(has_color)) {
    gather_corners(scene, has_color, mesh, triangle, corner, scene.colors.data(), color_kind,
                   gather<W>(t.color_base.data(), mesh), value);
    color = select(has_color, interpolate(value), color);
  }
}

// Ratio of the ray's coordinates to the shape's below which the point is computed from the ray: barycentrics resolve a ground
// plane to 2^-24 of its size, which may be more than the objects on it.
constexpr float kNearer = 0x1p-8f;

template <int W>
PRIMRAY_INLINE Interaction<W> interact(const Scene& scene, vbool<W> active, const Rays<W>& rays, const Hits<W>& h) {
  const vint<W> zero(0);
  Interaction<W> r;
  r.color = vvec3<W>(vfloat<W>(1.0f));
  r.surface = r.mesh = r.triangle = r.curved = r.link = zero;
  const HitGroup<W> in(scene, active, h);
  const vbool<W> instanced = in.instanced;
  const bool any_instanced = in.any_instanced;
  const vbool<W> is_triangle = in.is_triangle(scene, active);
  vvec3<W> e1(vfloat<W>(0.0f)), e2(vfloat<W>(0.0f)), normal(vfloat<W>(0.0f)), p(vfloat<W>(0.0f));
  vvec3<W> p0(vfloat<W>(0.0f));
  vbool<W> smooth(false);
  VertexMotion<W> motion;
  if (any(is_triangle)) {
    const vint<W> triangle = in.triangle(scene, is_triangle, h);
    const vint<W> mesh = gather<W>(scene.triangle_mesh.data(), triangle);
    PRIMRAY_ASSERT(are_rows(mesh, scene.meshes.surface.size()));
    r.surface = gather<W>(scene.meshes.surface.data(), mesh);
    r.mesh = mesh, r.triangle = triangle;
    const vint<W> first = select(is_triangle, in.base(scene, &Group::vertex_base), zero);
    vint<W> corner[3];
    gather_vertices(scene, triangle, first, corner);
    in.note_motion(scene, is_triangle, motion);
    vvec3<W> at[3];
    gather_positions(scene, corner, motion, at);
    p0 = at[0];
    // Lanes on curved shapes have no edges: `reach` below must not see those of another lane's triangle.
    e1 = select(is_triangle, at[1] - p0, e1);
    e2 = select(is_triangle, at[2] - p0, e2);
    p = p0 + e1 * h.u + e2 * h.v;
    if (scene.has_attributes) add_attributes(scene, is_triangle, mesh, triangle, corner, h, motion, normal, smooth, r.color);
    if (scene.lights.links.any()) r.link = gather<W>(scene.meshes.link.data(), mesh);
  }
  const CurvedHit<W> curved(scene, in, active, h);
  if (curved.any_is) {
    r.curved = curved.row;
    r.surface = select(curved.is, gather<W>(scene.curved.surface.data(), curved.row), r.surface);
    if (scene.lights.links.any()) r.link = select(curved.is, gather<W>(scene.curved.link.data(), curved.row), r.link);
    p = select(curved.is, curved.at.p, p);
    r.on_curve = curved.curve.is;
  }
  const TrianglePlane<W> plane(is_triangle, e1, e2);
  vvec3<W> ng = plane.n;
  vfloat<W> reach = max(max_component(abs(p)), plane.size);
  if (curved.any_is) {
    ng = select(curved.is, direction_of(curved.at.normal), ng);
    reach = select(curved.is, max_component(curved.at.spread), reach);
  }
  const vfloat<W> ray_reach = max_component(abs(rays.o) + abs(rays.d) * h.t);
  const vbool<W> from_ray = active & !instanced & (ray_reach < reach * kNearer);
  const bool any_from_ray = any(from_ray);
  if (any_from_ray) {
    p = select(from_ray, rays.o + rays.d * h.t, p);
    reach = select(from_ray & curved.is, ray_reach, reach);
  }
  if (any(is_triangle & !instanced)) {
    const vfloat<W> bound = plane.reach(p0, e1, e2);
    // A triangle so thin that its plane is lost in rounding has no such bound.
    reach = select(is_triangle & (bound < reach), max(bound, plane.size * kLeastReach), reach);
    if (any_from_ray) p = select(from_ray & is_triangle, p - ng * dot(ng, p - p0), p);
    // Between two times the rounding of both counts.
    if (motion.any) reach = select(motion.moves, max(reach, max_component(motion.sizes)), reach);
  }
  r.at_edge = is_triangle & (min(min(h.u, h.v), 1.0f - h.u - h.v) < kEdge);
  r.least_cosine = min(max(plane.thinness(e1, e2), 1.0f), kThinnest) * kNormalUlps;
  r.p = p;
  if (any_instanced) {
    vvec3<W> far;
    const AffineLanes<W> m = in.matrix(scene, far);
    const vvec3<W> q = m.vector(p) + m.o;
    r.p = select(instanced, q, p);
    vvec3<W> inner = abs(p);
    if (curved.any_is) inner = select(curved.is, curved.at.spread, inner);
    const vvec3<W> spread = abs(m.x) * inner.x + abs(m.y) * inner.y + abs(m.z) * inner.z + abs(m.o) + far;
    const vvec3<W> edges = abs(m.vector(e1)) + abs(m.vector(e2));
    reach = select(instanced, max(max_component(spread), max_component(edges)), reach);
    ng = select(instanced, direction_of(m.normal(ng)), ng);
    if (any(smooth)) normal = select(instanced, m.normal(normal), normal);
  }
  if (scene.curves.any && curved.curve.any_is) {
    vvec3<W> far;
    r.tangent = direction_of(select(r.on_curve, curved.along, vvec3<W>(vfloat<W>(1.0f))));
    r.radius = select(r.on_curve, curved.radius, 0.0f);
    if (any_instanced) {
      const AffineLanes<W> m = in.matrix(scene, far);
      const vvec3<W> n = direction_of(curved.at.normal);
      const vfloat<W> wide = length(m.vector(n)), high = length(m.vector(direction_of(cross(n, r.tangent))));
      const vbool<W> round = abs(wide - high) <= wide * kRoundTube;
      r.radius = select(instanced, select(round, r.radius * wide, 0.0f), r.radius);
      r.tangent = select(instanced, direction_of(m.vector(r.tangent)), r.tangent);
    }
  }
  r.offset = reach * kOffsetUlps;
  r.ng = ng;
  r.ns = r.ng;
  if (any(smooth)) {
    const vvec3<W> n = direction_of(normal);
    const vfloat<W> side = dot(n, r.ng);
    smooth &= abs(side) > vfloat<W>(0.0f);
    PRIMRAY_ASSERT(are_unit(smooth & active, n));
    r.ns = select(smooth, n * copysign(vfloat<W>(1.0f), side), r.ns);
  }
  r.smooth = smooth;
  return r;
}

}  // namespace primray
