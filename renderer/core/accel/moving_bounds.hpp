// Boxes around instances that move, at even times between which Embree takes boxes to be linear.
#pragma once

#include "embree/embree.hpp"
#include "motion/motion_table.hpp"

namespace primray {

// Around the image of `b`, wider by `more`, and a little for the rounding of rays.
rtc::Bounds bounds_around(const daffine& m, const rtc::Bounds& b, double more);

// How many segments Embree is told of.
int bound_segments(const MotionTable& table, const MovingInstances& moving);
// At the beginning of segment `step` of so many, or the end of the last, of instance `instance`, whose group is in `b`: so wide
// that what lies between two steps' boxes holds the instance at all times between.
rtc::Bounds moving_bounds(const MotionTable& table, const MovingInstances& moving, int segments, uint32_t instance,
                          uint32_t step, const rtc::Bounds& b);

}  // namespace primray
