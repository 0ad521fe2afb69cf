// Where a ray met the scene: point, normals, surface and colour of W hits, in world space.
//
// Points come from barycentrics, never from o + t d; `offset` bounds their rounding and Embree's, so that a ray started that
// far off the surface does not meet it again.
#pragma once

#include "scene/surface_point.hpp"

namespace primray {

template <int W>
struct Interaction {
  vvec3<W> p, ng, ns;  // ng outwards as authored, ns on its side
  vfloat<W> offset;
  vfloat<W> edge_on;  // below this cosine it cannot be told which side of the surface a ray comes from
  vbool<W> on_edge;   // of a triangle, to rounding: it may have been missed, and its neighbour beyond been met
  vint<W> surface;
  vint<W> mesh, triangle, sphere;  // where the hit is one: row of the MeshTable and triangle of the scene, or sphere
  vvec3<W> color;                  // multiplies the diffuse albedo
  vbool<W> smooth;                 // ns is interpolated from normals
};

// Multiples of 2^-24 times the largest coordinate involved. Barycentric interpolation, the instance's transform and its inverse
// in Embree each round a few times; 16 is a choice with room for that, neither derived nor the smallest that works.
constexpr float kOffsetUlps = 16 * 0x1p-24f;
// Rounding of a normal's direction: some ulps, times |e1| |e2| / |e1 x e2| for thin triangles; beyond that thin, light may
// come through rather than slivers be black.
constexpr float kNormalUlps = 4 * 0x1p-24f, kThinnest = 64;
// Embree takes hits that lie outside a triangle by 2^-23 of it, and more where its signs are rounded: with 2^-22, 1 of 2e7 rays
// at closed boxes still came in past an outline, with this none of 1e8.
constexpr float kEdge = 0x1p-19f;

// Rows of normals or colours at the three corners of triangles.
template <int W>
PRIMRAY_INLINE void gather_corners(const Scene& scene, vbool<W> lanes, vint<W> mesh, vint<W> triangle, const vint<W> corner[3],
                                   const float* data, vint<W> kind, vint<W> base, vvec3<W> value[3]) {
  const MeshTable& t = scene.meshes;
  // Vertex values are counted within the mesh's vertices, triangle and corner values within its triangles.
  const vint<W> local_triangle = triangle - gather<W>(t.triangle_base.data(), mesh),
                first_vertex = gather<W>(t.vertex_base.data(), mesh);
  const vbool<W> by_vertex = kind == vint<W>(int(Attribute::kVertex)), by_corner = kind == vint<W>(int(Attribute::kCorner));
  for (int k = 0; k < 3; ++k) {
    const vint<W> i = select(by_vertex, corner[k] - first_vertex,
                             select(by_corner, local_triangle * vint<W>(3) + vint<W>(k), local_triangle));
    value[k] = gather_vec3<W>(data, select(lanes, base + i * vint<W>(3), vint<W>(0)));
  }
}

template <int W>
PRIMRAY_INLINE void add_attributes(const Scene& scene, vbool<W> m, vint<W> mesh, vint<W> triangle, const vint<W> corner[3],
                                   const Hits<W>& h, vvec3<W>& normal, vbool<W>& has_normal, vvec3<W>& color) {
  const MeshTable& t = scene.meshes;
  const vfloat<W> b0 = 1.0f - h.u - h.v;
  const auto interpolate = [&](const float* data, vint<W> kind, vint<W> base, vbool<W> lanes) {
    vvec3<W> value[3];
    gather_corners(scene, lanes, mesh, triangle, corner, data, kind, base, value);
    return value[0] * b0 + value[1] * h.u + value[2] * h.v;
  };
  const vint<W> zero(0);
  const vint<W> normal_kind = gather<W>(t.normals.data(), mesh), color_kind = gather<W>(t.colors.data(), mesh);
  has_normal = m & (normal_kind != zero);
  if (any(has_normal))
    normal = interpolate(scene.normals.data(), normal_kind, gather<W>(t.normal_base.data(), mesh), has_normal);
  const vbool<W> has_color = m & (color_kind != zero);
  if (any(has_color)) {
    const vvec3<W> c = interpolate(scene.colors.data(), color_kind, gather<W>(t.color_base.data(), mesh), has_color);
    color = select(has_color, c, color);
  }
}

template <int W>
PRIMRAY_INLINE Interaction<W> interact(const Scene& scene, vbool<W> active, const Hits<W>& h) {
  const vint<W> zero(0);
  Interaction<W> r;
  r.color = vvec3<W>(vfloat<W>(1.0f));
  r.surface = r.mesh = r.triangle = r.sphere = zero;
  const HitGroup<W> in(scene, active, h);
  const vbool<W> instanced = in.instanced;
  const bool any_instanced = in.any_instanced;
  const vbool<W> is_triangle = in.is_triangle(scene, active);
  vvec3<W> e1(vfloat<W>(0.0f)), e2(vfloat<W>(0.0f)), normal(vfloat<W>(0.0f)), p(vfloat<W>(0.0f));
  vvec3<W> sphere_normal(vfloat<W>(0.0f));
  vbool<W> smooth(false);
  if (any(is_triangle)) {
    const vint<W> triangle = in.triangle(scene, is_triangle, h);
    const vint<W> mesh = gather<W>(scene.triangle_mesh.data(), triangle);
    r.surface = gather<W>(scene.meshes.surface.data(), mesh);
    r.mesh = mesh, r.triangle = triangle;
    const vint<W> first = select(is_triangle, in.base(scene, &Group::vertex_base), zero);
    vint<W> corner[3];
    for (int k = 0; k < 3; ++k)
      corner[k] = first + gather<W>(reinterpret_cast<const int32_t*>(scene.indices.data()) + k, triangle * vint<W>(3));
    const float* positions = scene.positions.data();
    const vvec3<W> p0 = gather_vec3<W>(positions, corner[0] * vint<W>(3));
    // Lanes that met a sphere have no edges: `reach` below must not see those of another lane's triangle.
    e1 = select(is_triangle, gather_vec3<W>(positions, corner[1] * vint<W>(3)) - p0, e1);
    e2 = select(is_triangle, gather_vec3<W>(positions, corner[2] * vint<W>(3)) - p0, e2);
    p = p0 + e1 * h.u + e2 * h.v;
    if (scene.has_attributes) add_attributes(scene, is_triangle, mesh, triangle, corner, h, normal, smooth, r.color);
  }
  const vbool<W> is_sphere = scene.has_spheres ? in.is(active, kSphereGeometry) : vbool<W>(false);
  const bool any_sphere = scene.has_spheres && any(is_sphere);
  if (any_sphere) {
    const vint<W> sphere = select(is_sphere, in.base(scene, &Group::sphere_base) + h.prim, zero);
    r.sphere = sphere;
    r.surface = select(is_sphere, gather<W>(scene.sphere_surface.data(), sphere), r.surface);
    const InstanceLanes<W> m(scene.spheres[0].group_from_object, sphere * vint<W>(int(sizeof(SphereRecord) / sizeof(float))));
    p = select(is_sphere, m.vector(h.ng) + m.o, p);
    sphere_normal = m.normal(h.ng);
  }
  vvec3<W> ng = cross(e1, e2);
  vfloat<W> reach = max(max_component(abs(p)), max(max_component(abs(e1)), max_component(abs(e2))));
  r.on_edge = is_triangle & (min(min(h.u, h.v), 1.0f - h.u - h.v) < kEdge);
  r.edge_on = min(max(length(e1) * length(e2) / length(ng), 1.0f), kThinnest) * kNormalUlps;
  if (any_sphere) ng = select(is_sphere, sphere_normal, ng);
  r.p = p;
  if (any_instanced) {
    vvec3<W> far;
    const InstanceLanes<W> m = in.matrix(scene, far);
    const vvec3<W> q = m.vector(p) + m.o;
    r.p = select(instanced, q, p);
    const vvec3<W> spread = abs(m.x * p.x) + abs(m.y * p.y) + abs(m.z * p.z) + abs(m.o) + far;
    const vvec3<W> edges = abs(m.vector(e1)) + abs(m.vector(e2));
    reach = select(instanced, max(max_component(spread), max_component(edges)), reach);
    ng = select(instanced, m.normal(ng), ng);
    if (any(smooth)) normal = select(instanced, m.normal(normal), normal);
  }
  r.offset = reach * kOffsetUlps;
  r.ng = normalize(ng);
  r.ns = r.ng;
  if (any(smooth)) {
    const vvec3<W> n = normalize(normal);
    const vfloat<W> side = dot(n, r.ng);
    smooth &= abs(side) > vfloat<W>(0.0f);
    r.ns = select(smooth, n * copysign(vfloat<W>(1.0f), side), r.ns);
  }
  r.smooth = smooth;
  return r;
}

}  // namespace primray
