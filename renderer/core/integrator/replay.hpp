// Tracing a render's recorded rays again, in order, through Embree alone: the ceiling that the benchmark compares with.
#pragma once

#include "integrator/ray_recorder.hpp"
#include "scene/scene.hpp"

namespace primray {

// Seconds of one thread for all recorded calls, each traced the way it was.
double replay(const Scene& scene, const RayRecorder& recorder, int lanes);

}  // namespace primray
