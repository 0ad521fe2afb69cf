// Shapes of the EmitterTable: emissive meshes, some of them merged, and their weights in light selection.
#pragma once

#include <vector>

#include "build/emitters/emitter_rectangles.hpp"
#include "math/box.hpp"
#include "scene/scene.hpp"

namespace primray {

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

}  // namespace primray
