// Number of pixels that an edge of the cage covers, seen from the camera through the placements that matter most.
#pragma once

#include <algorithm>
#include <array>
#include <limits>
#include <span>
#include <vector>

#include "math/matrix.hpp"

namespace primray::subdivision {

// Camera that looks along -z in its own space: `pixels_per_unit` at unit distance, or everywhere if orthographic.
struct Projection {
  bool orthographic = false;
  double pixels_per_unit = 1;
  std::array<double, 4> window{};  // left, right, bottom, top, with its margin
  double outside = 1;              // factor of the edge length outside the view
};

// A placement that is evaluated exactly, from a camera that moves in a straight line.
struct View {
  daffine camera_from_object;  // where the camera starts
  dvec3 sweep{0.0};            // its displacement over the shutter, in its own space

  // Smallest distance of the camera from a point of its own space.
  double distance(const dvec3& p) const {
    const double ss = dot(sweep, sweep);
    return length(ss > 0 ? p - sweep * std::clamp(dot(p, sweep) / ss, 0.0, 1.0) : p);
  }
  // Smallest distance of the camera from a line from a to b.
  double distance(const dvec3& a, const dvec3& b) const;
};

struct Footprint {
  Projection projection;
  std::vector<View> views;
  double density = 0;  // largest number of pixels per unit of the object in all other placements
};

// Tests whether all of a face's corners, in camera space, are beyond one side of the view, and how far.
class OutsideTest {
 public:
  explicit OutsideTest(const Projection& p) : p_(p) { beyond_.fill(std::numeric_limits<double>::infinity()); }
  // Adds a corner, as seen along the camera's path.
  void add(const View& view, const dvec3& b) {
    add(b);
    if (dot(view.sweep, view.sweep) > 0) add(b - view.sweep);
  }

  bool is_outside() const { return farthest_beyond() > 0; }

  // Factor of the edge length: p.outside near the view, growing with the distance in view sizes beyond, so that a close view of
  // a part of a cage leaves the rest of it coarse.
  double allowance() const {
    if (!is_outside()) return 1;
    const double size = std::max(p_.window[1] - p_.window[0], p_.window[3] - p_.window[2]);
    return p_.outside * std::max(1.0, farthest_beyond() / std::max(size * (p_.orthographic ? 1 : farthest_), 1e-300));
  }

 private:
  void add(const dvec3& b) {
    const double depth = p_.orthographic ? 1 : -b.z;
    const double sides[5] = {p_.window[0] * depth - b.x, b.x - p_.window[1] * depth, p_.window[2] * depth - b.y,
                             b.y - p_.window[3] * depth, p_.orthographic ? 0 : -depth};
    for (size_t k = 0; k < beyond_.size(); ++k) beyond_[k] = std::min(beyond_[k], sides[k]);
    if (!p_.orthographic) farthest_ = std::max(farthest_, length(b));
  }
  const Projection& p_;
  std::array<double, 5> beyond_;  // of each side: minimum distance beyond it
  double farthest_ = 0;           // distance of a corner from a perspective camera
  double farthest_beyond() const { return *std::max_element(beyond_.begin(), beyond_.end()); }
};

inline double View::distance(const dvec3& a, const dvec3& b) const {
  const dvec3 d = b - a;
  const double dd = dot(d, d), ss = dot(sweep, sweep), ds = dot(d, sweep);
  const auto nearest = [&](const dvec3& q) { return dd > 0 ? std::clamp(-dot(q, d) / dd, 0.0, 1.0) : 0; };  // of a - q + t d
  if (!(ss > 0)) return length(a + d * nearest(a));
  // The nearest points of two lines are both inside, or one is an end: Lumelsky 1985, "On Fast Computation of Distance Between
  // Line Segments".
  double least = std::min({distance(a), distance(b), length(a + d * nearest(a)), length(a - sweep + d * nearest(a - sweep))});
  const double det = dd * ss - ds * ds;
  if (det > 1e-12 * dd * ss) {
    const double ad = dot(a, d), as = dot(a, sweep), t = (ds * as - ss * ad) / det, s = (dd * as - ds * ad) / det;
    if (t >= 0 && t <= 1 && s >= 0 && s <= 1) least = std::min(least, length(a + d * t - sweep * s));
  }
  return least;
}

// Largest number of pixels that an edge of a face covers; `corners`: its points, object space.
inline double face_pixels(const Footprint& print, std::span<const dvec3> corners) {
  double longest = 0;
  const size_t n = corners.size();
  if (print.density > 0)
    for (size_t i = 0; i < n; ++i)
      longest = std::max(longest, print.density * length(corners[i + 1 < n ? i + 1 : 0] - corners[i]));
  const Projection& p = print.projection;
  for (const View& view : print.views) {
    double pixels = 0;
    OutsideTest outside(p);
    dvec3 a = view.camera_from_object.point(corners[n - 1]);
    for (size_t i = 0; i < n; ++i) {
      const dvec3 b = view.camera_from_object.point(corners[i]);
      const double distance = p.orthographic ? 1 : view.distance(a, b);
      pixels = std::max(pixels, length(b - a) * p.pixels_per_unit / std::max(distance, 1e-300));
      outside.add(view, b);
      a = b;
    }
    longest = std::max(longest, pixels / outside.allowance());
  }
  return longest;
}

}  // namespace primray::subdivision
