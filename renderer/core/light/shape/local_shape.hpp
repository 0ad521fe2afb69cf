// Samples and hits of area lights in the light's own frame, with solid-angle densities.
#pragma once

#include <limits>

#include "math/transcendental.hpp"

namespace primray {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

// Sampled direction from a point to a light: unit `w`, the distance `t` to the emitting point, and its density `pdf` per solid
// angle (0: the light is not visible from there).
template <int W>
struct LocalSample {
  vvec3<W> w;
  vfloat<W> t, pdf;
};

// Hit of a ray on a light's emitting side: distance (infinite: no hit), and the density with which sampling would choose it.
template <int W>
struct LocalHit {
  vfloat<W> t, pdf;
};

}  // namespace primray
