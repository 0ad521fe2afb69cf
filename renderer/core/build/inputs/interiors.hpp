// Which bodies paths must follow, and which of them are about the camera.
#pragma once

#include "scene/scene.hpp"

namespace primray {

// Before the scene's rays can be traced: what surfaces bound, and has_thin for boundaries that let light straight through.
// Interiors whose inputs vary have their means.
void note_bodies(Scene& scene);
// After that: the bodies about the camera, and whether lights stand in any.
void find_bodies(Scene& scene);

}  // namespace primray
