// How many pixels an edge of the cage covers, seen from the camera through the placements that count most.
#pragma once

#include <algorithm>
#include <array>
#include <limits>
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

// Whether all of a face's corners, in the camera's space, lie beyond one side of the view, and how far.
class OutsideTest {
 public:
  explicit OutsideTest(const Projection& p) : p_(p) { beyond_.fill(std::numeric_limits<double>::infinity()); }
  void add(const dvec3& b) {
    const double depth = p_.orthographic ? 1 : -b.z;
    const double sides[5] = {p_.window[0] * depth - b.x, b.x - p_.window[1] * depth, p_.window[2] * depth - b.y,
                             b.y - p_.window[3] * depth, p_.orthographic ? 0 : -depth};
    for (size_t k = 0; k < beyond_.size(); ++k) beyond_[k] = std::min(beyond_[k], sides[k]);
    if (!p_.orthographic) farthest_ = std::max(farthest_, length(b));
  }
  bool is_outside() const { return farthest_beyond() > 0; }

  // How many times longer its edges may be: p.outside near the view, further off growing with the distance in pictures, so
  // that a close look at a part of a cage leaves the rest of it coarse.
  double allowance() const {
    if (!is_outside()) return 1;
    const double size = std::max(p_.window[1] - p_.window[0], p_.window[3] - p_.window[2]);
    return p_.outside * std::max(1.0, farthest_beyond() / std::max(size * (p_.orthographic ? 1 : farthest_), 1e-300));
  }

 private:
  const Projection& p_;
  std::array<double, 5> beyond_;  // of each side: by how much at least
  double farthest_ = 0;           // corner from a camera in perspective
  double farthest_beyond() const { return *std::max_element(beyond_.begin(), beyond_.end()); }
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
    longest = std::max(longest, pixels / outside.allowance());
  }
  return longest;
}

}  // namespace primray::subdivision
