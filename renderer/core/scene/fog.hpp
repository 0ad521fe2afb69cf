// Fog that fills the scene (medium/fog.hpp).
#pragma once

#include <algorithm>

#include "math/vec3.hpp"

namespace primray {

struct Fog {
  float extinction = 0;  // per unit of the core's lengths, below `top`
  vec3 albedo{0.0f}, emission{0.0f};
  float phase = 0;      // see medium/phase_function.hpp
  vec3 up{0.0f};        // 0: without a top
  float top = 0;        // height along `up`
  bool hidden = false;  // from the camera
  float falloff = 0;    // height above the top over which the density falls to 1 / e; 0: it ends there

  bool any() const { return extinction > 0 || emits(); }
  bool scatters() const { return std::max({albedo.x, albedo.y, albedo.z}) > 0; }
  bool emits() const { return std::max({emission.x, emission.y, emission.z}) > 0; }
};

}  // namespace primray
