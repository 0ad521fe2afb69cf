// What the camera sees of surfaces, straight or through what is see-through: render passes hide shapes from it, or hold them
// out.
#pragma once

#include <cstdint>
#include <vector>

#include "math/lanes.hpp"

namespace primray {

enum class CameraSight : int32_t { kSeen, kHidden, kMatte };

// By surface; empty where all are seen.
struct CameraSights {
  std::vector<int32_t> of_surface;

  bool any() const { return !of_surface.empty(); }
  // Of the next surface.
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
