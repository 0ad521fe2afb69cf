// Cut-outs: Embree asks a filter whether the surface is there at each point that a ray meets.
#pragma once

#include "accel/embree.hpp"

namespace primray {

struct Scene;

// What the filters of a group's cut-out triangles need to know.
struct CutoutGroup {
  const Scene* scene;
  uint32_t group;
};

// `cutouts` must outlive the geometry.
void set_cutout_filter(rtc::Geometry geometry, const CutoutGroup& cutouts);

}  // namespace primray
