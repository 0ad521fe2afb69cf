// A control cage to triangles whose vertices lie on its limit surface, as fine as its footprint on the image asks.
//
// Levels are made one after the other: a face goes on while one of its edges covers too many pixels and it is not flat
// (flatness.hpp), and takes its neighbours along as far as its masks rest on them. Each vertex goes to its limit at the level
// where it first appears, whatever the levels around it, so that neighbours agree on it to the bit. Where materials displace it
// (mover.hpp), edges count as long as they are then.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "subdivision/cage.hpp"
#include "subdivision/dicing/footprint.hpp"
#include "subdivision/dicing/mover.hpp"
#include "subdivision/dicing/stitch.hpp"
#include "subdivision/face_varying.hpp"

namespace primray::subdivision {

struct FaceVarying {
  std::span<const int32_t> indices;  // of each corner of the cage, its row
  std::span<const float> values;
  int width = 1;
};

struct DiceInput {
  CageInput cage;
  LinearRule rule = LinearRule::kCornersPlus1;
  std::span<const float> points;
  std::span<const float> steps;           // the points again at each of the times at which they are known, if they move
  std::span<const float> vertex_values;   // smooth, as points are
  std::span<const float> varying_values;  // linear over each face
  int vertex_width = 0, varying_width = 0;
  std::vector<FaceVarying> face_varying;
  Footprint footprint;
  double pixels = 1;          // the longest that edges may be, except of flat faces
  double flatness = 0.1;      // pixels that flat faces may be off; 0: there are none
  bool faces_differ = false;  // in what they carry: their outlines show
  int min_level = 0, max_level = 0;
  int64_t max_triangles = 0;
  std::optional<Displacing> displacing;  // no face is flat then
};

struct Diced {
  std::vector<float> points, normals, vertex_values, varying_values;
  std::vector<std::vector<float>> step_points, step_normals;  // as points and normals, by time
  std::vector<std::vector<float>> face_varying;
  Triangles triangles;
  int level = 0;  // the finest
  bool is_level_limited = false;
  bool is_complete = true;  // false: more than max_triangles, and nothing else is set
  int non_manifold_edges = 0, unknown_creases = 0;
};

Diced dice(const DiceInput& input);

// Triangles that dice() makes, roughly: a few levels are made, faces count by what these say about finer ones.
int64_t estimated_triangles(const DiceInput& input);

}  // namespace primray::subdivision
