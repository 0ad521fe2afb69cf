// Traces a render's recorded rays again, in order, in Embree alone: the upper bound that the benchmark compares with.
#pragma once

#include "path/rays/ray_recorder.hpp"
#include "scene/scene.hpp"

namespace primray {

// Seconds of one thread for all recorded calls, each traced in its mode; if the render did not use Embree, all as packets or
// all one by one, whichever is faster.
double replay(const Scene& scene, const RayRecorder& recorder, int lanes);

}  // namespace primray
