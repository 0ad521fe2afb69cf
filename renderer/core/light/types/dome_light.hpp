// Dome light as a light type: its row. Its image and how that is sampled are in light/dome/.
#pragma once

#include "light/types/light_type.hpp"

namespace primray {

struct DomeLight : LightTypeDefaults {
  static constexpr LightType kType = LightType::kDome;
  static constexpr const char* kName = "DOME";

  template <int W>
  static PRIMRAY_INLINE vfloat<W> importance(const float*, const vvec3<W>&, vfloat<W>, vfloat<W> power) {
    return power;
  }
  static dvec3 far_direction(const float*) { return dvec3(0.0); }
  static double far_half_extent(const float*) { return 4.0; }
};

}  // namespace primray
