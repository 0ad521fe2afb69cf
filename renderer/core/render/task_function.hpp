// Kernels of this module by number of lanes.
#pragma once

#include "base/flush_denormals.hpp"
#include "integrator/tile_task.hpp"

namespace primray {

using TaskFunction = void (*)(const Scene&, const IntegratorSettings&, const TileBlock&, Worker&, Film&, RayRecorder*);

// Null for a number of lanes that this module was not built with.
TaskFunction task_function(int lanes);

inline bool has_lanes(int lanes) { return task_function(lanes) != nullptr; }

}  // namespace primray
