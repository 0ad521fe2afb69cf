// First level: a control cage's topology with its creases, corners and boundary rules, from arrays as in USD, and the
// topologies of its face-varying primvars.
//
// An edge that does not join exactly two faces in opposite directions ends the surface for each of them and is infinitely
// sharp: a boundary, or not manifold. A vertex where such edges leave no single curve is a corner.
#pragma once

#include "subdivision/topology.hpp"

namespace primray::subdivision {

struct CageInput {
  Scheme scheme = Scheme::kCatmullClark;
  Boundary boundary = Boundary::kEdgeAndCorner;
  bool smooth_triangles = false;         // triangleSubdivisionRule
  std::span<const int32_t> face_counts;  // 3 or more each
  std::span<const int32_t> face_points;  // those of a face are distinct
  std::span<const int32_t> holes;
  std::span<const int32_t> crease_lengths;  // 2 or more each
  std::span<const int32_t> crease_points;
  std::span<const float> crease_sharpnesses;  // one per crease, or one per edge
  std::span<const int32_t> corner_points;
  std::span<const float> corner_sharpnesses;
  int points = 0;
};

struct Cage {
  Topology topology;
  std::vector<uint8_t> is_hole;      // of each face
  std::vector<uint8_t> is_singular;  // of each vertex: more than one fan touches in it
  int non_manifold_edges = 0;
  int unknown_creases = 0;  // edges that creases name and no face has
};

Cage build_cage(const CageInput& input);

// Face-varying primvars: a topology whose vertices are values, cut where the values of neighbouring faces differ, sharpened by
// faceVaryingLinearInterpolation.
//
// The rules are OpenSubdiv's (documented in its Vtr::FVarLevel): a value's faces around a vertex are a separate fan, whose ends
// are boundaries; a sharp fan keeps its value, another follows its boundary's curve.

enum class LinearRule { kNone, kCornersOnly, kCornersPlus1, kCornersPlus2, kBoundaries, kAll };

struct ValueTopology {
  Topology topology;
  std::vector<int32_t> value;  // of each of its vertices; -1 where nothing uses it
};

// `values`: of each corner, its row. A vertex whose corners all have one value keeps its index; further ones come after.
ValueTopology face_varying_topology(const Cage& cage, Boundary boundary, LinearRule rule, std::span<const int32_t> values);

}  // namespace primray::subdivision
