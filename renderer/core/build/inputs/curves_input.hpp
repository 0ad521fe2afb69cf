// Curves as the builder takes them.
#pragma once

#include <cstdint>
#include <span>

namespace primray {

// C curves of N control points in all: cubic Bezier segments, of which each curve has 3 n + 1 points for n segments.
struct CurvesInput {
  std::span<const float> points;      // 4 N: x, y, z and radius, in object space; a similarity takes radii along
  std::span<const int32_t> segments;  // C, at least 1 each
  std::span<const int32_t> surfaces;  // one, or one a segment, -1 where it is not drawn
  bool closed = false;                // the last point of each is its first
  bool joined = false;                // segments may meet at angles
  // Where they move: the times of S + 1 steps, and their points (4 N each).
  std::span<const float> times, step_points;
};

}  // namespace primray
