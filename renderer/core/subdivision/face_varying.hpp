// Face-varying primvars: a topology whose vertices are values, cut where the values of neighbouring faces differ, sharpened by
// faceVaryingLinearInterpolation.
//
// The rules are OpenSubdiv's (documented in its Vtr::FVarLevel): a value's faces around a vertex are a separate fan, whose ends
// are boundaries; a sharp fan keeps its value, another follows its boundary's curve.
#pragma once

#include "subdivision/cage.hpp"

namespace primray::subdivision {

enum class LinearRule { kNone, kCornersOnly, kCornersPlus1, kCornersPlus2, kBoundaries, kAll };

struct ValueTopology {
  Topology topology;
  std::vector<int32_t> value;  // of each of its vertices; -1 where nothing uses it
};

// `values`: of each corner, its row. A vertex whose corners all have one value keeps its index; further ones come after.
ValueTopology face_varying_topology(const Cage& cage, Boundary boundary, LinearRule rule, std::span<const int32_t> values);

}  // namespace primray::subdivision
