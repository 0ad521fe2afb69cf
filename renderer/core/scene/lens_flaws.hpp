// What real lenses do to light beside distorting it: they pass less of it off the axis, and bend colours differently.
#pragma once

#include <algorithm>
#include <cmath>

#include "math/vec3.hpp"

namespace primray {

struct LensFlaws {
  bool natural = false;                    // light falls with cos^4 of a ray's angle to the axis
  float rim_distance = 0, rim_radius = 0;  // a second opening so far before the lens, about the axis; radius 0: none
  float magnification[3] = {1, 1, 1};      // of a channel's image about the axis
  float focus_shift[3] = {0, 0, 0};        // of a channel's plane of focus, away from the camera
  bool is_chromatic = false;               // the last two differ from what they are here

  bool any() const { return natural || rim_radius > 0 || is_chromatic; }

  // What of the light of a ray from `o` on the lens along `d` of unit length gets through; the camera looks along -z.
  float passed(const vec3& o, const vec3& d) const {
    if (rim_radius > 0) {
      if (!(d.z < 0)) return 0;
      const float t = rim_distance / -d.z, x = o.x + t * d.x, y = o.y + t * d.y;
      if (!(x * x + y * y <= rim_radius * rim_radius)) return 0;
    }
    if (!natural) return 1;
    const float c = std::max(-d.z, 0.0f);
    return c * c * c * c;
  }
};

}  // namespace primray
