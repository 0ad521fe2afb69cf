// A vertex among bodies: what is on either side of it, and what a ray that leaves it is in.
#pragma once

#include "bsdf/basics/scattering.hpp"
#include "path/interiors/inside_columns.hpp"

namespace primray {

template <int W>
struct Crossing {
  Inside<W> inside;  // of the path that came
  Boundary<W> boundary;
  Medium<W> entered;  // what is below opaque surfaces, of those that may be entered

  // Of a path that goes on as `s` says.
  PRIMRAY_INLINE Inside<W> after(const BsdfSample<W>& s) const {
    Inside<W> r;
    r.bodies = select(s.transmits & !s.enters, boundary.beyond, boundary.here);
    r.below.extinction = select(s.enters, entered.extinction, inside.below.extinction);
    r.below.scattering = select(s.enters, entered.scattering, inside.below.scattering);
    r.below.phase = select(s.enters, entered.phase, inside.below.phase);
    return r;
  }
  // Of light on a way of length `t` from here; of lanes `beyond` from the other side.
  PRIMRAY_RARE vvec3<W> left_towards(const Scene& scene, vbool<W> beyond, vfloat<W> t) const {
    const BodyLanes<W> around = select(beyond, boundary.beyond, boundary.here);
    return medium_of(scene, around).left_after(t) * radiance_from(scene, around);
  }
};

}  // namespace primray
