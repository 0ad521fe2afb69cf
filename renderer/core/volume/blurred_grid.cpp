// Blurred grids: ranges of the values that velocities carry into each cell, over the whole exposure.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <unordered_map>

#include "base/error.hpp"
#include "volume/grid_table.hpp"

namespace primray {
namespace {

using Place = std::array<int32_t, 3>;

struct Range {
  float low = std::numeric_limits<float>::infinity(), high = -std::numeric_limits<float>::infinity();
  void add(float v) { low = std::min(low, v), high = std::max(high, v); }
  void add(const Range& r) { low = std::min(low, r.low), high = std::max(high, r.high); }
  bool is_zero() const { return low == 0 && high == 0; }
};

// Lowest and highest voxels.
struct VoxelBox {
  Place low, high;
};

// Boxes that are at most this number of voxels wide are looked at voxel by voxel; wider ones by whole leaves or nodes, whose
// ranges may be larger.
constexpr int32_t kWidestExact = 32, kWidestByLeaf = 256;

}  // namespace

class BlurredRanges {
 public:
  BlurredRanges(const GridTable& table, const BlurInput& input)
      : table_(table), row_(table.rows[size_t(input.grid)]), velocity_(table.rows[size_t(input.velocity)]), input_(input) {}

  // Returns the range of the values that are in a leaf's cell at any time in [0, 1].
  Range of_cell(const Place& leaf) {
    const std::array<Range, 3> moves = velocities(leaf);
    if (std::all_of(moves.begin(), moves.end(), [](const Range& r) { return r.is_zero(); })) return of_still_cell(leaf);
    VoxelBox box;
    for (size_t a = 0; a < 3; ++a) {
      Range displaced;
      for (const float since : {0 - input_.frame, 1 - input_.frame})
        displaced.add(-moves[a].low * since), displaced.add(-moves[a].high * since);
      // Rays' times are within the exposure, and the frame may not be.
      const float slack = moves[a].is_zero() ? 0.0f : kSlack;
      const double first = double(leaf[a]) * kLeafSide, last = first + kLeafSide;
      box.low[a] = int32_t(std::floor(std::max(first + displaced.low - slack, -kFarthest)));
      box.high[a] = int32_t(std::ceil(std::min(last + displaced.high + slack, kFarthest)));
    }
    return in_box(box);
  }
  // Whether nothing moves in a node's cells.
  bool is_still(const Place& node) const { return table_.node_at(velocity_, moved(node, kNodeSide)) == 0; }

 private:
  static constexpr float kSlack = 1e-2f;  // voxels, for rounding
  static constexpr double kFarthest = 1e9;

  const GridTable& table_;
  const GridTable::Row &row_, &velocity_;
  const BlurInput& input_;
  std::unordered_map<int32_t, Range> of_block_;
  std::unordered_map<int64_t, std::array<Range, 3>> of_velocities_;  // by block and the faces of it that are reached

  Place moved(const Place& place, int32_t side) const {
    return {place[0] + input_.shift[0] / side, place[1] + input_.shift[1] / side, place[2] + input_.shift[2] / side};
  }
  Range of_still_cell(const Place& leaf) const {
    const size_t node = size_t(table_.node_at(row_, {leaf[0] >> 4, leaf[1] >> 4, leaf[2] >> 4}));
    const size_t entry = node * kNodeEntries + size_t((leaf[0] & 15) << 8 | (leaf[1] & 15) << 4 | (leaf[2] & 15));
    return {table_.leaf_ranges[2 * entry], table_.leaf_ranges[2 * entry + 1]};
  }

