// Refinement of a level: the topology of the next one, and the masks, weights that define its points. Catmull and Clark 1978,
// Loop 1987, and DeRose, Kass and Truong 1998 for sharp features.
#pragma once

#include <cstdint>
#include <span>

#include "subdivision/topology.hpp"

namespace primray::subdivision {

// Topology of the next level, for some faces only: Catmull-Clark and bilinear faces become a quad for each corner, Loop's
// triangles four triangles.
//
// Vertices of the next level are those of the split faces, then points on their edges, then points in the faces (quads only),
// each in the order of their origin: omitting faces shifts indices, but never changes their order. Where a neighbour is omitted
// a twin is missing; such boundaries only serve the masks of others.

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

// A vertex's mask: `v` for itself, `e` for every spoke, `f` for every new face point around it (Catmull-Clark only), and
// additional weights for up to four single spokes.
struct VertexMask {
  double v = 1, e = 0, f = 0;
  int creases = 0;
  int crease[4] = {};
  double crease_weight = 0;       // of the first two
  double soft_crease_weight = 0;  // of the other two
};

// Mask of a vertex with the given spokes; `closed`: all around it.
VertexMask vertex_mask(Scheme scheme, bool closed, float vertex_sharpness, std::span<const float> spoke_sharpness);

// Loop's beta for one neighbour (Loop 1987, section 3).
double loop_beta(int valence);

// OpenSubdiv's weight of a triangle's new point in the mask of an edge (TRI_SUB_SMOOTH), instead of 1/4.
inline constexpr double kSmoothTriangle = 0.470;

struct Refinement {
  Scheme scheme = Scheme::kCatmullClark;
  bool smooth_triangles = false;
};

// Values of the next level's vertices, (n, width) each. `linear` uses plain means whatever the scheme.
void refine_values(const Topology& t, const Split& s, Refinement how, bool linear, std::span<const double> values, int width,
                   std::span<double> out);

}  // namespace primray::subdivision
