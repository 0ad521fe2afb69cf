// Converts the input of a light to a row of the LightTable, in the core's space.
#pragma once

#include "build/inputs/light_input.hpp"
#include "math/row.hpp"

namespace primray {

// Writes the fields of any light beside its shape and position: its lobe factors.
void put_common_fields(const LightInput& light, LightTable& table, float* row);
void copy_common_fields(const float* from, float* to);
// `image`: of a rectangle light, its index in LightTable::images, or -1.
void add_light_rows(const LightInput& light, const dvec3& origin, double scale, LightTable& table, int image = -1);
// Completes the rows after the last light: what depends on all of them.
void finish_light_rows(LightTable& table);

}  // namespace primray
