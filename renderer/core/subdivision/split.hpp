// Topology of the next level, for some faces only: Catmull-Clark and bilinear faces become a quad for each corner, Loop's
// triangles four triangles.
//
// Vertices of the next level are those of the split faces, then points on their edges, then points in the faces (quads only),
// each in the order of their origin: omitting faces shifts indices, but never changes their order. Where a neighbour is omitted
// a twin is missing; such boundaries only serve the masks of others.
#pragma once

#include "subdivision/topology.hpp"

namespace primray::subdivision {

struct Split {
  std::vector<int32_t> face_child;    // first child of each face, -1 where it is not split
  std::vector<int32_t> vertex_child;  // child of each vertex
  std::vector<int32_t> edge_child;    // index k of each edge among the split ones: the edges 2k and 2k + 1
  std::vector<int32_t> face_point;    // centre vertex of each face; empty for Loop
  int edge_points = 0;                // the first of them: that of k is edge_points + k

  int edge_point(int e) const { return edge_points + edge_child[e]; }
};

// `chosen`: of each face, whether it is split.
Topology split_faces(const Topology& t, Scheme scheme, const std::vector<uint8_t>& chosen, Split& split);

}  // namespace primray::subdivision
