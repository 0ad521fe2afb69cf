// Alpha of a sample while its path is traced: 1 once the camera ray hits something, minus the part that escapes straight
// through it.
#pragma once

namespace primray {

// A camera ray that has passed only gaps (cutouts, or surfaces hidden from the camera) sees the background as if through a
// hole. Until it hits something, kGapMark is added to its sample's coverage to mark it.
constexpr float kThroughGaps = 3, kGapMark = 4;

inline float finished_coverage(float a) { return a >= kThroughGaps ? a - kGapMark : a; }

}  // namespace primray
