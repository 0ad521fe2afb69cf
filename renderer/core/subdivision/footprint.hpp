// How many pixels an edge of the cage covers, seen from the camera through the placements that count most.
#pragma once

#include <algorithm>
#include <array>
#include <span>
#include <vector>

#include "math/matrix.hpp"

namespace primray::subdivision {

// A camera that looks along -z, from its own space: `pixels_per_unit` at unit distance, or everywhere if orthographic.
struct Projection {
  bool orthographic = false;
  double pixels_per_unit = 1;
  std::array<double, 4> window{};  // left, right, bottom, top, with its margin
  double outside = 1;              // edges may be so many times longer where the camera does not look
};

struct Footprint {
  Projection projection;
  std::vector<daffine> views;  // camera_from_object of each placement looked at exactly
  double density = 0;          // pixels a unit of the object covers at most in all other placements
};

// Whether all of a face's corners, in the camera's space, lie beyond one side of the view.
class OutsideTest {
 public:
  explicit OutsideTest(const Projection& p) : p_(p), out_{true, true, true, true, !p.orthographic} {}
  void add(const dvec3& b) {
    const double depth = p_.orthographic ? 1 : -b.z;
    out_[0] &= b.x<p_.window[0] * depth, out_[1] &= b.x> p_.window[1] * depth;
    out_[2] &= b.y<p_.window[2] * depth, out_[3] &= b.y> p_.window[3] * depth;
    out_[4] &= depth < 0;
  }
  bool is_outside() const { return out_[0] || out_[1] || out_[2] || out_[3] || out_[4]; }

 private:
  const Projection& p_;
  bool out_[5];
};

// The most pixels that an edge of a face covers; `corners`: its points, object space.
inline double face_pixels(const Footprint& print, std::span<const dvec3> corners) {
  double longest = 0;
  const size_t n = corners.size();
  if (print.density > 0)
    for (size_t i = 0; i < n; ++i)
      longest = std::max(longest, print.density * length(corners[i + 1 < n ? i + 1 : 0] - corners[i]));
  const Projection& p = print.projection;
  for (const daffine& view : print.views) {
    double pixels = 0;
    OutsideTest outside(p);
    dvec3 a = view.point(corners[n - 1]);
    for (size_t i = 0; i < n; ++i) {
      const dvec3 b = view.point(corners[i]), d = b - a;
      double distance = 1;
      if (!p.orthographic) {  // of the edge's nearest point
        const double dd = dot(d, d), at = dd > 0 ? std::clamp(-dot(a, d) / dd, 0.0, 1.0) : 0;
        distance = length(a + d * at);
      }
      pixels = std::max(pixels, length(d) * p.pixels_per_unit / std::max(distance, 1e-300));
      outside.add(b);
      a = b;
    }
    longest = std::max(longest, outside.is_outside() ? pixels / p.outside : pixels);
  }
  return longest;
}

}  // namespace primray::subdivision
