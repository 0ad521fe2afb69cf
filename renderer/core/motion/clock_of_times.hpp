// Makes a clock from input times and determines whether they are evenly spaced: exactly so, or not at all.
#pragma once

#include <span>

#include "motion/clock.hpp"

namespace primray {

inline MotionClock clock_of_times(std::span<const float> times) {
  MotionClock clock{{times.begin(), times.end()}, true};
  const float count = float(clock.segments());
  for (size_t k = 0; k < times.size(); ++k) clock.uniform &= times[k] == float(k) / count;
  return clock;
}

}  // namespace primray
