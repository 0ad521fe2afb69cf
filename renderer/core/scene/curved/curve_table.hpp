// Tubes: cubic Bezier curves with a radius, discs across their tangents swept along them. One row of the CurvedTable is many
// curves; Embree has their segments (accel/curve_geometry.cpp), and what closes them.
//
// Each segment has four control points of its own, and goes on a little into its neighbours (kBeyond): Embree's roots
// are off by some millionths of a segment, which else let rays through between two of them. Segments of a set stand one after
// the other, so a segment's first point says which it is, and with its curve where values stand: of the 3 n + 1 control points
// of each curve as it was given, and of the n + 1 ends of its segments.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/features.hpp"

namespace primray {

// How far a segment goes on, in parts of its parameter.
constexpr float kBeyond = 0x1p-14f;

// What closes tubes: discs at their ends, and where two segments meet at an angle the part of a ball between both.
enum class CurveEndKind : int32_t { kStart = 0, kEnd = 1, kJoint = 2 };
struct CurveEnd {
  int32_t segment;  // counted over the scene; of a joint, the one that begins there
  CurveEndKind kind;
  uint32_t at, before, after;  // control points counted within the group; one of the latter two is `at` itself at an end
};
constexpr int kCurveEndFields = 5;
static_assert(sizeof(CurveEnd) == kCurveEndFields * sizeof(int32_t));

// A group's curves, those that move apart: counted over the scene.
struct CurveRange {
  uint32_t segment = 0, segments = 0, end = 0, ends = 0;
};
struct CurveGroup {
  uint32_t point_base = 0, point_count = 0;  // control points at one time
  uint32_t moving_points = 0;                // the last of them, which stand again for each later time
  CurveRange still, moving;
  bool any() const { return still.segments + moving.segments > 0; }
};

struct CurveTable {
  std::vector<float> points;  // x, y, z, radius; four a segment
  // By segment: its first control point, counted within the group, and the run of its curve's segments that wear one surface.
  std::vector<int32_t> first_point, run;
  std::vector<CurveEnd> ends;
  std::vector<int32_t> row, curve;  // by run: of the CurvedTable, which has one for each surface of a set; within the set
  // By row of the CurvedTable, from the first row of curves on: the set's first control point within the group.
  uint32_t first_row = 0;
  std::vector<int32_t> set_point;

  Fact<built::kCurves> any = false;

  void shrink() {
    points.shrink_to_fit(), first_point.shrink_to_fit(), run.shrink_to_fit(), ends.shrink_to_fit();
    row.shrink_to_fit(), curve.shrink_to_fit();
  }
};

}  // namespace primray
