// Cut-outs: Embree asks a filter whether the surface is there at each point that a ray meets.
#pragma once

#include "scene/embree_records.hpp"

namespace primray {

// `cutouts` must outlive the geometry.
void set_cutout_filter(rtc::Geometry geometry, const CutoutGroup& cutouts);

}  // namespace primray
