// Vertex in a scene with media: the media on both sides of the surface, and the one that a ray enters when it leaves the
// vertex.
#pragma once

#include "bsdf/basics/scattering.hpp"
#include "path/interiors/inside_columns.hpp"

namespace primray {

template <int W>
struct Crossing {
  Inside<W> inside;  // of the incoming path
  Boundary<W> boundary;
  Medium<W> entered;  // medium below opaque surfaces that may be entered (subsurface)

  // State of the path after the scattering event `s`.
  PRIMRAY_INLINE Inside<W> after(const BsdfSample<W>& s) const {
    Inside<W> r;
    r.bodies = select(s.transmits & !s.enters, boundary.beyond, boundary.here);
    r.below.extinction = select(s.enters, entered.extinction, inside.below.extinction);
    r.below.scattering = select(s.enters, entered.scattering, inside.below.scattering);
    r.below.phase = select(s.enters, entered.phase, inside.below.phase);
    return r;
  }
  // Transmittance over distance `t` from here, times the radiance scale of the medium; in lanes `beyond` on the far side of the
  // surface.
  PRIMRAY_RARE vvec3<W> left_towards(const Scene& scene, vbool<W> beyond, vfloat<W> t) const {
    const BodyLanes<W> around = select(beyond, boundary.beyond, boundary.here);
    return medium_of(scene, around).left_after(t) * radiance_from(scene, around);
  }
};

}  // namespace primray
