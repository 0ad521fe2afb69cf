// Normals of displaced triangles: one per vertex where there was one, and several where a crease had several.
#pragma once

#include <cstdint>
#include <vector>

#include "math/vec3.hpp"

namespace primray::subdivision {

struct Triangles;

inline dvec3 vector_at(const std::vector<float>& from, int row) {
  const float* p = &from[3 * size_t(row)];
  return {p[0], p[1], p[2]};
}

// Angle of a triangle's corner at `a`: the weight of a face in a vertex normal, however faces are split (Thuermer and Wuethrich
// 1998, "Computing Vertex Normals from Polygonal Facets").
double corner_angle(const dvec3& a, const dvec3& b, const dvec3& c);

// Corners of the triangles that share a normal.
struct NormalGroups {
  std::vector<int32_t> of_corner;
  std::vector<int32_t> vertex;  // of each group
  bool is_by_vertex = false;    // a vertex has no more than one

  // Groups by `normals`, which the corners had before: those of a vertex with nearly one direction.
  NormalGroups(const Triangles& t, int vertices, const std::vector<float>& normals);
  // Normals of triangles with these points; where faces have none, `before`, of each vertex.
  std::vector<float> normals(const Triangles& t, const std::vector<float>& points, const std::vector<float>& before) const;
};

// One normal per vertex: its own, or the mean of its corners'.
std::vector<float> normals_by_vertex(const Triangles& t, const std::vector<float>& points, const std::vector<float>& normals);

}  // namespace primray::subdivision
