// Emissive shapes that are rectangles of two triangles, such as panels of lamps: sampled as a rectangle
// (emitter/mesh_rectangle.hpp).
#pragma once

#include <vector>

#include "build/emitters/emitter_triangles.hpp"
#include "math/matrix.hpp"

namespace primray {

// Two triangles that are halves of one parallelogram, in their group's space.
struct ShapeHalves {
  // Corner opposite to the shared edge: its index in the first triangle, plus 3 times that in the second; -1: not such a shape.
  int corners = -1;
  dvec3 x{0.0}, y{0.0};  // half the edges of the first triangle from that corner, in its order
};

// `powers`: of the triangles; both are positive in a result.
ShapeHalves find_halves(const ShapeTriangles& shape, const std::vector<double>& powers);

// Writes the fields of a rectangle to a light row, if the shape is one in this placement of its group.
bool put_rectangle(const ShapeHalves& halves, const daffine& world_from_group, float* row);

}  // namespace primray
