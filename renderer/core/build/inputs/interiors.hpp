// Detection of the objects with media that paths must follow, and of those that contain the camera.
#pragma once

#include "scene/scene.hpp"

namespace primray {

// Marks the surfaces that bound media, and has_thin for boundaries that let light pass straight; before the scene's rays can be
// traced. Varying inputs of interiors have their means.
void note_bodies(Scene& scene);
// Finds, after that, the objects that contain the camera, and whether any contain lights.
void find_bodies(Scene& scene);

}  // namespace primray
