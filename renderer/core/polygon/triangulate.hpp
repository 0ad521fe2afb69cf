// Triangulation of polygonal faces with the tests of primray/usd/mesh/triangulate.py, in their order: both give the same
// triangles. The one in Python says why; a call of this one takes a hundredth of its time for meshes of a few faces.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace primray {

// A mesh whose counts sum to the number of indices; kept faces have at least 3 vertices, all in range.
struct PolygonMesh {
  std::span<const float> points;     // 3 for each point
  std::span<const int32_t> counts;   // of each face's vertices
  std::span<const int32_t> indices;  // of the points at all corners
  std::span<const uint8_t> keep;     // for each face, or none: all are kept
};

// Triangles with area, those of a face one after another; `corners` are indices into the mesh's indices.
struct PolygonTriangles {
  std::vector<int32_t> points, corners;  // 3 for each triangle
  std::vector<int32_t> faces;            // of each triangle, ascending
  int64_t lost_faces = 0;                // kept faces without any triangle
};

PolygonTriangles triangulate(const PolygonMesh& mesh);

// Returns whether all faces may be kept, and all coordinates are at most `largest`.
bool is_usable(const PolygonMesh& mesh, float largest);

}  // namespace primray
