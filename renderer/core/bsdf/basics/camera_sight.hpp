// Visibility of surfaces to the camera, directly or through transmissive surfaces: render passes hide shapes from it, or make
// them mattes (holdouts).
#pragma once

#include <cstdint>
#include <vector>

#include "math/lanes.hpp"

namespace primray {

enum class CameraSight : int32_t { kSeen, kHidden, kMatte };

// By surface; empty if all are visible.
struct CameraSights {
  std::vector<int32_t> of_surface;

  bool any() const { return !of_surface.empty(); }
  // Adds the next surface.
  void add(size_t surface, CameraSight sight) {
    if (sight != CameraSight::kSeen) of_surface.resize(surface, 0);
    if (sight != CameraSight::kSeen || any()) of_surface.push_back(int32_t(sight));
  }
  template <int W>
  vbool<W> are(CameraSight sight, vbool<W> m, vint<W> surface) const {
    if (!any()) return vbool<W>(false);
    return m & (gather<W>(of_surface.data(), select(m, surface, vint<W>(0))) == vint<W>(int32_t(sight)));
  }
};

}  // namespace primray
