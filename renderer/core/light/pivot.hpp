// A light as it is seen from segments of rays (light/sampler/segment_choice.hpp).
#pragma once

#include <cstdint>

#include "math/vec3.hpp"

namespace primray {

struct Pivot {
  vec3 center;
  float radius2;  // squared radius within which its light no longer grows
  float power;
  vec3 axis, apex;  // of the cone that it reaches
  float cos_end;    // of the cone's half angle; 0: it reaches all directions
  int32_t light;    // row
};

}  // namespace primray
