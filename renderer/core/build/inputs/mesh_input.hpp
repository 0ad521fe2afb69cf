// Input of a mesh.
#pragma once

#include <span>

#include "scene/scene.hpp"

namespace primray {

// Arrays of one mesh as given; all indices have been checked to be in range.
struct MeshInput {
  std::span<const float> points;       // 3 N
  std::span<const int32_t> triangles;  // 3 T
  std::span<const float> normals;      // empty, 3 N or 9 T
  std::span<const float> colors;       // empty, 3 T, 3 N or 9 T
  Attribute normal_kind = Attribute::kNone, color_kind = Attribute::kNone;
  std::span<const int32_t> surfaces;  // one, or one per triangle
  bool cutout = false;                // all of its surfaces have an opacity threshold, or none
  // Motion: the times of S + 1 steps, their points (3 N each) and, unless they are constant, normals.
  std::span<const float> times, step_points, step_normals;
};

}  // namespace primray
