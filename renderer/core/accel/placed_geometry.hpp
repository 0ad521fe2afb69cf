// Instances as user geometry: of scenes that have instances themselves, since Embree (as built) supports one level of
// instances, and those that move, since Embree's own moving instances give single rays other bits than packets.
//
// Each instance is one primitive: it transforms the ray into the group's space and traces the group's own scene. There is no
// field left for a hit in a nested instance, so its numbers are packed and unpacked again by `ray/grouped_hit.hpp`, the same
// for single rays and packets; other hits look like Embree's own.
#pragma once

#include "embree/embree.hpp"
#include "scene/embree_records.hpp"

namespace primray {

struct Scene;

// Whether placement number `placement` of the scene must be user geometry.
bool needs_placed_geometry(const Scene& scene, size_t placement);
// Returns the user geometry of instances [first, end). The accel of the group must have been committed.
PlacedGroup make_placed(const Scene& scene, size_t placement, uint32_t first, uint32_t end);
OwnedGeometry make_placed_geometry(const PlacedGroup* record);

}  // namespace primray
