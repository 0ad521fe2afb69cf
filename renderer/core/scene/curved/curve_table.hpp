// Tubes: cubic Bezier curves with a radius, swept by discs across their tangents. One row of the CurvedTable is many curves;
// Embree has their segments (accel/curve_geometry.cpp), and their ends.
//
// Each segment has four control points of its own, and extends slightly into its neighbours (kBeyond): Embree's roots are off
// by some millionths of a segment, which would otherwise let rays pass between two of them. Segments of a set are consecutive,
// so a segment's first point identifies it, and with its curve determines where primvar values are: of the 3 n + 1 control
// points of each curve as given, and of the n + 1 ends of its segments.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/features.hpp"

namespace primray {

// Extension of a segment, as a fraction of its parameter range.
constexpr float kBeyond = 0x1p-14f;

// Kinds of ends: discs at the ends of tubes, and joints where two segments meet at an angle, the part of a ball between both.
enum class CurveEndKind : int32_t { kStart = 0, kEnd = 1, kJoint = 2 };
struct CurveEnd {
  int32_t segment;  // by index over the scene; of a joint, the one that begins there
  CurveEndKind kind;
  uint32_t at, before, after;  // control points by index within the group; one of the latter two equals `at` at an end
};
constexpr int kCurveEndFields = 5;
static_assert(sizeof(CurveEnd) == kCurveEndFields * sizeof(int32_t));

// A group's curves, moving ones separately: by index over the scene.
struct CurveRange {
  uint32_t segment = 0, segments = 0, end = 0, ends = 0;
};
struct CurveGroup {
  uint32_t point_base = 0, point_count = 0;  // control points at one time
  uint32_t moving_points = 0;                // number of trailing points that move, stored again for each later time
  CurveRange still, moving;
  bool any() const { return still.segments + moving.segments > 0; }
};

struct CurveTable {
  std::vector<float> points;  // x, y, z, radius; four per segment
  // By segment: its first control point, by index within the group, and its run: consecutive segments of its curve with one
  // surface.
  std::vector<int32_t> first_point, run;
  std::vector<CurveEnd> ends;
  std::vector<int32_t> row, curve;  // by run: row of the CurvedTable, which has one for each surface of a set; curve within the
                                    // set
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
