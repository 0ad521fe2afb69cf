// Tracing a render's recorded rays again, in order, through Embree alone: the ceiling that the benchmark compares with.
#pragma once

#include "path/rays/ray_recorder.hpp"
#include "scene/scene.hpp"

namespace primray {

// Seconds of one thread for all recorded calls, each traced the way it was; where the render did without Embree, all as packets
// or all one by one, whichever takes less.
double replay(const Scene& scene, const RayRecorder& recorder, int lanes);

}  // namespace primray
