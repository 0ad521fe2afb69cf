// Tubes in Embree: its round Bezier curves, which give single rays and packets the same bits (its flat and oriented curves do
// not), and user geometry for their ends, which Embree leaves open.
#pragma once

#include "embree/embree.hpp"
#include "scene/scene.hpp"

namespace primray {

// Returns the tubes at `steps` times if they move; not committed yet.
OwnedGeometry make_tubes(const Scene& scene, const Group& group, const CurveRange& range, int steps);
// Returns the ends of tubes; `record` must outlive it.
OwnedGeometry make_tube_ends(const TubeEnds* record);

}  // namespace primray
