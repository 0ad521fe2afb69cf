// What belongs to a light beside its emission: whom it reaches, who casts its shadows and how, whether the camera sees it.
//
// A light that is geometry (scene/emitters.hpp) has them as well: add_light_rules after its row was added.
#pragma once

#include "light/light.hpp"

namespace primray {

struct LightRules {
  // Collections that it reaches, and that cast its shadows; 0: all surfaces.
  int link = 0, casters = 0;
  bool visible_to_camera = true;
  bool casts_shadows = true;
  vec3 shadow_color{0.0f, 0.0f, 0.0f};
  double shadow_distance = -1, shadow_falloff = -1, shadow_gamma = 1;  // negative: none; lengths in scene units
};

// Whether its shadows differ from what the geometry casts.
bool is_special(const LightRules& light);
// Of the row that was added last.
void add_light_rules(const LightRules& light, double scale, LightTable& table);
// After the last row.
void finish_light_rules(LightTable& table);

}  // namespace primray
