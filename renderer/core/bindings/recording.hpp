// Rays of a render on one thread, recorded in order.
#pragma once

#include "integrator/rays/ray_recorder.hpp"
#include "scene/scene.hpp"

namespace primray {

struct Recording {
  const Scene& scene;
  int lanes;
  RayRecorder rays;
};

}  // namespace primray