  // Returns the range of each component in a leaf's cell, which reaches the first voxels of the leaves above.
  std::array<Range, 3> velocities(const Place& leaf) {
    std::array<Range, 3> all;
    for (int m = 0; m < 8; ++m) {
      const Place above = moved({leaf[0] + (m >> 2 & 1), leaf[1] + (m >> 1 & 1), leaf[2] + (m & 1)}, kLeafSide);
      const int32_t block = table_.block_at(velocity_, above);
      const auto [found, is_new] = of_velocities_.try_emplace(int64_t(block) * 8 + m);
      if (is_new) found->second = velocities_of(block, m);
      for (size_t a = 0; a < 3; ++a) all[a].add(found->second[a]);
    }
    return all;
  }
  std::array<Range, 3> velocities_of(int32_t block, int faces) const {
    std::array<Range, 3> all;
    for (int v = 0; v < kLeafVoxels; ++v) {
      const int first = (v / 64 == 0 ? 4 : 0) | (v / 8 % 8 == 0 ? 2 : 0) | (v % 8 == 0 ? 1 : 0);
      if ((first & faces) != faces) continue;
      for (size_t a = 0; a < 3; ++a) all[a].add(table_.number(velocity_, size_t(block) * kLeafVoxels + size_t(v) * 3 + a));
    }
    return all;
  }

