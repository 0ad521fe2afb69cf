// Converts a light's shaping and IES profiles to rows of the ShapingTable.
#pragma once

#include "build/inputs/light_input.hpp"
#include "math/row.hpp"

namespace primray {

int add_ies(const IesInput& profile, IesTable& table);
// For the light of `row`, whose other fields are set; stores the number of its shaping in the row.
void add_shaping(const ShapingInput& shaping, const daffine& world_from_light, float* row, LightTable& table);

}  // namespace primray
