// Normals of triangles that have been moved: one where there was one, and several where a crease had several.
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

// The angle of a triangle's corner at `a`: by it faces weigh in a vertex, however they are cut (Thuermer and Wuethrich 1998,
// "Computing Vertex Normals from Polygonal Facets").
double corner_angle(const dvec3& a, const dvec3& b, const dvec3& c);

// Which corners of the triangles share a normal.
struct NormalGroups {
  std::vector<int32_t> of_corner;
  std::vector<int32_t> vertex;  // of each group
  bool is_by_vertex = false;    // a vertex has no more than one

  // By `normals`, which the corners had before: those of a vertex that are one direction, nearly.
  NormalGroups(const Triangles& t, int vertices, const std::vector<float>& normals);
  // Of triangles with these points; where faces give none, `before`, of each vertex.
  std::vector<float> normals(const Triangles& t, const std::vector<float>& points, const std::vector<float>& before) const;
};

// Of each vertex one: its own, or the mean of those that its corners have.
std::vector<float> normals_by_vertex(const Triangles& t, const std::vector<float>& points, const std::vector<float>& normals);

}  // namespace primray::subdivision
