// Tubes for Embree: its round Bezier curves, which give single rays and packets the same bits (its flat and oriented ones do
// not), and user geometry of ours for what closes them, as Embree's are open.
#pragma once

#include "embree/embree.hpp"
#include "scene/scene.hpp"

namespace primray {

// `steps` times, where they move; not committed yet.
OwnedGeometry make_tubes(const Scene& scene, const Group& group, const CurveRange& range, int steps);
// `record` must outlive it.
OwnedGeometry make_tube_ends(const TubeEnds* record);

}  // namespace primray
