// Emitting shapes that are rectangles of two triangles, as panels of lamps are: they are sampled as one
// (emitter/mesh_rectangle.hpp).
#pragma once

#include <vector>

#include "build/emitters/emitter_triangles.hpp"
#include "math/matrix.hpp"

namespace primray {

// Two triangles that are halves of one parallelogram, in their group's space.
struct ShapeHalves {
  // The corner opposite to the shared edge: its number in the first triangle, and 3 times that in the second; -1: no such
  // shape.
  int corners = -1;
  dvec3 x{0.0}, y{0.0};  // half the edges of the first triangle from that corner, in its order
};

// `powers`: of the triangles, both positive in what is found.
ShapeHalves find_halves(const ShapeTriangles& shape, const std::vector<double>& powers);

// Writes what makes a light row a rectangle, if its shape is one where its group stands so.
bool put_rectangle(const ShapeHalves& halves, const daffine& world_from_group, float* row);

}  // namespace primray
