// Where rays met curved shapes, in the space of the shapes' group.
#pragma once

#include "math/vec3.hpp"

namespace primray {

template <int W>
struct CurvedPoint {
  vvec3<W> p;
  vvec3<W> normal;  // outwards, of any length
  vvec3<W> spread;  // the size of what was rounded in finding p, by axis
};

}  // namespace primray
