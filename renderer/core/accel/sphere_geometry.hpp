// Exact spheres and ellipsoids as user geometry: the same intersection for packets and single rays.
#pragma once

#include "embree/embree.hpp"

namespace primray {

struct SphereRecord;

// A user geometry over `count` records, which must outlive it; hits carry the unit normal in the sphere's own space as Ng.
OwnedGeometry make_sphere_geometry(const SphereRecord* records, uint32_t count);

}  // namespace primray
