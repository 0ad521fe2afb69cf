// Point on a curved shape that a ray hit, in the space of the shape's group.
#pragma once

#include "math/vec3.hpp"

namespace primray {

template <int W>
struct CurvedPoint {
  vvec3<W> p;
  vvec3<W> normal;  // outwards, of any length
  vvec3<W> spread;  // magnitude of what was rounded in computing p, by axis
};

}  // namespace primray
