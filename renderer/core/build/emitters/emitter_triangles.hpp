// How a shape's triangles are chosen: those that bring much to a point are likelier, by a tree as over lights
// (light/choice/tree.hpp).
#pragma once

#include <array>
#include <vector>

#include "math/vec3.hpp"

namespace primray {

struct Scene;
struct EmitterTable;

// The triangles of a shape, in its group's space.
struct ShapeTriangles {
  const Scene& scene;
  size_t first, count, vertex_base;
  // Where its vertices move: their later times, and from one time's to the next's.
  size_t later = 0, stride = 0;

  std::array<uint32_t, 3> indices(size_t triangle) const;
  std::array<dvec3, 3> corners(size_t triangle, size_t step = 0) const;
};

// Leaves of a shape's tree at most.
constexpr size_t kMostTriangleRuns = 1 << 16;

// Adds the choice among the shape's triangles to the table, after the other columns of its shape. `meshes`: those of it that
// emit. `powers`: luminance times area, some of it positive; triangles of power 0 are not chosen.
void add_triangle_choice(const ShapeTriangles& shape, const std::vector<ShapeTriangles>& meshes,
                         const std::vector<double>& powers, EmitterTable& table);

}  // namespace primray
