// Flaws of real lenses beside distortion: vignetting and chromatic aberration.
#pragma once

#include <algorithm>
#include <cmath>

#include "math/vec3.hpp"

namespace primray {

struct LensFlaws {
  bool natural = false;                    // natural vignetting: light falls off with cos^4 of a ray's angle to the axis
  float rim_distance = 0, rim_radius = 0;  // mechanical vignetting: a second aperture at that distance before the lens, about
                                           // the axis; radius 0: none
  float magnification[3] = {1, 1, 1};      // scale of a channel's image about the axis
  float focus_shift[3] = {0, 0, 0};        // shift of a channel's plane of focus, away from the camera
  bool is_chromatic = false;               // the last two differ from their defaults

  bool any() const { return natural || rim_radius > 0 || is_chromatic; }

  // Share of the light of a ray from `o` on the lens along unit `d` that passes; the camera looks along -z.
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