  // Returns the range of the voxels of a box.
  Range in_box(VoxelBox box) {
    Range all;
    int32_t widest = 0;
    for (size_t a = 0; a < 3; ++a) {
      const int32_t first = row_.first_node[a] * kNodeSide, last = first + row_.nodes_along[a] * kNodeSide - 1;
      if (box.low[a] < first || box.high[a] > last) all.add(0.0f);
      box.low[a] = std::max(box.low[a], first), box.high[a] = std::min(box.high[a], last);
      if (box.low[a] > box.high[a]) return all;
      widest = std::max(widest, box.high[a] - box.low[a] + 1);
    }
    const int32_t side = widest > kWidestByLeaf ? kNodeSide : kLeafSide;
    Place p;
    const auto unit = [&](int32_t voxel) { return voxel >= 0 ? voxel / side : -((side - 1 - voxel) / side); };
    for (p[0] = unit(box.low[0]); p[0] <= unit(box.high[0]); ++p[0])
      for (p[1] = unit(box.low[1]); p[1] <= unit(box.high[1]); ++p[1])
        for (p[2] = unit(box.low[2]); p[2] <= unit(box.high[2]); ++p[2])
          all.add(side == kNodeSide ? of_node(p) : of_leaf(p, box, widest <= kWidestExact));
    return all;
  }
  Range of_node(const Place& node) const {
    const size_t number = size_t(table_.node_at(row_, node));
    return {table_.node_ranges[2 * number], table_.node_ranges[2 * number + 1]};
  }
  // Returns the range of those of a leaf's voxels that are in a box, or of all.
  Range of_leaf(const Place& leaf, const VoxelBox& box, bool is_exact) {
    const int32_t block = table_.block_at(row_, leaf);
    if (block == 0) return {0.0f, 0.0f};
    int32_t low[3], high[3];
    bool is_whole = true;
    for (size_t a = 0; a < 3; ++a) {
      low[a] = std::max(box.low[a] - leaf[a] * kLeafSide, 0),
      high[a] = std::min(box.high[a] - leaf[a] * kLeafSide, kLeafSide - 1);
      is_whole &= low[a] == 0 && high[a] == kLeafSide - 1;
    }
    if (is_exact && !is_whole) return of_voxels(block, low, high);
    const auto [found, is_new] = of_block_.try_emplace(block);
    const int32_t first[3] = {0, 0, 0}, last[3] = {kLeafSide - 1, kLeafSide - 1, kLeafSide - 1};
    if (is_new) found->second = of_voxels(block, first, last);
    return found->second;
  }
  Range of_voxels(int32_t block, const int32_t (&low)[3], const int32_t (&high)[3]) const {
    Range all;
    const int channels = row_.channels;
    for (int32_t x = low[0]; x <= high[0]; ++x)
      for (int32_t y = low[1]; y <= high[1]; ++y) {
        const int32_t at = x * 64 + y * 8;
        for (int32_t k = (at + low[2]) * channels; k < (at + high[2] + 1) * channels; ++k)
          all.add(table_.number(row_, size_t(block) * kLeafVoxels + size_t(k)));
      }
    return all;
  }
};

int GridTable::add_blurred(const BlurInput& input) {
  if (input.grid < 0 || size_t(input.grid) >= rows.size() || input.velocity < 0 || size_t(input.velocity) >= rows.size() ||
      rows[size_t(input.velocity)].channels != 3)
    throw Error("internal", "a blurred grid refers to a grid that does not exist, or has no velocities");
  const Row source = rows[size_t(input.grid)], velocity = rows[size_t(input.velocity)];
  Row row = source;
  row.velocity = input.velocity, row.frame = input.frame, row.node_base = int32_t(node_of.size());
  std::copy(input.shift.begin(), input.shift.end(), row.velocity_shift);
  any_blurred = true;

  // Lay out the box of nodes: those of both grids
  size_t count = 1;
  for (size_t a = 0; a < 3; ++a) {
    int32_t first = source.first_node[a], beyond = first + source.nodes_along[a];
    const int32_t other = velocity.first_node[a] - input.shift[a] / kNodeSide;
    if (velocity.nodes_along[a] > 0) first = std::min(first, other), beyond = std::max(beyond, other + velocity.nodes_along[a]);
    row.first_node[a] = first, row.nodes_along[a] = beyond - first;
    count *= size_t(row.nodes_along[a]);
    if (node_of.size() + count > kMostNodes) throw Error("volume-too-large", "a blurred grid spans more than 2^27 nodes");
  }
  node_of.resize(node_of.size() + count, 0);

  // Fill the nodes
  BlurredRanges ranges(*this, input);
  Range of_grid;
  of_grid.add(source.least), of_grid.add(source.most);
  Place low{INT32_MAX, INT32_MAX, INT32_MAX}, high{INT32_MIN, INT32_MIN, INT32_MIN};
  std::vector<float> of_leaves(2 * size_t(kNodeEntries));
  std::vector<int32_t> blocks(kNodeEntries);
  Place node;
  size_t at = size_t(row.node_base);
  for (node[0] = row.first_node[0]; node[0] < row.first_node[0] + row.nodes_along[0]; ++node[0])
    for (node[1] = row.first_node[1]; node[1] < row.first_node[1] + row.nodes_along[1]; ++node[1])
      for (node[2] = row.first_node[2]; node[2] < row.first_node[2] + row.nodes_along[2]; ++node[2]) {
        int32_t& number = node_of[at++];
        if (ranges.is_still(node)) {
          number = node_at(source, node);
          continue;
        }
        Range of_node;
        for (int32_t k = 0; k < kNodeEntries; ++k) {
          const Place leaf{node[0] * kNodeLeaves + k / 256, node[1] * kNodeLeaves + k / 16 % 16,
                           node[2] * kNodeLeaves + k % 16};
          const Range r = ranges.of_cell(leaf);
          blocks[size_t(k)] = block_at(source, leaf);
          of_leaves[2 * size_t(k)] = r.low, of_leaves[2 * size_t(k) + 1] = r.high;
          of_node.add(r);
          if (r.is_zero()) continue;
          for (size_t a = 0; a < 3; ++a) low[a] = std::min(low[a], leaf[a]), high[a] = std::max(high[a], leaf[a]);
        }
        of_grid.add(of_node);
        if (of_node.is_zero() && std::all_of(blocks.begin(), blocks.end(), [](int32_t block) { return block == 0; })) continue;
        if (leaf_of.size() > kMostEntries)
          throw Error("volume-too-large", "the grids of the scene have more than 2^18 nodes of 128^3 voxels");
        number = int32_t(leaf_of.size() / kNodeEntries);
        leaf_of.insert(leaf_of.end(), blocks.begin(), blocks.end());
        leaf_ranges.insert(leaf_ranges.end(), of_leaves.begin(), of_leaves.end());
        node_ranges.push_back(of_node.low), node_ranges.push_back(of_node.high);
      }
  row.least = of_grid.low, row.most = of_grid.high;
  const auto volume = [](const Row& r) {
    return double(r.high[0] - r.low[0]) * double(r.high[1] - r.low[1]) * double(r.high[2] - r.low[2]);
  };
  for (size_t a = 0; a < 3; ++a)
    if (low[a] <= high[a]) {
      row.low[a] = std::min(source.low[a], float(low[a] * kLeafSide));
      row.high[a] = std::max(source.high[a], float((high[a] + 1) * kLeafSide));
    }
  row.mean = float(double(source.mean) * volume(source) / std::max(volume(row), 1.0));
  rows.push_back(row);
  return int(rows.size()) - 1;
}

}  // namespace primray
