// A clock from times as they come from outside.
#pragma once

#include <cmath>
#include <span>

#include "motion/clock.hpp"

namespace primray {

inline MotionClock clock_of_times(std::span<const float> times) {
  MotionClock clock{{times.begin(), times.end()}, true};
  const float count = float(clock.segments());
  for (size_t k = 0; k < times.size(); ++k) clock.uniform &= std::fabs(times[k] * count - float(k)) < 1e-5f;
  return clock;
}

}  // namespace primray
