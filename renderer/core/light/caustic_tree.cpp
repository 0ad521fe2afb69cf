// See caustic_tree.hpp. A complete tree of median cuts through the longest side.
#include "light/caustic_tree.hpp"

#include <algorithm>
#include <cmath>

namespace primray {
namespace {

// Fewer make noisy lobes, more cost time for every density.
constexpr size_t kLeast = 12;
constexpr double kPiDouble = 3.14159265358979323846;
// Lobes are so much wider, as squared chord, than three quarters of a leaf's photons need to be seen by one of the others.
constexpr float kWiden = 2;
constexpr float kNarrowest = 1e-6f, kWidest = 1;

struct Box {
  vec3 low{1e38f, 1e38f, 1e38f}, high{-1e38f, -1e38f, -1e38f};
  void add(const vec3& p) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
};

float axis_of(const vec3& p, int axis) { return axis == 0 ? p.x : axis == 1 ? p.y : p.z; }

vec3 unit_to(const vec3& from, const vec3& to) {
  const vec3 d = to - from;
  return d * (1.0f / std::sqrt(std::max(dot(d, d), 1e-30f)));
}

struct Builder {
  std::vector<CausticPhoton>& photons;
  CausticGuide& guide;

  void divide(int node, int level, size_t first, size_t count) {
    Box box;
    for (size_t i = first; i < first + count; ++i) box.add(photons[i].landing);
    if (level == guide.levels) return put_leaf(node - ((1 << guide.levels) - 1), first, count, box);
    const vec3 side = box.high - box.low;
    const int axis = side.x >= side.y && side.x >= side.z ? 0 : side.y >= side.z ? 1 : 2;
    const auto begin = photons.begin() + long(first), middle = begin + long(count / 2);
    std::nth_element(begin, middle, begin + long(count), [axis](const CausticPhoton& a, const CausticPhoton& b) {
      return axis_of(a.landing, axis) < axis_of(b.landing, axis);
    });
    guide.axis[size_t(node)] = axis, guide.split[size_t(node)] = axis_of(middle->landing, axis);
    divide(2 * node + 1, level + 1, first, count / 2), divide(2 * node + 2, level + 1, first + count / 2, count - count / 2);
  }

  void put_leaf(int number, size_t first, size_t count, const Box& box) {
    double weight = 0;
    std::vector<float> nearest;
    for (size_t i = first; i < first + count; ++i) {
      const CausticPhoton& p = photons[i];
      weight += p.weight;
      float* to = &guide.source[3 * i];
      to[0] = p.source.x, to[1] = p.source.y, to[2] = p.source.z;
      // How far off the nearest of the others' lobes this one's own direction is.
      const vec3 d = unit_to(p.landing, p.source);
      float least = 4;
      for (size_t j = first; j < first + count; ++j) {
        const vec3 off = unit_to(p.landing, photons[j].source) - d;
        if (j != i) least = std::min(least, dot(off, off));
      }
      nearest.push_back(least);
    }
    std::sort(nearest.begin(), nearest.end());
    const float width2 = std::clamp(kWiden * nearest[nearest.size() * 3 / 4], kNarrowest, kWidest);
    // The area that they share: of their box, without its shortest side.
    float side[3] = {box.high.x - box.low.x, box.high.y - box.low.y, box.high.z - box.low.z};
    std::sort(side, side + 3);
    const double area = double(side[2]) * std::max(side[1], 0.1f * side[2]), reach = 0.5 * std::max(side[1], 0.25f * side[2]);
    float* to = &guide.leaf[size_t(number) * kLeafFields];
    to[kLow] = box.low.x, to[kLow + 1] = box.low.y, to[kLow + 2] = box.low.z;
    to[kHigh] = box.high.x, to[kHigh + 1] = box.high.y, to[kHigh + 2] = box.high.z;
    to[kFade] = float(1 / std::max(reach * reach, 1e-30));
    to[kDensity] = float(std::min(weight / std::max(area, 1e-30), 1e6));
    to[kWidth2] = width2;
  }
};

}  // namespace

void build_caustic_tree(std::vector<CausticPhoton>& photons, CausticGuide& guide) {
  guide = {};
  if (photons.size() < 2 * kLeast) return;
  while ((photons.size() >> (guide.levels + 1)) >= kLeast) ++guide.levels;
  const size_t leaves = size_t(1) << guide.levels, each = photons.size() >> guide.levels;
  photons.resize(leaves * each);
  guide.leaf_photons = int(each);
  guide.axis.resize(leaves), guide.split.resize(leaves);
  guide.source.resize(3 * photons.size()), guide.leaf.resize(leaves * kLeafFields);
  Builder{photons, guide}.divide(0, 0, 0, photons.size());
}

}  // namespace primray
