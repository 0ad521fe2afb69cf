// Triangulation of the drawn faces of all levels. A face beside finer ones includes the vertices that these have on its edges,
// so that every edge of the mesh has the same two ends on both sides.
#pragma once

#include <vector>

#include "subdivision/dicing/level.hpp"

namespace primray::subdivision {

struct Triangles {
  std::vector<int32_t> points;               // three per triangle, into the output's vertices
  std::vector<int32_t> normals;              // three per triangle; empty where normals belong to vertices
  std::vector<std::vector<int32_t>> values;  // one per face-varying primvar
  std::vector<int32_t> faces;                // of the cage, one per triangle
};

// `points`: the output's vertices, three floats each.
Triangles stitch(const std::vector<Level>& levels, const std::vector<float>& points);

}  // namespace primray::subdivision
