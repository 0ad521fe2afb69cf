// Where on which shape W hits are, for what varies over shapes: mesh and triangle, its corners and edges, the instance.
#pragma once

#include "ray/rays.hpp"
#include "scene/scene.hpp"

namespace primray {

template <int W>
PRIMRAY_INLINE vvec3<W> gather_vec3(const float* base, vint<W> at) {
  return {gather<W>(base, at), gather<W>(base + 1, at), gather<W>(base + 2, at)};
}

// Rows of three of a table with something after its last, as Scene::positions and ::indices have it.
template <int W>
PRIMRAY_INLINE vvec3<W> gather_position(const Scene& scene, vint<W> vertex) {
  const FourLanes<float, W> p = gather_four<W>(scene.positions.data(), vertex * vint<W>(3));
  return {p.x, p.y, p.z};
}
// The triangle's vertices, of which the group's first is `first`.
template <int W>
PRIMRAY_INLINE void gather_vertices(const Scene& scene, vint<W> triangle, vint<W> first, vint<W> (&corner)[3]) {
  const auto i = gather_four<W>(reinterpret_cast<const int32_t*>(scene.indices.data()), triangle * vint<W>(3));
  corner[0] = first + i.x, corner[1] = first + i.y, corner[2] = first + i.z;
}

template <int W>
struct InstanceLanes {
  vvec3<W> x, y, z, o;
  PRIMRAY_INLINE InstanceLanes(const float* base, vint<W> at) {
    const FourLanes<float, W> a = gather_four<W>(base, at), b = gather_four<W>(base + 4, at), c = gather_four<W>(base + 8, at);
    x = {a.x, a.y, a.z}, y = {a.w, b.x, b.y}, z = {b.z, b.w, c.x}, o = {c.y, c.z, c.w};
  }
  PRIMRAY_INLINE vvec3<W> vector(const vvec3<W>& v) const { return x * v.x + y * v.y + z * v.z; }
  // Puts `outer` after it where `lanes` says, and gives the size of what was rounded on the way.
  PRIMRAY_INLINE vvec3<W> move(vbool<W> lanes, const InstanceLanes& outer) {
    const vvec3<W> spread = abs(outer.x * o.x) + abs(outer.y * o.y) + abs(outer.z * o.z) + abs(outer.o);
    o = select(lanes, outer.vector(o) + outer.o, o);
    x = select(lanes, outer.vector(x), x), y = select(lanes, outer.vector(y), y), z = select(lanes, outer.vector(z), z);
    return select(lanes, spread, vvec3<W>(vfloat<W>(0.0f)));
  }
  // Normals go by the cofactors: the inverse transpose times the determinant, whose sign counts (mirrored instances). The
  // length means nothing: the matrix is brought to size 1, as products of three small columns would vanish.
  PRIMRAY_INLINE vvec3<W> normal(const vvec3<W>& n) const {
    const vfloat<W> unit = 1.0f / max_component(vvec3<W>(max_component(abs(x)), max_component(abs(y)), max_component(abs(z))));
    const vvec3<W> i = x * unit, j = y * unit, k = z * unit, a = cross(j, k), b = cross(k, i), c = cross(i, j);
    return (a * n.x + b * n.y + c * n.z) * copysign(vfloat<W>(1.0f), dot(a, i));
  }
};

// The group that was hit, the geometry in it, and the instance it was hit in; of two levels of instances the inner one, and
// `outer`.
template <int W>
struct HitGroup {
  vbool<W> instanced, grouped;
  bool any_instanced, any_grouped;
  vint<W> geom;                               // as Embree numbers it within the group
  vint<W> placement, group, instance, outer;  // 0 where not instanced

