// Geometry that emits, sampled as lights: which shapes (meshes that lie among each other are one), how their triangles are
// chosen, and which rows of the LightTable are theirs. A shape in a prototype has a row for every instance. Shapes that are
// lights by themselves give what geometry_light_table.hpp says.
#pragma once

#include <cstdint>
#include <vector>

#include "base/features.hpp"
#include "light/light.hpp"

namespace primray {

// More emitting instances than this are met by rays alone: a row each would cost more memory than the noise is worth.
constexpr int32_t kMaxEmitterRows = 1 << 18;

struct EmitterTable {
  // One a shape, the shapes of a group together: its first triangle (of the scene) and their number, its group's first vertex;
  // a sphere has no triangles, and its row of the CurvedTable in `first`.
  std::vector<int32_t> first, count, vertex_base;
  std::vector<int32_t> corners;  // ShapeHalves::corners
  // The clock of its vertices and from one time's to the next's, in vertices; -1: they do not move.
  std::vector<int32_t> clock, stride;
  // How triangles are chosen where a row is no rectangle (emitter_triangles.hpp): in runs of 2^run_shift, 0 as a rule, by the
  // tree from `root`, which stands in the space of the shape's group; its leaves are runs, counted in the shape, whose places
  // begin at place_base.
  LightTable by_place;  // a tree and nothing else
  std::vector<int32_t> root, place_base, run_shift;
  // In runs of several by area and luminance: count + 1 numbers from 0 to kWhole a shape, beginning at cdf_base. They are whole
  // numbers, so that the probability of a choice is known exactly for meshes of any size.
  std::vector<int32_t> cdf, cdf_base;
  static constexpr int32_t kWhole = 1 << 30;

  // Of what emits in instances that move: by light row, the instance's row of Scene::world_from_group, -1 where it stands
  // still; by shape, the frame of its light in its group (a sphere's: that of the unit sphere). Empty where nothing moves.
  std::vector<int32_t> moving_instance;
  std::vector<daffine> frames;

  // A shape's number in its group, by row of the MeshTable and of the CurvedTable; -1: it does not emit.
  std::vector<int32_t> of_mesh, of_curved;
  // First light row and rows an instance, of what is static and of each placement; -1: none, or not sampled.
  int32_t static_light = -1;
  std::vector<int32_t> placement_light, placement_rows;
  int64_t shapes = 0;                       // of the scene that emit; several meshes may be one shape here
  bool rectangles = false, others = false;  // rows of meshes that are rectangles, and that are not
  int64_t unsampled = 0;                    // emitting instances beyond kMaxEmitterRows

  bool any() const { return built::kEmission && !first.empty(); }
  bool any_moving() const { return built::kEmission && built::kMotion && !moving_instance.empty(); }
  bool by_triangle() const { return built::kEmission && others; }
};

}  // namespace primray
