// Stack of the nested dielectrics that a path is in: a short list of surfaces, the innermost first, which determines the media
// on both sides of each boundary (Schmidt and Budge 2002, "Simple Nested Dielectrics in Ray Traced Images").
//
// Where objects overlap, the one of highest priority prevails; among equals, the one entered last. Boundaries of the others are
// ignored. The side of a boundary shows whether the path was inside: a front face hit from within, or a back face from outside,
// means that a boundary was missed (it coincided with another, or a mesh is open), and the stack is corrected.
#pragma once

#include "bsdf/bsdf_with_open_pbr.hpp"
#include "medium/medium.hpp"
#include "scene/scene.hpp"

namespace primray {

template <int W>
struct BodyLanes {
  vint<W> inside[kMostBodies];  // surfaces; -1: none

  PRIMRAY_INLINE BodyLanes() {
    for (vint<W>& b : inside) b = vint<W>(-1);
  }
  PRIMRAY_INLINE vint<W> top() const { return inside[0]; }
  PRIMRAY_INLINE vbool<W> has(const Scene& scene, vint<W> surface) const {
    vbool<W> found(false);
    for (const vint<W>& b : inside) found |= bound_one(scene, b, surface);
    return found;
  }
  // Removes the topmost entry that `surface` bounds, in lanes `m`.
  PRIMRAY_INLINE void remove(const Scene& scene, vbool<W> m, vint<W> surface) {
    vbool<W> moves(false);
    for (int k = 0; k < kMostBodies; ++k) {
      moves |= m & bound_one(scene, inside[k], surface);
      inside[k] = select(moves, k + 1 < kMostBodies ? inside[k + 1] : vint<W>(-1), inside[k]);
    }
  }
  // Inserts `surface` above all entries that are not of a higher priority.
  PRIMRAY_INLINE void add(const Scene& scene, vbool<W> m, vint<W> surface) {
    const auto priority = [&](vint<W> of) { return priority_of(scene, of); };
    vbool<W> below = m;  // lanes whose insertion point is further down
    vint<W> carried = surface;
    const vfloat<W> own = priority(surface);
    for (int k = 0; k < kMostBodies; ++k) {
      below &= (inside[k] >= vint<W>(0)) & (priority(inside[k]) > own);
      const vbool<W> here = m & !below;
      const vint<W> old = inside[k];
      inside[k] = select(here, carried, old);
      carried = select(here, old, carried);
    }
  }
  // Whether two surfaces bound the same object: a mesh may have several materials.
  static PRIMRAY_INLINE vbool<W> bound_one(const Scene& scene, vint<W> a, vint<W> b) {
    const std::vector<int32_t>& bodies = scene.interiors.bodies;
    if (bodies.empty()) return a == b;
    const vbool<W> is = a >= vint<W>(0);
    return is & (gather<W>(bodies.data(), select(is, a, vint<W>(0))) == gather<W>(bodies.data(), b));
  }
  static PRIMRAY_INLINE vfloat<W> priority_of(const Scene& scene, vint<W> surface) {
    if (scene.interiors.priorities.empty()) return vfloat<W>(0.0f);
    return gather<W>(scene.interiors.priorities.data(), max(surface, vint<W>(0)));
  }
};

// Distance from the surface to the offset origin of a ray that leaves it; less for grazing rays.
template <int W>
PRIMRAY_INLINE vfloat<W> lead_of(vfloat<W> offset, const vvec3<W>& ng, const vvec3<W>& d) {
  return offset / max(abs(dot(ng, d)), 0.05f);
}

// Medium stack of a shadow ray, and its lead.
template <int W>
struct BodiesAround {
  BodyLanes<W> bodies;
  vfloat<W> lead{0.0f};
};

template <int W>
PRIMRAY_INLINE BodyLanes<W> select(vbool<W> m, const BodyLanes<W>& a, const BodyLanes<W>& b) {
  BodyLanes<W> r;
  for (int k = 0; k < kMostBodies; ++k) r.inside[k] = select(m, a.inside[k], b.inside[k]);
  return r;
}

// Row in OpenPBR's table of the objects `surface`; the first row in other lanes.
template <int W>
PRIMRAY_INLINE OpenPbrRows<W> body_rows(const Scene& scene, vint<W> surface) {
  const vbool<W> is = surface >= vint<W>(0);
  const SurfaceRows<W> rows(scene.surfaces, select(is, surface, vint<W>(0)));
  const vint<W> row = select(is, truncate(rows(kOpenPbrRow)), vint<W>(0));
  return {scene.surfaces.open_pbr.data(), row * vint<W>(kOpenPbrFields)};
}

// Medium of the topmost object of the stack.
template <int W>
PRIMRAY_INLINE Medium<W> medium_of(const Scene& scene, const BodyLanes<W>& bodies) {
  const vbool<W> is = bodies.top() >= vint<W>(0);
  Medium<W> r;
  if (!any(is)) return r;
  const OpenPbrRows<W> row = body_rows<W>(scene, bodies.top());
  const vvec3<W> none(vfloat<W>(0.0f));
  r.extinction = select(is, row.color(kOpenExtinction) * scene.interiors.per_length, none);
  r.scattering = select(is, row.color(kOpenScattering) * scene.interiors.per_length, none);
  r.phase = row(kOpenPhase);
  return r;
}
// Index of refraction of the topmost object; 1 outside of all.
template <int W>
PRIMRAY_INLINE vfloat<W> index_in(const Scene& scene, const BodyLanes<W>& bodies) {
  const vbool<W> is = bodies.top() >= vint<W>(0);
  return any(is) ? select(is, body_rows<W>(scene, bodies.top())(kOpenEta), vfloat<W>(1.0f)) : vfloat<W>(1.0f);
}

// Scale from radiance L emitted inside the medium to radiance at the camera: paths carry L / n^2 along refractions.
template <int W>
PRIMRAY_INLINE vfloat<W> radiance_from(const Scene& scene, const BodyLanes<W>& bodies) {
  const vfloat<W> n = index_in(scene, bodies);
  return vfloat<W>(scene.interiors.camera_index2) / (n * n);
}

// Boundary that lanes `is_body` hit, from its front or back: the stacks on both sides, and whether it is visible at all.
template <int W>
struct Boundary {
  vbool<W> is_body, unseen, missed;  // missed: its back was hit by a path that had not entered
  BodyLanes<W> here, beyond;         // on the path's side, on the other side
  vfloat<W> beside;                  // index of refraction outside the surface

  // No boundary.
  PRIMRAY_INLINE explicit Boundary(const BodyLanes<W>& now)
      : is_body(false), unseen(false), missed(false), here(now), beyond(now), beside(1.0f) {}
  PRIMRAY_INLINE Boundary(const Scene& scene, vbool<W> hit, const BodyLanes<W>& now, vint<W> surface, vbool<W> front)
      : here(now), beyond(now) {
    is_body = hit & (gather<W>(scene.interiors.is_body.data(), surface) != vint<W>(0));
    unseen = missed = vbool<W>(false), beside = index_in(scene, now);
    if (!any(is_body)) return;
    const vbool<W> has = now.has(scene, surface), enters = is_body & front, leaves = is_body & !front;
    if (any(enters & has)) here.remove(scene, enters & has, surface);
    missed = leaves & !has;
    if (any(missed)) here.add(scene, missed, surface);
    beyond = here;
    beyond.add(scene, enters, surface);
    beyond.remove(scene, leaves, surface);
    unseen = (enters & (beyond.top() != surface)) | (leaves & !BodyLanes<W>::bound_one(scene, here.top(), surface));
    beside = index_in(scene, select(enters, here, beyond));
  }
};

}  // namespace primray
