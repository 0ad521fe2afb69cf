// A description.Surface as the core's SurfaceInput; its definition is in scene_bindings.cpp.
#pragma once

#include "bindings/arrays.hpp"
#include "bsdf/surface.hpp"

namespace primray {

SurfaceInput surface_of(nb::handle surface);

}  // namespace primray
