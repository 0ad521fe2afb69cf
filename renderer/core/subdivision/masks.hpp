// Subdivision masks: the weights that define the points of the next level. Catmull and Clark 1978, Loop 1987, and DeRose, Kass
// and Truong 1998 for sharp features.
#pragma once

#include <cstdint>
#include <span>

#include "subdivision/split.hpp"
#include "subdivision/topology.hpp"

namespace primray::subdivision {

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
