// Top-down construction of the light tree: the costliest range of a node's lights is split until the node is full, each time at
// the cheapest of several planes across its box. Cost: surface area orientation heuristic of Conty Estevez and Kulla 2018,
// section 4.4, with the box's diagonal in place of its area, which is 0 for many small lights.
#include "light/tree/light_tree.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "math/vec3.hpp"

namespace primray {
namespace {

constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr int kBins = 12;
// Ranges deeper than this are halved by index, so that no arrangement of lights degenerates the tree into a list.
constexpr int kDeepest = 12;

using Block = LightTree::Block;
using Place = LightTree::Place;

// Sums over a range of lights.
struct Sum {
  double intensity = 0, count = 0;
  float low[3] = {kInf, kInf, kInf}, high[3] = {-kInf, -kInf, -kInf};
  double axis[3] = {0, 0, 0};  // sum of the axes of directed lights
  bool around = false;         // some light emits in all directions

  void add(const LightBounds& b) {
    intensity += b.intensity, count += 1;
    for (int a = 0; a < 3; ++a) low[a] = std::min(low[a], b.low[a]), high[a] = std::max(high[a], b.high[a]);
    if (!b.directed()) {
      around = true;
      return;
    }
    for (int a = 0; a < 3; ++a) axis[a] += b.axis[a];
  }
  void add(const Sum& b) {
    intensity += b.intensity, count += b.count, around |= b.around;
    for (int a = 0; a < 3; ++a)
      low[a] = std::min(low[a], b.low[a]), high[a] = std::max(high[a], b.high[a]), axis[a] += b.axis[a];
  }
  // Orientation measure of Conty Estevez and Kulla 2018, section 4.4: the integral of the emission over directions, for lights
  // whose axes spread about as far as their mean is short.
  double orientation() const {
    if (around) return 4 * std::numbers::pi;
    const double mean = std::sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]) / count;
    const double o = std::acos(std::clamp(2 * mean - 1, -1.0, 1.0)), w = std::min(o + std::numbers::pi / 2, std::numbers::pi);
    return 2 * std::numbers::pi * (1 - std::cos(o)) +
           std::numbers::pi / 2 * (2 * w * std::sin(o) - std::cos(o - 2 * w) - 2 * o * std::sin(o) + std::cos(o));
  }
  double cost() const {
    if (!(count > 0)) return 0;
    double diagonal2 = 0;
    for (int a = 0; a < 3; ++a) diagonal2 += (double(high[a]) - low[a]) * (double(high[a]) - low[a]);
    return intensity * diagonal2 * orientation();
  }
};

struct Range {
  int32_t first, end;
  double cost;
  int32_t count() const { return end - first; }
};

struct Builder {
  LightTree& tree;
  const std::vector<LightBounds>& bounds;
  const std::vector<int32_t>& numbers;
  std::vector<Place>& places;
  std::vector<int32_t> order;  // indices into `numbers`

  const LightBounds& at(int32_t i) const { return bounds[size_t(numbers[size_t(order[size_t(i)])])]; }

  Range range(int32_t first, int32_t end) const {
    Sum sum;
    for (int32_t i = first; i < end; ++i) sum.add(at(i));
    return {first, end, sum.cost()};
  }

  int32_t halve(const Range& r, int axis) {
    const int32_t middle = r.first + r.count() / 2;
    std::nth_element(order.begin() + r.first, order.begin() + middle, order.begin() + r.end, [&](int32_t i, int32_t j) {
      const float x = bounds[size_t(numbers[size_t(i)])].center[axis], y = bounds[size_t(numbers[size_t(j)])].center[axis];
      return x != y ? x < y : i < j;  // the same order with every standard library
    });
    return middle;
  }

