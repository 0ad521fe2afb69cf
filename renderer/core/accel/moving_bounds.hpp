// Bounding boxes of moving instances, at evenly spaced times between which Embree interpolates them linearly.
#pragma once

#include "embree/embree.hpp"
#include "motion/motion_table.hpp"

namespace primray {

// Box around the image of `b`, wider by `more`, and slightly wider for the rounding of rays.
rtc::Bounds bounds_around(const daffine& m, const rtc::Bounds& b, double more);

// Number of time segments for Embree.
int bound_segments(const MotionTable& table, const MovingInstances& moving);
// Box at the beginning of segment `step` of `segments`, or at the end of the last, of instance `instance` whose group has the
// bounds `b`: wide enough for boxes interpolated between two steps to hold the instance at all times between.
rtc::Bounds moving_bounds(const MotionTable& table, const MovingInstances& moving, int segments, uint32_t instance,
                          uint32_t step, const rtc::Bounds& b);

}  // namespace primray
