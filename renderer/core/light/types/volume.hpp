// Emission in a grid as a light type: its row, by which it is chosen. How points of it are sampled is in
// light/sampler/volume_point.hpp.
#pragma once

#include "light/types/light_type.hpp"

namespace primray {

// The row has the centre of the box in kOrigin, its half diagonal in kSize0, and in kImportance the luminance of the integral
// over the volume of the radiance per length, which is its radiant intensity from afar.
struct VolumeLight : LightTypeDefaults {
  static constexpr LightType kType = LightType::kVolume;
  static constexpr const char* kName = "VOLUME";
  // Squared distance from the centre, in squared half diagonals, below which a point counts as within.
  static constexpr float kWithin = 0.1f;

  template <int W>
  static PRIMRAY_INLINE vfloat<W> importance(const float* row, const vvec3<W>&, vfloat<W> d2, vfloat<W> power) {
    return power / max(d2, kWithin * row[kSize0] * row[kSize0]);
  }
  static double half_extent(const float* row, int) { return row[kSize0]; }
  static double bounding_radius(const float* row) { return row[kSize0]; }
  static TreeBounds tree_bounds(const float* row, LightBounds&) {
    return {1.0, kWithin * double(row[kSize0]) * double(row[kSize0])};
  }
};

}  // namespace primray
