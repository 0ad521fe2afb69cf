// What surfaces' varying inputs can be, known before rendering: ranges, means, and the features they bring.
#pragma once

#include "scene/scene.hpp"

namespace primray {

// Sets has_inputs, has_emission and has_thin for what varies. After all images are set.
void note_inputs(Scene& scene);

// Mean radiance that a surface emits, for choosing among emitters: a texture's mean texel, a primvar's mean over all shapes.
vec3 average_emission(const Scene& scene, int32_t surface);
// The row of a surface whose inputs all have their means.
void average_row(const Scene& scene, int32_t surface, float (&row)[kSurfaceFields]);
// Puts what is inside bodies of an OpenPBR surface into the columns `open` of its row, by the means of what varies.
void average_interior(const Scene& scene, int32_t surface, float* open);

}  // namespace primray
