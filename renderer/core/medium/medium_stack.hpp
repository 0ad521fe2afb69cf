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
struct MediumStack {
  vint<W> surfaces[kMaxNestedMedia];  // surfaces; -1: none

  PRIMRAY_INLINE MediumStack() {
    for (vint<W>& b : surfaces) b = vint<W>(-1);
  }
  PRIMRAY_INLINE vint<W> top() const { return surfaces[0]; }
  PRIMRAY_INLINE vbool<W> has(const Scene& scene, vint<W> surface) const {
    vbool<W> found(false);
    for (const vint<W>& b : surfaces) found |= bound_same_object(scene, b, surface);
    return found;
  }
  // Removes the topmost entry that `surface` bounds, in lanes `m`.
  PRIMRAY_INLINE void remove(const Scene& scene, vbool<W> m, vint<W> surface) {
    vbool<W> moves(false);
    for (int k = 0; k < kMaxNestedMedia; ++k) {
      moves |= m & bound_same_object(scene, surfaces[k], surface);
      surfaces[k] = select(moves, k + 1 < kMaxNestedMedia ? surfaces[k + 1] : vint<W>(-1), surfaces[k]);
    }
  }
  // Inserts `surface` above all entries that are not of a higher priority.
  PRIMRAY_INLINE void add(const Scene& scene, vbool<W> m, vint<W> surface) {
    const auto priority = [&](vint<W> of) { return priority_of(scene, of); };
    vbool<W> below = m;  // lanes whose insertion point is further down
    vint<W> carried = surface;
    const vfloat<W> own = priority(surface);
    for (int k = 0; k < kMaxNestedMedia; ++k) {
      below &= (surfaces[k] >= vint<W>(0)) & (priority(surfaces[k]) > own);
      const vbool<W> here = m & !below;
      const vint<W> old = surfaces[k];
      surfaces[k] = select(here, carried, old);
      carried = select(here, old, carried);
    }
  }
  // Whether two surfaces bound the same object: a mesh may have several materials.
  static PRIMRAY_INLINE vbool<W> bound_same_object(const Scene& scene, vint<W> a, vint<W> b) {
    const std::vector<int32_t>& object_of = scene.interiors.object_of;
    if (object_of.empty()) return a == b;
    const vbool<W> is = a >= vint<W>(0);
    return is & (gather<W>(object_of.data(), select(is, a, vint<W>(0))) == gather<W>(object_of.data(), b));
  }
  static PRIMRAY_INLINE vfloat<W> priority_of(const Scene& scene, vint<W> surface) {
    if (scene.interiors.priorities.empty()) return vfloat<W>(0.0f);
    return gather<W>(scene.interiors.priorities.data(), max(surface, vint<W>(0)));
  }
};

// Distance from the surface to the offset origin of a ray that leaves it; less for grazing rays.
template <int W>
PRIMRAY_INLINE vfloat<W> origin_distance_of(vfloat<W> offset, const vvec3<W>& ng, const vvec3<W>& d) {
  return offset / max(abs(dot(ng, d)), 0.05f);
}

class VolumeSets;

// Medium stack of a shadow ray, the distance before its origin that the medium also fills, and the number of its set of volumes
// (medium/volume_sets.hpp) among `sets`.
template <int W>
struct ShadowMedia {
  MediumStack<W> stack;
  vfloat<W> origin_distance{0.0f};
  vint<W> volumes{0};
  VolumeSets* sets = nullptr;
};

template <int W>
PRIMRAY_INLINE MediumStack<W> select(vbool<W> m, const MediumStack<W>& a, const MediumStack<W>& b) {
  MediumStack<W> r;
  for (int k = 0; k < kMaxNestedMedia; ++k) r.surfaces[k] = select(m, a.surfaces[k], b.surfaces[k]);
  return r;
}

// Row in OpenPBR's table of the objects `surface`; the first row in other lanes.
template <int W>
PRIMRAY_INLINE OpenPbrRows<W> object_rows(const Scene& scene, vint<W> surface) {
  const vbool<W> is = surface >= vint<W>(0);
  const SurfaceRows<W> rows(scene.surfaces, select(is, surface, vint<W>(0)));
  const vint<W> row = select(is, rows.lobe_row(), vint<W>(0));
  return {scene.surfaces.open_pbr.data(), row * vint<W>(kOpenPbrFields)};
}

// Medium of the topmost object of the stack.
template <int W>
PRIMRAY_INLINE Medium<W> medium_of(const Scene& scene, const MediumStack<W>& stack) {
  const vbool<W> is = stack.top() >= vint<W>(0);
  Medium<W> r;
  if (!any(is)) return r;
  const OpenPbrRows<W> row = object_rows<W>(scene, stack.top());
  const vvec3<W> none(vfloat<W>(0.0f));
  r.extinction = select(is, row.color(kOpenExtinction) * scene.interiors.per_length, none);
  r.scattering = select(is, row.color(kOpenScattering) * scene.interiors.per_length, none);
  r.phase = row(kOpenPhase);
  return r;
}
// Index of refraction of the topmost object; 1 outside of all.
template <int W>
PRIMRAY_INLINE vfloat<W> ior_in(const Scene& scene, const MediumStack<W>& stack) {
  const vbool<W> is = stack.top() >= vint<W>(0);
  return any(is) ? select(is, object_rows<W>(scene, stack.top())(kOpenEta), vfloat<W>(1.0f)) : vfloat<W>(1.0f);
}

// Scale from radiance L emitted inside the medium to radiance at the camera: paths carry L / n^2 along refractions.
template <int W>
PRIMRAY_INLINE vfloat<W> radiance_scale(const Scene& scene, const MediumStack<W>& stack) {
  const vfloat<W> n = ior_in(scene, stack);
  return vfloat<W>(scene.interiors.camera_index2) / (n * n);
}

// Boundary that lanes `bounds_medium` hit, from its front or back: the stacks on both sides, and whether a medium of higher
// priority overrides it, so that it is invisible (a false intersection, as Schmidt and Budge call it).
template <int W>
struct Boundary {
  vbool<W> bounds_medium, overridden, missed;  // missed: its back was hit by a path that had not entered
  MediumStack<W> here, beyond;                 // on the path's side, on the other side
  vfloat<W> ior_outside;                       // index of refraction outside the surface

  // No boundary.
  PRIMRAY_INLINE explicit Boundary(const MediumStack<W>& now)
      : bounds_medium(false), overridden(false), missed(false), here(now), beyond(now), ior_outside(1.0f) {}
  PRIMRAY_INLINE Boundary(const Scene& scene, vbool<W> hit, const MediumStack<W>& now, vint<W> surface, vbool<W> front)
      : here(now), beyond(now) {
    bounds_medium = hit & (gather<W>(scene.interiors.bounds_medium.data(), surface) != vint<W>(0));
    overridden = missed = vbool<W>(false), ior_outside = ior_in(scene, now);
    if (!any(bounds_medium)) return;
    const vbool<W> has = now.has(scene, surface), enters = bounds_medium & front, leaves = bounds_medium & !front;
    if (any(enters & has)) here.remove(scene, enters & has, surface);
    missed = leaves & !has;
    if (any(missed)) here.add(scene, missed, surface);
    beyond = here;
    beyond.add(scene, enters, surface);
    beyond.remove(scene, leaves, surface);
    overridden =
        (enters & (beyond.top() != surface)) | (leaves & !MediumStack<W>::bound_same_object(scene, here.top(), surface));
    ior_outside = ior_in(scene, select(enters, here, beyond));
  }
};

}  // namespace primray
