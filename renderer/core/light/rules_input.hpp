// Input for one light's rules: which surfaces it illuminates, which cast its shadows and how, and whether the camera sees it.
#pragma once

#include "math/vec3.hpp"

namespace primray {

struct LightRules {
  // Collections that it illuminates, and that cast its shadows; 0: all surfaces.
  int link = 0, casters = 0;
  int group = 0;  // number of its light group; 0: none
  bool visible_to_camera = true;
  bool casts_shadows = true;
  vec3 shadow_color{0.0f, 0.0f, 0.0f};
  double shadow_distance = -1, shadow_falloff = -1, shadow_gamma = 1;  // negative: none; lengths in scene units
};

}  // namespace primray
