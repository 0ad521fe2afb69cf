// What every area light's sampling speaks: directions from a point in the light's own frame, with solid-angle densities.
#pragma once

#include <limits>

#include "math/transcendental.hpp"

namespace primray {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

// A direction from a point to a light: unit `w`, the distance `t` to the emitting point, the density `pdf` per solid angle
// (0: the light cannot be seen from there).
template <int W>
struct LocalSample {
  vvec3<W> w;
  vfloat<W> t, pdf;
};

// A ray meeting a light's emitting side: distance (infinite: it does not) and the density with which sampling would choose it.
template <int W>
struct LocalHit {
  vfloat<W> t, pdf;
};

}  // namespace primray
