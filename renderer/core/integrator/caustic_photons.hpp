// Follows photons from small lights over smooth surfaces and fills the scene's CausticGuide with them.
#pragma once

#include "scene/scene.hpp"

namespace primray {

// Leaves the guide empty where no small light meets a smooth surface. Depends on the scene alone.
void build_caustic_guide(Scene& scene, int threads);

}  // namespace primray
