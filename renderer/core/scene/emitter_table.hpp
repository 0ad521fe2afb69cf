// Emissive geometry that is sampled as lights: its shapes (interpenetrating meshes are one), the choice among their triangles,
// and their rows of the LightTable. A shape in a prototype has a row for every instance. Geometry lights have further data in
// the second part of this file.
#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "base/features.hpp"
#include "light/light.hpp"
#include "light/light_options.hpp"

namespace primray {

// Geometry with UsdLux LightAPI or MeshLightAPI, beside the emission of its material.
//
// The light that it emits (to light samples, and to scattered rays that hit it) is its material's emission times `radiance`, or
// `radiance` alone (`own`); as a body (to camera rays, and those after mirrors or refraction) it shows the material's emission,
// or, if `shown`, the light that it emits. With `normalize` all of that is divided by the world-space area of the shape.
struct GeometryLight {
  vec3 radiance{1.0f, 1.0f, 1.0f};
  bool own = false, shown = false, normalize = false;
  LightRules rules;
  daffine group_from_object{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, dvec3(0.0)};
  std::vector<float> row;  // light row with the fields of any light: lobe factors
  std::optional<ShapingInput> shaping;
  // Its parts in its group: triangles [first, end), by index over the scene, or a curved shape.
  std::vector<std::pair<size_t, size_t>> triangles;
  int32_t curved = -1;  // its row of the CurvedTable
};

struct GeometryLights {
  std::vector<GeometryLight> all;
  std::vector<int32_t> of_mesh, of_curved;  // index of the light by row of the MeshTable and of the CurvedTable, or -1; may be
                                            // shorter than these
  // By light, for rays that hit it: kOwn and kShown; lobe factors; `radiance`, with the area in its first placement.
  std::vector<int32_t> flags;
  std::vector<int32_t> link;  // collection that it illuminates
  std::vector<int32_t> ends;  // see LightTable::ends
  std::vector<float> diffuse, specular, radiance;
  enum : int32_t { kOwn = 1, kShown = 2 };

  bool any() const { return built::kEmission && !all.empty(); }
  int32_t mesh(size_t row) const { return row < of_mesh.size() ? of_mesh[row] : -1; }
  int32_t curved(size_t row) const { return row < of_curved.size() ? of_curved[row] : -1; }
};

// Maximum number of emissive instances that are sampled; more are found by rays alone, since a row each would cost more memory
// than the noise is worth.
constexpr int32_t kMaxEmitterRows = 1 << 18;

struct EmitterTable {
  // By shape, with the shapes of a group together: its first triangle (of the scene), their number, and its group's first
  // vertex; a sphere has no triangles, and its row of the CurvedTable in `first`.
  std::vector<int32_t> first, count, vertex_base;
  std::vector<int32_t> corners;  // see ShapeHalves::corners
  // Motion samples of its vertices and the stride between times, in vertices; -1: no motion.
  std::vector<int32_t> clock, stride;
  // Choice among triangles where a row is not a rectangle (emitter_triangles.cpp): by runs of 2^run_shift triangles, usually 1,
  // from the tree with root `root`, in the space of the shape's group; its leaves are runs, counted in the shape, whose
  // positions begin at place_base.
  LightTable by_place;  // holds a tree only
  std::vector<int32_t> root, place_base, run_shift;
  // Choice within runs of several triangles by area and luminance: count + 1 integers from 0 to kWhole per shape, beginning at
  // cdf_base. They are integers, so that the probability of a choice is exact for meshes of any size.
  std::vector<int32_t> cdf, cdf_base;
  static constexpr int32_t kWhole = 1 << 30;

  // Moving emitters: by light row, the instance's row of Scene::world_from_group, -1 if static; by shape, the frame of its
  // light in its group (of a sphere: that of the unit sphere). Empty if nothing moves.
  std::vector<int32_t> moving_instance;
  std::vector<daffine> frames;

  // Index of a shape in its group, by row of the MeshTable and of the CurvedTable; -1: it does not emit.
  std::vector<int32_t> of_mesh, of_curved;
  // First light row and rows per instance, of static geometry and of each placement; -1: none, or not sampled.
  int32_t static_light = -1;
  std::vector<int32_t> placement_light, placement_rows;
  int64_t shapes = 0;                       // emissive shapes of the scene; several meshes may be one shape here
  bool rectangles = false, others = false;  // rows of meshes that are rectangles, and that are not
  int64_t unsampled = 0;                    // emissive instances beyond kMaxEmitterRows

  bool any() const { return built::kEmission && !first.empty(); }
  bool any_moving() const { return built::kEmission && built::kMotion && !moving_instance.empty(); }
  bool by_triangle() const { return built::kEmission && others; }
};

}  // namespace primray