  // Orders the range and returns where its second part begins.
  int32_t split(const Range& r, int depth) {
    float low[3] = {kInf, kInf, kInf}, high[3] = {-kInf, -kInf, -kInf};
    for (int32_t i = r.first; i < r.end; ++i)
      for (int a = 0; a < 3; ++a) low[a] = std::min(low[a], at(i).center[a]), high[a] = std::max(high[a], at(i).center[a]);
    int longest = 0;
    for (int a = 1; a < 3; ++a)
      if (high[a] - low[a] > high[longest] - low[longest]) longest = a;
    const float length = high[longest] - low[longest];
    if (r.count() == 2 || depth > kDeepest || !(length > 0)) return halve(r, longest);
    double least = kInf;
    int axis = longest, plane = 0;
    const auto bin_of = [&](const LightBounds& b, int a) {
      return std::min(kBins - 1, int(float(kBins) * ((b.center[a] - low[a]) / (high[a] - low[a]))));
    };
    for (int a = 0; a < 3; ++a) {
      if (!(high[a] - low[a] > 0.1f * length)) continue;
      Sum bins[kBins], after[kBins];
      for (int32_t i = r.first; i < r.end; ++i) bins[bin_of(at(i), a)].add(at(i));
      after[kBins - 1] = bins[kBins - 1];
      for (int k = kBins - 2; k > 0; --k) after[k] = after[k + 1], after[k].add(bins[k]);
      Sum before;
      for (int k = 1; k < kBins; ++k) {
        before.add(bins[k - 1]);
        if (!(before.count > 0) || !(after[k].count > 0)) continue;
        // Thin slices of a long box cost more, as in the paper.
        const double cost = (before.cost() + after[k].cost()) * (length / (high[a] - low[a]));
        if (cost < least) least = cost, axis = a, plane = k;
      }
    }
    if (plane == 0) return halve(r, longest);
    const auto middle = std::stable_partition(order.begin() + r.first, order.begin() + r.end, [&](int32_t i) {
      return bin_of(bounds[size_t(numbers[size_t(i)])], axis) < plane;
    });
    return int32_t(middle - order.begin());
  }

