// Properties of surfaces' varying inputs that are known before rendering: ranges, means, and the features that they need.
#pragma once

#include "scene/scene.hpp"

namespace primray {

// Sets has_inputs, has_emission and has_thin for varying inputs. Called after all images are set.
void note_inputs(Scene& scene);

// Mean radiance that a surface emits, for choosing among emitters: a texture's mean texel, a primvar's mean over all shapes.
vec3 average_emission(const Scene& scene, int32_t surface);
// Row of a surface with all inputs at their means.
void average_row(const Scene& scene, int32_t surface, float (&row)[kSurfaceFields]);
// Writes the interior of an OpenPBR surface to the columns `open` of its row, with varying inputs at their means.
void average_interior(const Scene& scene, int32_t surface, float* open);

}  // namespace primray
