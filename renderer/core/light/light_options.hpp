// Input for one light beside its shape and emission: its directional shaping (UsdLux ShapingAPI), the surfaces it illuminates,
// its shadow casters, and its visibility to the camera.
#pragma once

#include "math/vec3.hpp"

namespace primray {

// Input of UsdLux ShapingAPI for one light.
struct ShapingInput {
  double focus = 0;
  vec3 focus_tint;
  double cone_angle_deg = 180, cone_softness = 0;
  int ies = -1;  // result of add_ies_profile()
  double ies_angle_scale = 0, ies_divisor = 1;
};

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
