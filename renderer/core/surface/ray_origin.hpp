// Origins of scattered rays that the usual offset from the surface does not serve: on smooth-shaded triangles, and behind hair
// fibres.
#pragma once

#include "surface/interaction.hpp"

namespace primray {

// Rays transmitted by hair: the fibre model handles the whole passage at the entry point, so such rays start behind the far
// wall of the tube; otherwise each would first hit that wall from within.

// Squared sine of the angle to a tube below which rays run along it.
constexpr float kAlongTube = 1e-4f;
// Margin behind the far wall, as a share of the distance to it, and in offsets.
constexpr float kPastWall = 1e-3f, kPastOffsets = 16;

// Distance from the near wall of round tubes along `d` to behind the far wall, as if the tubes were straight; 0 in lanes that
// pass through no such tube. Rays that are still inside, in a bend, hit that wall and continue straight.
template <int W>
PRIMRAY_RARE vfloat<W> distance_through_tube(vbool<W> m, const Interaction<W>& it, const vvec3<W>& d) {
  using F = vfloat<W>;
  m &= it.on_curve & (it.radius > F(0.0f));
  const vvec3<W> flat = d - it.tangent * dot(d, it.tangent);
  const F in = -dot(flat, it.ng), across2 = dot(flat, flat);
  m &= (in > F(0.0f)) & (across2 > F(kAlongTube));
  const F way = 2.0f * it.radius * in / max(across2, kAlongTube);
  return select(m, way * (1.0f + kPastWall) + it.offset * kPastOffsets, F(0.0f));
}

// Smooth-shaded triangles: origins of rays that leave below the triangle's plane, but above the smooth surface that its normals
// approximate.
//
// Where light grazes a coarse mesh, triangles behind their own plane would be black although their normals face the light: the
// shadow terminator problem. Such rays start where the tangent planes at the triangle's corners lift the point to: Hanika 2021,
// "Hacking the Shadow Terminator" (Ray Tracing Gems II, chapter 4). On a mesh inscribed in a sphere that is outside the sphere.
// Concave parts are not lifted, and rays below their plane end as those of flat triangles do.

// Points are lifted by at least this many offsets or not at all: nearer to a vertex, rounding decides whether such rays hit the
// adjacent triangles, and from which side. Finer meshes lose nothing visible.
constexpr float kLeastLift = 64;

// Returns which of the rays along `wi` from the hits `m`, all on smooth triangles, may start at their point plus `shift`. `ng`
// is on the side that the path came from.
template <int W>
PRIMRAY_INLINE vbool<W> lift_to_smooth(const Scene& scene, vbool<W> m, const Hits<W>& h, vfloat<W> offset, const vvec3<W>& ng,
                                       const vvec3<W>& wi, vvec3<W>& shift) {
  using F = vfloat<W>;
  const SurfacePoint<W> at(scene, m, h);
  vvec3<W> n[3];
  gather_normals(scene, m, at.mesh, at.triangle, at.corner, gather<W>(scene.meshes.normals.data(), at.mesh), at.motion, n);
  const HitGroup<W> in(scene, m, h);
  if (in.any_instanced) {
    vvec3<W> rounded;
    const AffineLanes<W> world_from_group = in.matrix(scene, rounded);
    for (vvec3<W>& k : n) k = select(in.instanced, world_from_group.normal(k), k);
  }
  const F b[3] = {1.0f - at.u - at.v, at.u, at.v};
  const vvec3<W> from_first = at.e1 * at.u + at.e2 * at.v;
  const vvec3<W> ns = n[0] * b[0] + n[1] * b[1] + n[2] * b[2];
  const F side = copysign(F(1.0f), dot(ns, ng));
  shift = vvec3<W>(F(0.0f));
  const vvec3<W> from[3] = {from_first, from_first - at.e1, from_first - at.e2};
  for (int k = 0; k < 3; ++k) {
    const vvec3<W> unit = normalize(n[k]) * side;
    shift = shift - unit * (min(dot(from[k], unit), 0.0f) * b[k]);
  }
  // Further bending of normals, as by normal maps, does not move the surface.
  return m & at.is_triangle & (dot(ns, wi) * side > F(0.0f)) & (dot(shift, ng) > offset * kLeastLift);
}

}  // namespace primray
