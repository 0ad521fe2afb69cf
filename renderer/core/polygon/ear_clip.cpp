// Ear clipping in the plane of the polygon's Newell normal.
#include "polygon/ear_clip.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace primray {
namespace {

class Clipping {
 public:
  Clipping(std::span<const dvec3> polygon, std::vector<int32_t>& triangles) : triangles_(triangles), ring_(polygon.size()) {
    std::iota(ring_.begin(), ring_.end(), 0);
    project(polygon);
  }

  void clip() {
    drop_flat(0, int(ring_.size()));
    size_t at = 0, misses = 0;
    while (ring_.size() > 3) {
      const size_t m = ring_.size();
      at %= m;
      const int a = ring_[(at + m - 1) % m], b = ring_[at], c = ring_[(at + 1) % m];
      bool is_ear = turn(a, b, c) > 0 && !holds_a_vertex(a, b, c);
      if (!is_ear) is_ear = ++misses > m;  // no ear: the polygon intersects itself or is flat
      if (!is_ear) {
        ++at;
        continue;
      }
      cut(a, b, c, at), misses = 0;
      drop_flat(int(at) - 1, 2);
    }
    triangles_.insert(triangles_.end(), {ring_[0], ring_[1], ring_[2]});
  }

 private:
  void project(std::span<const dvec3> polygon) {
    const size_t n = polygon.size();
    std::vector<dvec3> p(n);
    double largest = 0;
    for (size_t i = 0; i < n; ++i) {
      p[i] = polygon[i] - polygon[0];
      largest = std::max({largest, std::fabs(p[i].x), std::fabs(p[i].y), std::fabs(p[i].z)});
    }
    if (largest == 0) largest = 1;
    for (dvec3& v : p) v = {v.x / largest, v.y / largest, v.z / largest};
    dvec3 normal = cross(p[0], p[1 % n]);
    for (size_t i = 1; i < n; ++i) normal += cross(p[i], p[(i + 1) % n]);
    const double size[3] = {std::fabs(normal.x), std::fabs(normal.y), std::fabs(normal.z)};
    const size_t axis = size_t(std::max_element(size, size + 3) - size), u = (axis + 1) % 3, v = (axis + 2) % 3;
    const bool swapped = !(component(normal, axis) >= 0);
    x_.resize(n), y_.resize(n);
    for (size_t i = 0; i < n; ++i) x_[i] = component(p[i], swapped ? v : u), y_[i] = component(p[i], swapped ? u : v);
  }

  double turn(int a, int b, int c) const { return (x_[b] - x_[a]) * (y_[c] - y_[a]) - (y_[b] - y_[a]) * (x_[c] - x_[a]); }

  bool goes_back(int a, int b, int c) const {
    return (x_[b] - x_[a]) * (x_[c] - x_[b]) + (y_[b] - y_[a]) * (y_[c] - y_[b]) <= 0;
  }

  bool holds_a_vertex(int a, int b, int c) const {
    const double ax = x_[a], ay = y_[a], bx = x_[b], by = y_[b], cx = x_[c], cy = y_[c];
    const auto [left, right] = std::minmax({ax, bx, cx});
    const auto [low, high] = std::minmax({ay, by, cy});
    for (const int v : ring_) {
      const double px = x_[v], py = y_[v];
      if (px < left || px > right || py < low || py > high || v == a || v == b || v == c) continue;
      if ((px == ax && py == ay) || (px == bx && py == by) || (px == cx && py == cy)) continue;
      if ((bx - ax) * (py - ay) - (by - ay) * (px - ax) >= 0 && (cx - bx) * (py - by) - (cy - by) * (px - bx) >= 0 &&
          (ax - cx) * (py - cy) - (ay - cy) * (px - cx) >= 0)
        return true;
    }
    return false;
  }

  void cut(int a, int b, int c, size_t at) {
    triangles_.insert(triangles_.end(), {a, b, c});
    ring_.erase(ring_.begin() + ptrdiff_t(at));
  }

  // Clips repeated vertices and tips of spikes among the `count` corners from `at` on, and any that result.
  void drop_flat(int at, int count) {
    while (count > 0 && ring_.size() > 3) {
      const int m = int(ring_.size());
      const int here = ((at % m) + m) % m;
      const int a = ring_[(here + m - 1) % m], b = ring_[here], c = ring_[(here + 1) % m];
      if (turn(a, b, c) == 0 && goes_back(a, b, c)) {
        cut(a, b, c, size_t(here));
        at = here - 1, ++count;
      } else {
        ++at, --count;
      }
    }
  }

  std::vector<int32_t>& triangles_;
  std::vector<int> ring_;
  std::vector<double> x_, y_;
};

}  // namespace

void clip_ears(std::span<const dvec3> polygon, std::vector<int32_t>& triangles) { Clipping(polygon, triangles).clip(); }

}  // namespace primray