  PRIMRAY_INLINE HitGroup(const Scene& scene, vbool<W> active, const Hits<W>& h)
      : grouped(false), any_grouped(false), geom(h.geom), placement(0), group(0), instance(0), outer(0) {
    instanced = scene.has_instances ? active & (h.inst != vint<W>(-1)) : vbool<W>(false);
    any_instanced = scene.has_instances && any(instanced);
    if (!any_instanced) return;
    const vint<W> zero(0);
    const int32_t first_id = int32_t(kFirstPlacement) - int32_t(scene.groups[0].placement_base);
    placement = select(instanced, h.inst - vint<W>(first_id), zero);
    if (scene.has_grouped) {
      const GroupedHit<W> hit(instanced, h.geom, h.inst);
      grouped = hit.grouped, any_grouped = any(grouped);
      placement = select(grouped, hit.placement, placement);
      geom = select(grouped, hit.geom, geom);
      outer = select(grouped, hit.outer, zero);
    }
    group = select(instanced, gather<W>(scene.placement_group.data(), placement), zero);
    instance = select(instanced, gather<W>(scene.placement_instance.data(), placement) + h.inst_prim, zero);
  }
  PRIMRAY_INLINE vbool<W> is(vbool<W> active, uint32_t geometry) const { return active & (geom == vint<W>(int32_t(geometry))); }
  PRIMRAY_INLINE vbool<W> is_triangle(const Scene& scene, vbool<W> active) const {
    vbool<W> found = is(active, kTriangleGeometry);
    if (scene.has_pairs) found |= is(active, kPairGeometry);
    if (scene.has_cutouts) found |= is(active, kCutoutGeometry);
    return found;
  }
  // World from group, of instanced lanes; `rounded`: the size of what was rounded in composing it.
  PRIMRAY_INLINE InstanceLanes<W> matrix(const Scene& scene, vvec3<W>& rounded) const {
    InstanceLanes<W> m(scene.world_from_group.data(), instance * vint<W>(12));
    rounded = vvec3<W>(vfloat<W>(0.0f));
    if (any_grouped) rounded = m.move(grouped, InstanceLanes<W>(scene.world_from_group.data(), outer * vint<W>(12)));
    return m;
  }
  PRIMRAY_INLINE vint<W> base(const Scene& scene, uint32_t Group::* member) const {
    if (!any_instanced) return vint<W>(int32_t(scene.groups[0].*member));
    vint<W> b;
    for (int i = 0; i < W; ++i) b.set(i, int32_t(scene.groups[group[i]].*member));
    return b;
  }
  // Triangles that were hit, counted over the scene; 0 in other lanes.
  PRIMRAY_INLINE vint<W> triangle(const Scene& scene, vbool<W> is_triangle, const Hits<W>& h) const {
    vint<W> first = base(scene, &Group::triangle_base);
    if (scene.has_pairs) {
      const vbool<W> alone = is(vbool<W>(true), kTriangleGeometry);
      if (any(alone & is_triangle)) first = first + select(alone, base(scene, &Group::paired_count), vint<W>(0));
    }
    if (scene.has_cutouts) {
      const vbool<W> cutout = is(vbool<W>(true), kCutoutGeometry);
      first = first + select(cutout, base(scene, &Group::triangle_count), vint<W>(0));
    }
    return select(is_triangle, first + h.prim, vint<W>(0));
  }
};

template <int W>
struct SurfacePoint {
  vbool<W> is_triangle, instanced;            // a sphere where it is no triangle
  vint<W> mesh, triangle, corner[3], sphere;  // corner: vertices, counted over the scene
  vint<W> placement, instance_row;            // the row counts within the placement
  vfloat<W> u, v;
  vvec3<W> e1, e2;  // the triangle's edges from its first corner, in world space
  vfloat<W> area2;  // twice its area there

  // A point of a triangle that is known by its number over the scene and its group's first vertex; `place` -1: in no instance.
  // Without edges, and so without tangents and footprint.
  PRIMRAY_INLINE SurfacePoint(const Scene& scene, vbool<W> active, vint<W> number, vint<W> vertex_base, vint<W> place,
                              vint<W> row, vfloat<W> u_, vfloat<W> v_)
      : sphere(0), u(u_), v(v_), e1(vfloat<W>(0.0f)), e2(vfloat<W>(0.0f)), area2(0.0f) {
    const vint<W> zero(0);
    is_triangle = active, triangle = select(active, number, zero);
    mesh = gather<W>(scene.triangle_mesh.data(), triangle);
    instanced = active & (place >= zero);
    placement = select(instanced, place, zero), instance_row = select(instanced, row, zero);
    const vint<W> first = select(active, vertex_base, zero);
    gather_vertices(scene, triangle, first, corner);
  }
  PRIMRAY_INLINE SurfacePoint(const Scene& scene, vbool<W> active, const Hits<W>& h) : sphere(0), u(h.u), v(h.v) {
    const vint<W> zero(0);
    const HitGroup<W> in(scene, active, h);
    instanced = in.instanced, placement = in.placement;
    instance_row = select(in.instanced, h.inst_prim, zero);
    is_triangle = in.is_triangle(scene, active);
    if (scene.has_spheres) {
      const vbool<W> is_sphere = active & !is_triangle;
      sphere = select(is_sphere, in.base(scene, &Group::sphere_base) + h.prim, zero);
    }
    mesh = zero, triangle = zero;
    for (vint<W>& c : corner) c = zero;
    e1 = e2 = vvec3<W>(vfloat<W>(0.0f));
    if (any(is_triangle)) {
      triangle = in.triangle(scene, is_triangle, h);
      mesh = gather<W>(scene.triangle_mesh.data(), triangle);
      const vint<W> first = select(is_triangle, in.base(scene, &Group::vertex_base), zero);
      gather_vertices(scene, triangle, first, corner);
      const vvec3<W> p0 = gather_position(scene, corner[0]);
      e1 = gather_position(scene, corner[1]) - p0, e2 = gather_position(scene, corner[2]) - p0;
      if (in.any_instanced) {
        vvec3<W> rounded;
        const InstanceLanes<W> m = in.matrix(scene, rounded);
        e1 = select(instanced, m.vector(e1), e1), e2 = select(instanced, m.vector(e2), e2);
      }
    }
    const vfloat<W> size = max(max(max_component(abs(e1)), max_component(abs(e2))), 1e-18f);
    area2 = length(cross(e1 * (1.0f / size), e2 * (1.0f / size))) * size * size;
  }
};

}  // namespace primray
