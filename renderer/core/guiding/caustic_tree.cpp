// Construction of a CausticGuide's tree: a complete tree of median cuts through the longest side.
#include "guiding/caustic_guide.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <thread>

#include "base/time_spans.hpp"
#include "math/box.hpp"

namespace primray {
namespace {

// Fewer photons per leaf give noisy lobes, more cost time for every density.
constexpr size_t kLeast = CausticGuide::kMostInLeaf / 2;
constexpr float kInv4Pi = 0.0795774715f;
// Candidate lobes of a leaf: squared chords, and squared reaches as shares of the photons' mean squared distance.
constexpr int kWidths = 10;
constexpr float kNarrowest = 1e-6f, kWidthStep = 4;
constexpr float kReaches[] = {0.03f, 0.2f, 1e4f};
// Density, beside that of the lobes, of other techniques that find the light.
constexpr float kElsewhere = 0.1f;
// Lobes are sharp if they give photons, by geometric mean, at least this density per steradian; a Lambert surface's is 0.3.
constexpr double kSharp = 20;
// Relative error of a coordinate of a point on a surface.
constexpr float kRounding = 1e-6f;
// Distance, as a share of the bounding box, at which the density outside it falls to a quarter.
constexpr float kFadeShare = 0.5f;

vec3 unit(const vec3& d) { return d * (1.0f / std::sqrt(std::max(dot(d, d), 1e-30f))); }

// How directions turn as the surface point moves: by the photons' gradients; towards a point that stays where it is, as on
// bumpy mirrors; or not at all, as on flat facets.
enum class Turning { kByGradients, kAroundPoint, kNone };

struct Gradient {
  vec3 rows[3]{};
};
Gradient gradient_of(const CausticPhoton& p, Turning turning) {
  Gradient g;
  if (turning == Turning::kByGradients) std::copy(std::begin(p.gradient), std::end(p.gradient), g.rows);
  if (turning == Turning::kAroundPoint) {
    const vec3& d = p.direction;
    const float turn = 1 / std::max(p.distance, 1e-20f);
    g.rows[0] = (d * d.x - vec3(1, 0, 0)) * turn;
    g.rows[1] = (d * d.y - vec3(0, 1, 0)) * turn;
    g.rows[2] = (d * d.z - vec3(0, 0, 1)) * turn;
  }
  return g;
}

// Width and reach that maximize the likelihood of a leaf's photons, each predicted by the others.
struct Lobes {
  float width2, reach2;
  double likelihood;
};
Lobes likeliest_lobes(const CausticPhoton* photons, int count, Turning turning) {
  constexpr int most = CausticGuide::kMostInLeaf;
  // A row for each predicted photon, a column for each predictor; all columns, so that loops over them have a fixed length.
  alignas(64) float apart2[most][most] = {}, chord2[most][most] = {};
  float mean = 0;
  for (int i = 0; i < count; ++i) {
    const CausticPhoton& seen = photons[i];
    const Gradient gradient = gradient_of(seen, turning);
    for (int j = 0; j < count; ++j) {
      const vec3 offset = photons[j].landing - seen.landing;
      const vec3 off = unit(direction_seen(seen.direction, offset, gradient.rows)) - photons[j].direction;
      apart2[i][j] = dot(offset, offset), chord2[i][j] = dot(off, off);
      mean += apart2[i][j] / float(count * count);
    }
  }
  Lobes best{kNarrowest, 1, 0};
  for (const float reach : kReaches) {
    const float reach2 = std::max(reach * mean, 1e-20f);
    alignas(64) float near[most][most], total[most];
    std::fill_n(total, most, 1e-20f);
    for (int i = 0; i < count; ++i) {
      for (int j = 0; j < most; ++j) near[i][j] = i == j ? 0 : caustic_nearness(apart2[i][j], reach2);
      for (int j = 0; j < most; ++j) total[j] += near[i][j];
    }
    float width2 = kNarrowest;
    for (int k = 0; k < kWidths; ++k, width2 *= kWidthStep) {
      alignas(64) float sum[most] = {};
      for (int i = 0; i < count; ++i) {
        for (int j = 0; j < most; ++j) {
          const float q = width2 + chord2[i][j];
          sum[j] += near[i][j] / (q * q);
        }
      }
      double likelihood = 1;
      for (int j = 0; j < count; ++j) likelihood *= double(sum[j] / total[j] * (width2 * (width2 + 4) * kInv4Pi) + kElsewhere);
      if (likelihood > best.likelihood) best = {width2, reach2, likelihood};
    }
  }
  return best;
}

struct LeafWeight {
  double all = 0, sharp = 0;
};

struct Builder {
  std::vector<CausticPhoton>& photons;
  CausticGuide& guide;

