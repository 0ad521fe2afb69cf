// What belongs to a light beside its emission: whom it reaches, who casts its shadows and how, whether the camera sees it.
//
// A light that is geometry (build/emitters/emitters.hpp) has them as well: add_light_rules after its row was added.
#pragma once

#include "light/light.hpp"
#include "light/rules_input.hpp"

namespace primray {

// Whether its shadows differ from what the geometry casts.
bool is_special(const LightRules& light);
// Of the row that was added last.
void add_light_rules(const LightRules& light, double scale, LightTable& table);
// After the last row.
void finish_light_rules(LightTable& table);

}  // namespace primray
