// Choice among a shape's triangles: those that contribute much to a point are likelier, by a light tree
// (light/choice/tree.hpp).
#pragma once

#include <array>
#include <vector>

#include "math/vec3.hpp"

namespace primray {

struct Scene;
struct EmitterTable;

// Triangles of a shape, in its group's space.
struct ShapeTriangles {
  const Scene& scene;
  size_t first, count, vertex_base;
  // Motion of its vertices: offset of their later times, and stride between times.
  size_t later = 0, stride = 0;

  std::array<uint32_t, 3> indices(size_t triangle) const;
  std::array<dvec3, 3> corners(size_t triangle, size_t step = 0) const;
};

// Maximum number of leaves in a shape's tree.
constexpr size_t kMostTriangleRuns = 1 << 16;

// Adds the choice among the shape's triangles to the table, after the other columns of its shape. `meshes`: its emissive
// meshes. `powers`: luminance times area, some of it positive; triangles of power 0 are not chosen.
void add_triangle_choice(const ShapeTriangles& shape, const std::vector<ShapeTriangles>& meshes,
                         const std::vector<double>& powers, EmitterTable& table);

}  // namespace primray
