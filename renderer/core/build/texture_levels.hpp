// Texture levels that a render can need: a bound from the camera's distance and the texture's density on the geometry.
#pragma once

#include "scene/scene.hpp"

namespace primray {

// Sets Texture::least_footprint. Called after all shapes, placements and the camera.
void measure_footprints(Scene& scene);

// Returns the finest level of an image of that size that a ray can need.
int finest_level(const Texture& texture, int width, int height);

}  // namespace primray
