// Surface point of W hits for varying inputs: mesh and triangle, its corners and edges, and the instance.
#pragma once

#include "math/lane_checks.hpp"
#include "surface/curved_hit.hpp"
#include "surface/hit_group.hpp"

namespace primray {

template <int W>
PRIMRAY_INLINE vvec3<W> gather_vec3(const float* base, vint<W> at) {
  const TwoLanes<float, W> xy = gather_two<W>(base, at), yz = gather_two<W>(base + 1, at);
  return {xy.x, xy.y, yz.y};
}

// Rows of three values of a padded table, such as Scene::positions and ::indices.
template <int W>
PRIMRAY_INLINE vvec3<W> gather_position(const Scene& scene, vint<W> vertex) {
  PRIMRAY_ASSERT(are_rows(vertex, scene.positions.size() / 3));
  const FourLanes<float, W> p = gather_four<W>(scene.positions.data(), vertex * vint<W>(3));
  return {p.x, p.y, p.z};
}
// Vertex position at the step that begins a ray's time segment, or ends it.
template <int W>
PRIMRAY_INLINE vvec3<W> gather_step(const Scene& scene, vint<W> vertex, const VertexMotion<W>& motion, int step) {
  return gather_position(scene, vertex + select(motion.moves, (motion.segment + vint<W>(step)) * motion.stride, vint<W>(0)));
}
// Vertex position at the rays' times, for lanes of which some move.
template <int W>
PRIMRAY_RARE vvec3<W> gather_moving_position(const Scene& scene, vint<W> vertex, const VertexMotion<W>& motion) {
  return motion.between([&](int step) { return gather_step(scene, vertex, motion, step); });
}
// Vertices of a triangle; stores the magnitude of the coordinates between which the first one moves.
template <int W>
PRIMRAY_RARE void gather_moving_positions(const Scene& scene, const vint<W> (&corner)[3], VertexMotion<W>& motion,
                                          vvec3<W> (&p)[3]) {
  for (int i = 0; i < 3; ++i) p[i] = gather_moving_position(scene, corner[i], motion);
  motion.sizes = abs(gather_step(scene, corner[0], motion, 0)) + abs(gather_step(scene, corner[0], motion, 1));
}
template <int W>
PRIMRAY_INLINE void gather_positions(const Scene& scene, const vint<W> (&corner)[3], VertexMotion<W>& motion,
                                     vvec3<W> (&p)[3]) {
  if (motion.any) [[unlikely]]
    return gather_moving_positions(scene, corner, motion, p);
  for (int i = 0; i < 3; ++i) p[i] = gather_position(scene, corner[i]);
}
// Vertices of the triangle; `vertex_base` is its group's first.
template <int W>
PRIMRAY_INLINE void gather_vertices(const Scene& scene, vint<W> triangle, vint<W> first, vint<W> (&corner)[3]) {
  PRIMRAY_ASSERT(are_rows(triangle, scene.triangle_mesh.size()));
  const auto i = gather_four<W>(reinterpret_cast<const int32_t*>(scene.indices.data()), triangle * vint<W>(3));
  corner[0] = first + i.x, corner[1] = first + i.y, corner[2] = first + i.z;
}

template <int W>
struct SurfacePoint {
  vbool<W> is_triangle, instanced;            // a curved shape if not a triangle
  vint<W> mesh, triangle, corner[3], curved;  // corner: vertex indices over the scene; curved: row of the CurvedTable
  vint<W> placement, instance_row;            // the row is counted within the placement
  vfloat<W> u, v;
  vvec3<W> e1, e2;  // the triangle's edges from its first corner, in world space
  vfloat<W> area2;  // twice its area in world space
  VertexMotion<W> motion;
  CurvePlace<W> curve;

  // Point of a triangle given by its index over the scene and its group's first vertex; `place` -1: not instanced. It has no
  // edges, and therefore neither tangents nor footprint.
  PRIMRAY_INLINE SurfacePoint(const Scene& scene, vbool<W> active, vint<W> number, vint<W> vertex_base, vint<W> place,
                              vint<W> row, vfloat<W> u_, vfloat<W> v_)
      : curved(0), u(u_), v(v_), e1(vfloat<W>(0.0f)), e2(vfloat<W>(0.0f)), area2(0.0f) {
    const vint<W> zero(0);
    is_triangle = active, triangle = select(active, number, zero);
    mesh = gather<W>(scene.triangle_mesh.data(), triangle);
    instanced = active & (place >= zero);
    placement = select(instanced, place, zero), instance_row = select(instanced, row, zero);
    const vint<W> first = select(active, vertex_base, zero);
    gather_vertices(scene, triangle, first, corner);
  }
  PRIMRAY_INLINE SurfacePoint(const Scene& scene, vbool<W> active, const Hits<W>& h) : curved(0), u(h.u), v(h.v) {
    const vint<W> zero(0);
    const HitGroup<W> in(scene, active, h);
    instanced = in.instanced, placement = in.placement;
    instance_row = select(in.instanced, h.inst_prim, zero);
    is_triangle = in.is_triangle(scene, active);
    curved = curved_row(scene, in, active, h);
    if (scene.curves.any) {
      curve = CurvePlace<W>(scene, in, active, h);
      curved = select(curve.is, curve.row, curved);
      u = select(curve.is, curve.u, u), v = select(curve.is, vfloat<W>(0.0f), v);
    }
    mesh = zero, triangle = zero;
    for (vint<W>& c : corner) c = zero;
    e1 = e2 = vvec3<W>(vfloat<W>(0.0f));
    if (any(is_triangle)) {
      triangle = in.triangle(scene, is_triangle, h);
      mesh = gather<W>(scene.triangle_mesh.data(), triangle);
      const vint<W> first = select(is_triangle, in.base(scene, &Group::vertex_base), zero);
      gather_vertices(scene, triangle, first, corner);
      in.note_motion(scene, is_triangle, motion);
      vvec3<W> at[3];
      gather_positions(scene, corner, motion, at);
      e1 = at[1] - at[0], e2 = at[2] - at[0];
      if (in.any_instanced) {
        vvec3<W> rounded;
        const AffineLanes<W> m = in.matrix(scene, rounded);
        e1 = select(instanced, m.vector(e1), e1), e2 = select(instanced, m.vector(e2), e2);
      }
    }
    const vfloat<W> size = max(max(max_component(abs(e1)), max_component(abs(e2))), 1e-18f);
    area2 = length(cross(e1 * (1.0f / size), e2 * (1.0f / size))) * size * size;
  }
};

}  // namespace primray
