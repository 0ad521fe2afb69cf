// Coverage of samples while their paths are followed: 1 for what the camera meets, less what comes to nothing straight through
// it.
#pragma once

namespace primray {

// Camera rays that have passed nothing but gaps (surfaces that are not there, or that the camera does not see) see the sky as
// through a hole. The coverage of their samples is more by kGapMark meanwhile.
constexpr float kThroughGaps = 3, kGapMark = 4;

inline float finished_coverage(float a) { return a >= kThroughGaps ? a - kGapMark : a; }

}  // namespace primray
