// See caustic_tree.hpp. A complete tree of median cuts through the longest side.
#include "light/caustic_tree.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <thread>

namespace primray {
namespace {

// Fewer make noisy lobes, more cost time for every density.
constexpr size_t kLeast = CausticGuide::kMostInLeaf / 2;
constexpr float kInv4Pi = 0.0795774715f;
// What is tried for a leaf's lobes: squared chords, and squared reaches as shares of the photons' mean squared distance.
constexpr int kWidths = 10;
constexpr float kNarrowest = 1e-6f, kWidthStep = 4;
constexpr float kReaches[] = {0.03f, 0.2f, 1e4f};
// Density, beside the lobes', of what else finds the light.
constexpr float kElsewhere = 0.1f;
// Of the box that photons share: how far beside it their density fades, to a quarter.
constexpr float kFadeShare = 0.5f;

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

// The width and reach under which the photons of a leaf are likeliest, each seen by the others alone.
struct Lobes {
  float width2, reach2;
};
Lobes likeliest_lobes(const CausticPhoton* photons, int count) {
  constexpr int most = CausticGuide::kMostInLeaf;
  float apart2[most][most], chord2[most][most], mean = 0;
  for (int j = 0; j < count; ++j) {
    const vec3 d = unit_to(photons[j].landing, photons[j].source);
    for (int i = 0; i < count; ++i) {
      const vec3 beside = photons[i].landing - photons[j].landing, off = unit_to(photons[j].landing, photons[i].source) - d;
      apart2[j][i] = dot(beside, beside), chord2[j][i] = dot(off, off);
      mean += apart2[j][i] / float(count * count);
    }
  }
  Lobes best{kNarrowest, 1};
  float most_likely = -1e38f;
  for (const float reach : kReaches) {
    const float reach2 = std::max(reach * mean, 1e-20f);
    float near[most][most], total[most];
    for (int j = 0; j < count; ++j) {
      total[j] = 1e-20f;
      for (int i = 0; i < count; ++i) {
        near[j][i] = i == j ? 0 : caustic_nearness(apart2[j][i], reach2);
        total[j] += near[j][i];
      }
    }
    float width2 = kNarrowest;
    for (int k = 0; k < kWidths; ++k, width2 *= kWidthStep) {
      float likely = 0;
      for (int j = 0; j < count; ++j) {
        float sum = 0;
        for (int i = 0; i < count; ++i) {
          const float q = width2 + chord2[j][i];
          sum += near[j][i] / (q * q);
        }
        likely += std::log(sum / total[j] * width2 * (width2 + 4) * kInv4Pi + kElsewhere);
      }
      if (likely > most_likely) most_likely = likely, best = {width2, reach2};
    }
  }
  return best;
}

struct Builder {
  std::vector<CausticPhoton>& photons;
  CausticGuide& guide;

  void divide(int node, int level, size_t first, size_t count) {
    if (level == guide.levels) return;
    Box box;
    for (size_t i = first; i < first + count; ++i) box.add(photons[i].landing);
    const vec3 side = box.high - box.low;
    const int axis = side.x >= side.y && side.x >= side.z ? 0 : side.y >= side.z ? 1 : 2;
    const auto begin = photons.begin() + long(first), middle = begin + long(count / 2);
    std::nth_element(begin, middle, begin + long(count), [axis](const CausticPhoton& a, const CausticPhoton& b) {
      return axis_of(a.landing, axis) < axis_of(b.landing, axis);
    });
    guide.axis[size_t(node)] = axis, guide.split[size_t(node)] = axis_of(middle->landing, axis);
    divide(2 * node + 1, level + 1, first, count / 2), divide(2 * node + 2, level + 1, first + count / 2, count - count / 2);
  }

  void put_leaf(size_t number) const {
    const size_t count = size_t(guide.leaf_photons), first = number * count;
    Box box;
    double weight = 0;
    for (size_t i = first; i < first + count; ++i) {
      const CausticPhoton& p = photons[i];
      box.add(p.landing);
      weight += p.weight;
      float* to = &guide.photons[6 * i];
      to[0] = p.source.x, to[1] = p.source.y, to[2] = p.source.z;
      to[3] = p.landing.x, to[4] = p.landing.y, to[5] = p.landing.z;
    }
    const Lobes lobes = likeliest_lobes(&photons[first], int(count));
    // The area that they share: of their box, without its shortest side.
    float side[3] = {box.high.x - box.low.x, box.high.y - box.low.y, box.high.z - box.low.z};
    std::sort(side, side + 3);
    const double area = double(side[2]) * std::max(side[1], 0.1f * side[2]),
                 reach = kFadeShare * std::max(side[1], 0.25f * side[2]);
    float* to = &guide.leaf[number * kLeafFields];
    to[kLow] = box.low.x, to[kLow + 1] = box.low.y, to[kLow + 2] = box.low.z;
    to[kHigh] = box.high.x, to[kHigh + 1] = box.high.y, to[kHigh + 2] = box.high.z;
    to[kFade] = float(1 / std::max(reach * reach, 1e-30));
    to[kDensity] = float(std::min(weight / std::max(area, 1e-30), 1e6));
    to[kWidth2] = lobes.width2, to[kReach2] = lobes.reach2;
  }
};

}  // namespace

void build_caustic_tree(std::vector<CausticPhoton>& photons, CausticGuide& guide, int threads) {
  guide = {};
  if (photons.size() < 2 * kLeast) return;
  while ((photons.size() >> (guide.levels + 1)) >= kLeast) ++guide.levels;
  const size_t leaves = size_t(1) << guide.levels, each = photons.size() >> guide.levels;
  photons.resize(leaves * each);
  guide.leaf_photons = int(each);
  guide.axis.resize(leaves), guide.split.resize(leaves);
  guide.photons.resize(6 * photons.size()), guide.leaf.resize(leaves * kLeafFields);
  Builder builder{photons, guide};
  builder.divide(0, 0, 0, photons.size());
  std::atomic<size_t> next{0};
  const auto work = [&] {
    for (size_t i; (i = next++) < leaves;) builder.put_leaf(i);
  };
  std::vector<std::thread> pool;
  for (int i = 0; i < std::max(threads, 1); ++i) pool.emplace_back(work);
  for (std::thread& t : pool) t.join();
}

}  // namespace primray
