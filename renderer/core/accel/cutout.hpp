// Cut-outs: Embree asks a filter whether the surface is there at each point that a ray meets.
#pragma once

#include "scene/curved/curve_table.hpp"
#include "scene/embree_records.hpp"

namespace primray {

// `cutouts` must outlive the geometry.
void set_cutout_filter(rtc::Geometry geometry, const CutoutGroup& cutouts);
// Likewise of tubes, whose `first` is a segment of the scene's.
void set_tube_filter(rtc::Geometry geometry, const CutoutGroup& cutouts);

// Whether some of a group's curves wear a surface with holes.
bool has_holes(const Scene& scene, const CurveRange& range);
// Whether there is a hole at an end of tubes, of number `end` of the scene's, in an instance of that context.
bool is_end_hole(const Scene& scene, int32_t end, const rtc::RayQueryContext& context);

}  // namespace primray