  // Fills the slot of a light, or of a range of lights, except for its child.
  void put(Block& block, int s, const Range& r) const {
    const LightBounds& only = at(r.first);
    double intensity = 0, center[3] = {0, 0, 0}, floor = 0, axis[3] = {0, 0, 0};
    for (int32_t i = r.first; i < r.end; ++i) {
      const LightBounds& b = at(i);
      intensity += b.intensity, floor += double(b.intensity) * b.floor;
      for (int a = 0; a < 3; ++a) center[a] += double(b.intensity) * b.center[a], axis[a] += b.axis[a];
    }
    float least2 = r.count() == 1 ? only.least2 : 0.0f, cos_end = kInf, cos_axis = 1, half[3] = {0, 0, 0};
    double spread = 0;
    for (int a = 0; a < 3; ++a) center[a] /= intensity;
    const double length_of_axis = std::sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]);
    for (int a = 0; a < 3; ++a) axis[a] = length_of_axis > 0 ? axis[a] / length_of_axis : 0;
    float end = 1;
    for (int32_t i = r.first; i < r.end; ++i) {
      const LightBounds& b = at(i);
      for (int a = 0; a < 3; ++a) {
        const double far = std::max(double(b.high[a]) - center[a], center[a] - double(b.low[a]));
        half[a] = std::max(half[a], float(far * 1.000001));
        spread += double(b.intensity) * (b.center[a] - center[a]) * (b.center[a] - center[a]);
      }
      end = std::min(end, b.cos_end);
      if (b.directed()) cos_axis = std::min(cos_axis, float(axis[0] * b.axis[0] + axis[1] * b.axis[1] + axis[2] * b.axis[2]));
    }
    cos_end = end;
    // For lights spread all over a sphere of radius R, the mean of 1 / d^2 at its centre is 3 / R^2, and their mean squared
    // distance is 3/5 R^2.
    if (r.count() > 1) least2 = only.far ? 1.0f : std::max(float(spread / intensity * (5.0 / 9.0)), 1e-24f);
    if (cos_end > -1.5f && !(length_of_axis > 1e-3 * r.count())) cos_end = -2;
    const bool directed = cos_end > -1.5f;
    for (int a = 0; a < 3; ++a) {
      block.center[a][s] = float(center[a]), block.half[a][s] = half[a];
      block.axis[a][s] = directed ? float(axis[a]) : 0.0f;
    }
    block.near[s] = only.far ? 0.0f : 1.0f;
    block.intensity[s] = float(intensity), block.least2[s] = least2;
    // The margin exceeds rounding errors.
    if (r.count() > 1) cos_axis = std::max(cos_axis - 1e-5f, -1.0f);
    block.cos_axis[s] = directed ? cos_axis : 1.0f;
    block.sin_axis[s] = directed ? std::sqrt(std::max(1 - cos_axis * cos_axis, 0.0f)) : 0.0f;
    block.cos_end[s] = cos_end;
    block.floor[s] = directed ? float(floor / intensity) : 1.0f;
    block.radius[s] = r.count() == 1 ? only.radius : std::sqrt(half[0] * half[0] + half[1] * half[1] + half[2] * half[2]);
    if (directed) block.directed |= 1u << s;
    if (directed && (block.sin_axis[s] > 0 || block.radius[s] > 0)) block.wide |= 1u << s;
    if (r.count() == 1 && only.exact) block.exact |= 1u << s;
    if (r.count() > 1 && !only.far) block.clusters |= 1u << s;
  }

  // Number of slots for `count` lights: a few more where the nodes below would be nearly empty, and fewer where those would
  // then be full. A block that is neither weighed nor stored is worth more than smaller clusters.
  static int most_in(int count) {
    if (count <= LightTree::kLastSlots) return LightTree::kLastSlots;
    return count <= LightTree::kBlock * LightTree::kBlock ? LightTree::kBlock : LightTree::kMostSlots;
  }

  // Adds a node over these ranges.
  int32_t add_node(const std::vector<Range>& slots, int32_t parent, int32_t parent_slot, int depth) {
    const int32_t node = int32_t(tree.nodes.size()), first = int32_t(tree.blocks.size());
    const int32_t blocks = int32_t((slots.size() + LightTree::kBlock - 1) / LightTree::kBlock);
    tree.nodes.push_back({first, blocks, parent, parent_slot});
    tree.blocks.resize(size_t(first + blocks), Block{});
    // Distribute slots across the blocks, so that slots weighed in the same lane of different blocks are neighbours.
    const auto slot_of = [&](size_t k) { return int(k) % blocks * LightTree::kBlock + int(k) / blocks; };
    const auto block_of = [&](int slot) -> Block& { return tree.blocks[size_t(first + slot / LightTree::kBlock)]; };
    for (size_t k = 0; k < size_t(blocks) * LightTree::kBlock; ++k) {
      const int slot = slot_of(k), s = slot % LightTree::kBlock;
      if (k >= slots.size()) {
        block_of(slot).least2[s] = 1;  // avoids a division by zero
        continue;
      }
      put(block_of(slot), s, slots[k]);
      if (slots[k].count() > 1) continue;
      const int32_t position = order[size_t(slots[k].first)];
      block_of(slot).child[s] = ~numbers[size_t(position)];
      places[size_t(position)] = {node, slot};
    }
    for (size_t k = 0; k < slots.size(); ++k) {
      if (slots[k].count() == 1) continue;
      const int slot = slot_of(k);
      const int32_t child = add_node(parts({slots[k]}, most_in(slots[k].count()), depth + 1), node, slot, depth + 1);
      block_of(slot).child[slot % LightTree::kBlock] = child;
    }
    return node;
  }

  // Splits the ranges, the costliest first, until there are `most` or each is a single light.
  std::vector<Range> parts(std::vector<Range> ranges, int most, int depth) {
    while (int(ranges.size()) < most) {
      size_t widest = ranges.size();
      for (size_t k = 0; k < ranges.size(); ++k)
        if (ranges[k].count() > 1 && (widest == ranges.size() || ranges[k].cost > ranges[widest].cost)) widest = k;
      if (widest == ranges.size()) break;
      const Range r = ranges[widest];
      const int32_t middle = split(r, depth);
      // Keep the spatial order, so that close sample values choose close lights.
      ranges[widest] = range(r.first, middle);
      ranges.insert(ranges.begin() + ptrdiff_t(widest) + 1, range(middle, r.end));
    }
    return ranges;
  }
};

}  // namespace

int32_t add_light_tree(LightTree& tree, const std::vector<LightBounds>& bounds, const std::vector<int32_t>& numbers,
                       std::vector<Place>& places) {
  Builder b{tree, bounds, numbers, places, std::vector<int32_t>(numbers.size())};
  places.resize(numbers.size());
  std::iota(b.order.begin(), b.order.end(), 0);
  // Lights at infinity are kept beside the tree of the others; in the root itself where they are few.
  const auto near =
      std::stable_partition(b.order.begin(), b.order.end(), [&](int32_t i) { return bounds[size_t(numbers[size_t(i)])].far; });
  const int32_t far = int32_t(near - b.order.begin()), all = int32_t(numbers.size());
  std::vector<Range> slots;
  if (far < all) slots = b.parts({b.range(far, all)}, LightTree::kMostSlots - std::min(far, LightTree::kMostSlots / 2), 0);
  if (far > LightTree::kMostSlots / 2) {
    slots.push_back(b.range(0, far));
  } else {
    for (int32_t i = 0; i < far; ++i) slots.push_back(b.range(i, i + 1));
  }
  return b.add_node(slots, -1, -1, 0);
}

}  // namespace primray
