// Turns a light's input into a row of the LightTable, in the core's space.
#pragma once

#include "build/inputs/light_input.hpp"
#include "math/row.hpp"

namespace primray {

// What any light has beside its shape and place: its lobe factors.
void put_common_fields(const LightInput& light, LightTable& table, float* row);
void copy_common_fields(const float* from, float* to);
// `image`: of a rectangle, its number in LightTable::images, or -1.
void add_light_rows(const LightInput& light, const dvec3& origin, double scale, LightTable& table, int image = -1);
// After the last light: what depends on all of them.
void finish_light_rows(LightTable& table);

}  // namespace primray
