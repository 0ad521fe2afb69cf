// Input of curves.
#pragma once

#include <cstdint>
#include <span>

namespace primray {

// C curves with N control points in total: cubic Bezier segments; a curve of n segments has 3 n + 1 points.
struct CurvesInput {
  std::span<const float> points;      // 4 N: x, y, z and radius, in object space; similarity transforms scale radii
  std::span<const int32_t> segments;  // C, at least 1 each
  std::span<const int32_t> surfaces;  // one, or one per segment, -1 where it is not drawn
  bool closed = false;                // the last point of each is its first
  bool joined = false;                // segments may meet at angles
  // Motion: the times of S + 1 steps, and their points (4 N each).
  std::span<const float> times, step_points;
};

}  // namespace primray
