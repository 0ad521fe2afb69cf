// Cut-outs: Embree asks a filter whether the surface is there at each point that a ray meets.
#pragma once

#include "accel/embree.hpp"

namespace primray {

struct Scene;

// Sets the filters of a group's cut-out triangles; `scene` must outlive the geometry.
void set_cutout_filter(rtc::Geometry geometry, const Scene& scene);

}  // namespace primray
