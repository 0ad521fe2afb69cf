// From one level's topology to the next, for some faces only: Catmull-Clark and bilinear faces become a quad for each corner,
// Loop's triangles four triangles.
//
// Vertices of the next level are those of the split faces, then points on their edges, then points in the faces (quads
// only), each in the order of what they come from: leaving faces out shifts numbers, but never changes an order. Where a
// neighbour is left out a twin is missing; what lies there serves nothing but the masks of others.
#pragma once

#include "subdivision/topology.hpp"

namespace primray::subdivision {

struct Split {
  std::vector<int32_t> face_child;    // of each face its first child, -1 where it is not split
  std::vector<int32_t> vertex_child;  // of each vertex the vertex it becomes
  std::vector<int32_t> edge_child;    // of each edge its place k among the split ones: the edges 2k and 2k + 1
  std::vector<int32_t> face_point;    // of each face the vertex in its middle; empty for Loop
  int edge_points = 0;                // the first of them: k's is edge_points + k

  int edge_point(int e) const { return edge_points + edge_child[e]; }
};

// `chosen`: of each face, whether it is split.
Topology split_faces(const Topology& t, Scheme scheme, const std::vector<uint8_t>& chosen, Split& split);

}  // namespace primray::subdivision
