// Instances of a scene that has instances itself: Embree (as built) follows one level of instances, this is the one above.
//
// A user geometry, one primitive an instance: it moves the ray into the group's space and traces the group's own scene. What it
// finds has no field left for both instances, so a hit's numbers are packed (`pack`) and taken apart again by
// `ray/grouped_hit.hpp`, the same for single rays and packets.
#pragma once

#include "embree/embree.hpp"
#include "scene/embree_records.hpp"

namespace primray {

// The record's accel must have been committed.
GroupedPlacement make_grouped(const float* matrices, uint32_t first_instance, uint32_t count, uint32_t inner_base,
                              rtc::Scene accel);
OwnedGeometry make_grouped_geometry(const GroupedPlacement* record);

}  // namespace primray
