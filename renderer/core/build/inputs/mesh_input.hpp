// A mesh as it comes from outside.
#pragma once

#include <span>

#include "scene/scene.hpp"

namespace primray {

// One mesh's arrays as they come from outside; all indices have been checked to be in range.
struct MeshInput {
  std::span<const float> points;       // 3 N
  std::span<const int32_t> triangles;  // 3 T
  std::span<const float> normals;      // empty, 3 N or 9 T
  std::span<const float> colors;       // empty, 3 T, 3 N or 9 T
  Attribute normal_kind = Attribute::kNone, color_kind = Attribute::kNone;
  std::span<const int32_t> surfaces;  // one, or one a triangle
  bool cutout = false;                // all of its surfaces have an opacity threshold, or none
  // Where it moves: the times of S + 1 steps, their points (3 N each) and, unless they are held, normals.
  std::span<const float> times, step_points, step_normals;
};

}  // namespace primray
