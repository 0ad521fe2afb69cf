// Construction of few_triangles.hpp. Runs are split by the surface area heuristic, for packets: a box is entered if any of many
// rays hits it.
#include "bvh/few_triangles.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "math/box.hpp"

namespace primray {
namespace {

using Point = std::array<float, 3>;

// Number of rays of a packet that count as independent, and the cost of a box test in triangle tests.
constexpr double kRaysApart = 8, kBoxCost = 0.7;
// Cost beyond which Embree's hierarchy is faster (12 to 2412 triangles of a room and cubes: from 1.8 times as slow to equally
// fast).
constexpr double kMostCost = 128;
// Products of three coordinates must stay within the range of floats.
constexpr float kFarthest = 1e12f;
// Margin of boxes, as a share of the greatest coordinate, for the rounding of edges.
constexpr double kAround = 0x1p-20;

float reach(const Box& b) {
  float most = 0;
  for (const vec3& p : {b.low, b.high}) most = std::max({most, std::abs(p.x), std::abs(p.y), std::abs(p.z)});
  return most;
}

double area(const Box& b) {
  const dvec3 side = dvec3(b.high) - dvec3(b.low);
  return side.x * side.y + side.y * side.z + side.z * side.x;
}

struct Corners {
  Point p[3];
  uint32_t number;
  Box box;
};

dvec3 exact(const Point& p) { return {double(p[0]), double(p[1]), double(p[2])}; }
void put(float (&to)[3], const dvec3& v) { to[0] = float(v.x), to[1] = float(v.y), to[2] = float(v.z); }

class Gathering {
 public:
  explicit Gathering(std::vector<Corners> all) : all_(std::move(all)) {
    for (const Corners& c : all_) box_.add(c.box);
    cut(0, all_.size());
  }
  FewTriangles take() { return cost_ <= kMostCost && reach(box_) < kFarthest ? std::move(few_) : FewTriangles(); }

 private:
  // Probability that a packet enters a box.
  double chance(const Box& b) const {
    const double whole = area(box_);
    return whole > 0 ? 1 - std::pow(1 - std::min(area(b) / whole, 1.0), kRaysApart) : 1;
  }

  void cut(size_t first, size_t end) {
    Box whole;
    for (size_t i = first; i < end; ++i) whole.add(all_[i].box);
    double least = end - first > FewTriangles::kMostInRun ? INFINITY : chance(whole) * double(end - first);
    size_t best_axis = 3, best_at = 0;
    for (size_t axis = 0; axis < 3; ++axis) {
      sort(first, end, axis);
      std::vector<double> after(end - first);
      Box b;
      for (size_t i = end - 1; i > first; --i) b.add(all_[i].box), after[i - first] = chance(b) * double(end - i);
      b = {};
      for (size_t i = first + 1; i < end; ++i) {
        b.add(all_[i - 1].box);
        const double cost = kBoxCost + chance(b) * double(i - first) + after[i - first];
        if (cost < least) least = cost, best_axis = axis, best_at = i;
      }
    }
    if (best_axis == 3) {
      cost_ += kBoxCost + least;
      return put_run(first, end, whole);
    }
    sort(first, end, best_axis);
    cut(first, best_at), cut(best_at, end);
  }

  void sort(size_t first, size_t end, size_t axis) {
    std::sort(all_.begin() + long(first), all_.begin() + long(end), [axis](const Corners& a, const Corners& b) {
      const float at = component(a.box.low, axis) + component(a.box.high, axis);
      const float bt = component(b.box.low, axis) + component(b.box.high, axis);
      return at != bt ? at < bt : a.number < b.number;
    });
  }

  void put_run(size_t first, size_t end, const Box& box) {
    FewTriangles::Run run{};
    std::map<Point, std::map<Point, int32_t>> from;  // edges by their ends, the lesser first
    const auto edge_of = [&](const Corners& c, size_t k) {
      const Point &a = c.p[(k + 1) % 3], &b = c.p[(k + 2) % 3];
      return std::pair(std::min(a, b), std::max(a, b));
    };
    for (size_t i = first; i < end; ++i)
      for (size_t k = 0; k < 3; ++k) {
        const auto [a, b] = edge_of(all_[i], k);
        from[a][b] = 0;
      }
    for (auto& [a, ends] : from) {
      few_.points.push_back({{a[0], a[1], a[2]}, uint32_t(ends.size())});
      for (auto& [b, number] : ends) {
        number = int32_t(run.edges++);
        FewTriangles::Edge e;
        put(e.along, exact(b) - exact(a));
        few_.edges.push_back(e);
      }
    }
    for (size_t i = first; i < end; ++i) {
      const Corners& c = all_[i];
      FewTriangles::Triangle t{};
      t.number = int32_t(c.number);
      for (size_t k = 0; k < 3; ++k) {
        const auto [a, b] = edge_of(c, k);
        t.edge[k] = from[a][b], t.turned[k] = c.p[(k + 1) % 3] == a ? 0 : INT32_MIN;
      }
      const dvec3 a = exact(c.p[0]);
      put(t.normal, cross(exact(c.p[1]) - a, exact(c.p[2]) - a));
      put(t.point, a);
      few_.triangles.push_back(t);
    }
    run.points = uint32_t(from.size()), run.triangles = uint32_t(end - first);
    const dvec3 around(reach(box) * kAround);
    put(run.low, dvec3(box.low) - around), put(run.high, dvec3(box.high) + around);
    few_.runs.push_back(run);
  }

  std::vector<Corners> all_;
  Box box_;
  double cost_ = 0;
  FewTriangles few_;
};

}  // namespace

FewTriangles gather_few(const float* positions, const uint32_t* indices, uint32_t count) {
  if (PRIMRAY_MAX_LANES < 8 || count == 0 || count > FewTriangles::kMost) return {};
  std::vector<Corners> all(count);
  for (uint32_t t = 0; t < count; ++t) {
    all[t].number = t;
    for (uint32_t k = 0; k < 3; ++k) {
      const float* p = positions + 3 * size_t(indices[3 * t + k]);
      all[t].p[k] = {p[0] + 0.0f, p[1] + 0.0f, p[2] + 0.0f};  // one zero, not two
      all[t].box.add({all[t].p[k][0], all[t].p[k][1], all[t].p[k][2]});
    }
  }
  return Gathering(std::move(all)).take();
}

}  // namespace primray
