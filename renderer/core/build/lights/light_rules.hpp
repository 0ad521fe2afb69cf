// Rules of a light beside its emission: the surfaces it illuminates, its shadow casters, and its visibility to the camera.
//
// Geometry lights (build/emitters/emitters.hpp) have rules as well: call add_light_rules() after the row was added.
#pragma once

#include "light/light.hpp"
#include "light/rules_input.hpp"

namespace primray {

// Whether its shadows differ from those of the geometry.
bool is_special(const LightRules& light);
// Adds the rules of the last row.
void add_light_rules(const LightRules& light, double scale, LightTable& table);
// Called after the last row.
void finish_light_rules(LightTable& table);

}  // namespace primray
