// Times at which something that moves is known, and where a ray's time lies among them.
#pragma once

#include <algorithm>
#include <vector>

namespace primray {

struct Moment {
  int segment;
  float within;  // how much of the segment has passed, [0, 1]
};

struct MotionClock {
  std::vector<float> times;  // ascending, from 0 to 1
  bool uniform = true;       // all segments are of one length, which Embree's are

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
  // The time at which this moment would be if all segments were of one length.
  float even(float time) const {
    const Moment m = at(time);
    return (float(m.segment) + m.within) / float(segments());
  }
};

}  // namespace primray
