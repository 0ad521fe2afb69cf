// Construction of the EmitterTable: emissive meshes become shapes, each with a choice among its triangles, and every placement
// of a shape becomes a light row.
#pragma once

#include <array>
#include <vector>

#include "math/box.hpp"
#include "math/matrix.hpp"
#include "math/vec3.hpp"
#include "scene/scene.hpp"

namespace primray {

// Choice among a shape's triangles: those that contribute much to a point are likelier, by a light tree
// (light/tree/light_tree.hpp).

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

// Emissive shapes that are rectangles of two triangles, such as panels of lamps: sampled as a rectangle
// (light/mesh/mesh_light.hpp).

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

// Shapes of the EmitterTable: emissive meshes, some of them merged, and their weights in light selection.

// Mean emitted radiance of a surface, before the division by its area: `light` is its index in Scene::geometry_lights, or -1.
vec3 average_radiance(const Scene& s, int32_t surface, int32_t light);
vec3 average_radiance_of_mesh(const Scene& s, size_t row);

// Weight of a shape in light selection, in its group's space.
struct ShapeWeight {
  double power = 0;  // area times luminance
  DoubleBox box;
  ShapeHalves halves;
  int32_t light = -1;  // in Scene::geometry_lights

  dvec3 center() const { return (box.low + box.high) * 0.5; }
  double radius() const { return 0.5 * length(box.high - box.low); }
};

// Triangles `first` to `end` of the scene, and the rows of the MeshTable from `row` to `next` that they belong to.
struct EmittingMesh {
  size_t first, end, row, next;
};

// Converts the emissive meshes of a group to shapes: consecutive meshes that interpenetrate are merged, since their bounding
// spheres could not be distinguished. Geometry lights, rectangles, and shapes too large for a tree stay separate.
class ShapeMaker {
 public:
  ShapeMaker(Scene& s, const Group& group, std::vector<ShapeWeight>& weights)
      : s_(s), group_(group), weights_(weights), group_first_(s.emitters.first.size()) {}

  void add(const EmittingMesh& mesh);
  void finish();  // after the last mesh

 private:
  bool moves(size_t triangle) const;
  ShapeTriangles triangles(size_t first, size_t end) const;
  bool joins(const EmittingMesh& mesh, const ShapeWeight& w) const;

  Scene& s_;
  const Group& group_;
  std::vector<ShapeWeight>& weights_;
  const size_t group_first_;
  std::vector<EmittingMesh> meshes_;
  ShapeWeight weight_;  // of the merged meshes
};

// Finds emissive geometry and adds its rows to the scene's lights; after the last shape and placement.
void build_emitters(Scene& scene);

}  // namespace primray
