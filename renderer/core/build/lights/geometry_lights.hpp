// Shapes that are lights of their own: their radiance where they stand, and what rays read of them.
#pragma once

#include <vector>

#include "scene/geometry_light_table.hpp"

namespace primray {

struct Scene;

// The area of a light's shape in the world, in scene units, where its group stands so.
double world_area(const Scene& scene, const GeometryLight& light, const daffine& world_from_group);
// Its radiance there.
vec3 placed_radiance(const Scene& scene, const GeometryLight& light, const daffine& world_from_group);
// Fills what rays read; `first_place`: by light, a matrix of its group. After the last shape and placement.
void finish_geometry_lights(Scene& scene, const std::vector<daffine>& first_place);

}  // namespace primray