  void divide(int node, int level, size_t first, size_t count) {
    if (level == guide.levels) return;
    Box box;
    for (size_t i = first; i < first + count; ++i) box.add(photons[i].landing);
    const vec3 side = box.high - box.low;
    const auto begin = photons.begin() + long(first), middle = begin + long(count / 2), end = begin + long(count);
    size_t axes[] = {0, 1, 2};
    std::stable_sort(axes, axes + 3, [&](size_t a, size_t b) { return component(side, a) > component(side, b); });
    // Of photons on a floor, more than half may have the same height, and points there would all be taken for above a split
    // by height: the longest side is cut that divides them.
    const auto cut = [&](size_t axis, float least) {
      const auto below = [axis](const CausticPhoton& a, const CausticPhoton& b) {
        return component(a.landing, axis) < component(b.landing, axis);
      };
      std::nth_element(begin, middle, end, below);
      const float split = component(middle->landing, axis),
                  gap = split - component(std::max_element(begin, middle, below)->landing, axis);
      return gap > least * std::abs(split);
    };
    const auto clearly = [&](size_t axis) { return cut(axis, kRounding); };
    const auto at_all = [&](size_t axis) { return cut(axis, 0); };
    const size_t* found = std::find_if(axes, axes + 3, clearly);
    if (found == axes + 3) found = std::find_if(axes, axes + 3, at_all);
    if (found == axes + 3) cut(*(found = axes), 0);
    const size_t axis = *found;
    guide.nodes[size_t(node)] = {component(middle->landing, axis), int32_t(axis)};
    divide(2 * node + 1, level + 1, first, count / 2), divide(2 * node + 2, level + 1, first + count / 2, count - count / 2);
  }

  static void put(float* to, const vec3& v) { to[0] = v.x, to[1] = v.y, to[2] = v.z; }

  LeafWeight put_leaf(size_t number) const {
    const size_t count = size_t(guide.leaf_photons), first = number * count;
    Turning turning = Turning::kByGradients;
    Lobes lobes = likeliest_lobes(&photons[first], int(count), turning);
    for (const Turning other : {Turning::kAroundPoint, Turning::kNone})
      if (const Lobes found = likeliest_lobes(&photons[first], int(count), other); found.likelihood > lobes.likelihood)
        lobes = found, turning = other;
    Box box;
    double weight = 0;
    for (size_t i = first; i < first + count; ++i) {
      const CausticPhoton& p = photons[i];
      box.add(p.landing);
      weight += p.weight;
      float* to = &guide.photons[kPhotonFields * i];
      put(to + kDirection, p.direction), put(to + kLanding, p.landing);
      const Gradient gradient = gradient_of(p, turning);
      for (int k = 0; k < 3; ++k) put(to + kGradient + 3 * k, gradient.rows[k]);
    }
    // Area of their bounding box, without its shortest side.
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
    return {weight, lobes.likelihood > std::pow(kSharp, double(count)) ? weight : 0};
  }
};

}  // namespace

void build_caustic_tree(std::vector<CausticPhoton>& photons, CausticGuide& guide, int threads) {
  const TimeSpan span("sort photons into a tree");
  guide = {};
  if (photons.size() < 2 * kLeast) return;
  while ((photons.size() >> (guide.levels + 1)) >= kLeast) ++guide.levels;
  const size_t leaves = size_t(1) << guide.levels, each = photons.size() >> guide.levels;
  photons.resize(leaves * each);
  guide.leaf_photons = int(each);
  guide.nodes.resize(std::max(leaves, size_t(16)));  // vectors of the first nodes are read whole
  guide.photons.resize(kPhotonFields * photons.size()), guide.leaf.resize(leaves * kLeafFields);
  Builder builder{photons, guide};
  builder.divide(0, 0, 0, photons.size());
  std::vector<LeafWeight> weights(leaves);
  std::atomic<size_t> next{0};
  const auto work = [&] {
    for (size_t i; (i = next++) < leaves;) weights[i] = builder.put_leaf(i);
  };
  std::vector<std::thread> pool;
  for (int i = 0; i < std::max(threads, 1); ++i) pool.emplace_back(work);
  for (std::thread& t : pool) t.join();
  LeafWeight sum;
  for (const LeafWeight& w : weights) sum.all += w.all, sum.sharp += w.sharp;
  guide.sharp = float(sum.sharp / std::max(sum.all, 1e-30));
}

}  // namespace primray
