// Dicing: converts a control cage to triangles whose vertices are on its limit surface, as fine as its footprint in the image
// requires.
//
// Levels are created one after the other: a face is refined while one of its edges covers too many pixels and it is not flat
// (flatness.hpp), and takes its neighbours along as far as its masks depend on them. Each vertex is moved to its limit at the
// level where it first appears, whatever the levels around it, so that neighbours agree on it to the bit. Where materials
// displace it (mover.hpp), edges count with their displaced length.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "subdivision/cage.hpp"
#include "subdivision/dicing/footprint.hpp"
#include "subdivision/dicing/level.hpp"
#include "subdivision/dicing/mover.hpp"

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
  std::span<const float> steps;           // points again at each of the motion sample times, if they move
  std::span<const float> vertex_values;   // smooth, like points
  std::span<const float> varying_values;  // linear over each face
  int vertex_width = 0, varying_width = 0;
  std::vector<FaceVarying> face_varying;
  Footprint footprint;
  double pixels = 1;          // maximum length of edges, except of flat faces
  double flatness = 0.1;      // maximum error of flat faces in pixels; 0: no face counts as flat
  bool faces_differ = false;  // in what they carry: their outlines are visible
  int min_level = 0, max_level = 0;
  int64_t max_triangles = 0;
  std::optional<Displacing> displacing;  // no face is flat then
};

struct Diced {
  std::vector<float> points, normals, vertex_values, varying_values;
  std::vector<std::vector<float>> step_points, step_normals;  // like points and normals, by time
  std::vector<std::vector<float>> face_varying;
  Triangles triangles;
  int level = 0;  // the finest
  bool is_level_limited = false;
  bool is_complete = true;  // false: more than max_triangles, and nothing else is set
  int non_manifold_edges = 0, unknown_creases = 0;
};

Diced dice(const DiceInput& input);

// Estimates the number of triangles that dice() creates: a few levels are refined, and their faces extrapolated to finer ones.
int64_t estimated_triangles(const DiceInput& input);

}  // namespace primray::subdivision
