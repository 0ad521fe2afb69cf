// Cutouts: Embree calls a filter at each hit, which tests whether the surface is present there.
#pragma once

#include "scene/curved/curve_table.hpp"
#include "scene/embree_records.hpp"

namespace primray {

// Sets the filter of triangles; `cutouts` must outlive the geometry.
void set_cutout_filter(rtc::Geometry geometry, const CutoutGroup& cutouts);
// Sets the filter of tubes; `first` of `cutouts` is a segment of the scene, and `cutouts` must outlive the geometry.
void set_tube_filter(rtc::Geometry geometry, const CutoutGroup& cutouts);

// Whether some of a group's curves have a surface with holes.
bool has_holes(const Scene& scene, const CurveRange& range);
// Whether there is a hole at end `end` of the scene's tubes, in an instance of that context.
bool is_end_hole(const Scene& scene, int32_t end, const rtc::RayQueryContext& context);

}  // namespace primray
