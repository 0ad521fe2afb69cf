// Facts about the scene that are derived before rendering: ranges and means of varying inputs, mean values of patterns, the
// texture levels that rays can need, and the objects that contain media.
#pragma once

#include "scene/scene.hpp"

namespace primray {

// Texture levels that a render can need: a bound from the camera's distance and the texture's density on the geometry.

// Sets Texture::least_footprint. Called after all shapes, placements and the camera.
void measure_footprints(Scene& scene);

// Returns the finest level of an image of that size that a ray can need.
int finest_level(const Texture& texture, int width, int height);
// Whether the images of `made` have every level that rays can ask for on `texture`, which reads the same files.
bool has_needed_levels(const Texture& texture, const Texture& made);

// Returns the finest level that rays can need of each image that patterns read, in the order of the textures.
std::vector<int> pattern_levels(const Scene& scene);

// Detection of the objects with media that paths must follow, and of those that contain the camera.

// Marks the surfaces that bound media, and shadows_need_hits for boundaries that let light pass straight; before the scene's
// rays can be traced. Varying inputs of interiors have their means.
void mark_media_boundaries(Scene& scene);
// Finds, after that, the objects that contain the camera, and whether any contain lights.
void find_camera_media(Scene& scene);

// Media that contain a point: surfaces of the objects, as in MediumStack, and volumes.
struct MediaAround {
  int32_t surfaces[kMaxNestedMedia] = {-1, -1, -1, -1};
  std::vector<VolumeObject> volumes;
};
MediaAround media_around(const Scene& scene, const vec3& p);

// Mean values of patterns, estimated on the shapes that use them: the choice among emitters, and photons, rely on these.

// Sets `fallback` of inputs that read a tape, for surfaces that some triangles have; others keep theirs. Images are read at the
// finest level that rays can need, also where finer ones are kept.
void set_pattern_means(Scene& scene);

// Sets has_inputs, has_emission and shadows_need_hits for varying inputs. Called after all images are set.
void set_input_features(Scene& scene);

// Mean radiance that a surface emits, for choosing among emitters: a texture's mean texel, a primvar's mean over all shapes.
vec3 average_emission(const Scene& scene, int32_t surface);
// Row of a surface with all inputs at their means.
void average_row(const Scene& scene, int32_t surface, float (&row)[kSurfaceFields]);
// Writes the interior of an OpenPBR surface to the columns `open` of its row, with varying inputs at their means.
void average_interior(const Scene& scene, int32_t surface, float* open);

}  // namespace primray
