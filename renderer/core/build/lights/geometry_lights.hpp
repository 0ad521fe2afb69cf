// Shapes with UsdLux LightAPI: their radiance in each placement, and the tables that rays read.
#pragma once

#include <vector>

#include "scene/geometry_light_table.hpp"

namespace primray {

struct Scene;

// World-space area of a light's shape, in scene units, for a placement of its group.
double world_area(const Scene& scene, const GeometryLight& light, const daffine& world_from_group);
// Its radiance in that placement.
vec3 placed_radiance(const Scene& scene, const GeometryLight& light, const daffine& world_from_group);
// Fills the tables that rays read; `first_place`: by light, a matrix of its group. Called after the last shape and placement.
void finish_geometry_lights(Scene& scene, const std::vector<daffine>& first_place);

}  // namespace primray
