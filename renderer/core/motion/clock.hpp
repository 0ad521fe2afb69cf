// Motion sample times of an object, and the position of a ray's time among them.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

namespace primray {

struct Moment {
  int segment;
  float within;  // fraction of the segment, [0, 1]
};

struct MotionClock {
  std::vector<float> times;  // ascending, from 0 to 1
  bool uniform = true;       // all segments have the same length, as Embree's do

  int segments() const { return int(times.size()) - 1; }
  Moment at(float time) const {
    const int count = segments();
    if (uniform) {
      const float x = time * float(count);
      const int k = std::clamp(int(x), 0, count - 1);
      return {k, x - float(k)};
    }
    const auto after = std::upper_bound(times.begin() + 1, times.begin() + count, time);
    const int k = int(after - times.begin()) - 1;
    return {k, (time - times[k]) / (times[k + 1] - times[k])};
  }
  // Maps a time to where it would be if all segments had the same length.
  float even(float time) const {
    const Moment m = at(time);
    return (float(m.segment) + m.within) / float(segments());
  }
};

// Makes a clock from input times and determines whether they are evenly spaced: exactly so, or not at all.
inline MotionClock clock_of_times(std::span<const float> times) {
  MotionClock clock{{times.begin(), times.end()}, true};
  const float count = float(clock.segments());
  for (size_t k = 0; k < times.size(); ++k) clock.uniform &= times[k] == float(k) / count;
  return clock;
}

}  // namespace primray
