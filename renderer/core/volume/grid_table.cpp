// Construction of a scene's table of grids: blocks of values, and the ranges of the cells that reach them.
#include "volume/grid_table.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <unordered_map>
#include <unordered_set>

#include "base/error.hpp"

namespace primray {
namespace {

using Place = std::array<int32_t, 3>;  // of a leaf or a node, in units of it

struct PlaceHash {
  size_t operator()(const Place& p) const {
    uint64_t h = 0;
    for (const int32_t x : p) h = (h ^ uint32_t(x)) * 0x9e3779b97f4a7c15ull, h ^= h >> 29;
    return size_t(h);
  }
};

Place node_at(const Place& leaf) { return {leaf[0] >> 4, leaf[1] >> 4, leaf[2] >> 4}; }
// The neighbour above along the axes of m's bits: x 4, y 2, z 1.
Place above(const Place& p, int m) { return {p[0] + (m >> 2 & 1), p[1] + (m >> 1 & 1), p[2] + (m & 1)}; }
Place below(const Place& p, int m) { return {p[0] - (m >> 2 & 1), p[1] - (m >> 1 & 1), p[2] - (m & 1)}; }

struct Range {
  float low = std::numeric_limits<float>::infinity(), high = -std::numeric_limits<float>::infinity();
  void add(float v) { low = std::min(low, v), high = std::max(high, v); }
  void add(const Range& r) { low = std::min(low, r.low), high = std::max(high, r.high); }
};

// Ranges of those of a block's values that cells reach: entry m is of the voxels that are the first along the axes of m's bits,
// which the cell below along those axes reaches; entry 0 is of all.
using FaceRanges = std::array<Range, 8>;

// `values`: of a block. Rows along z have one length, so that they are compared several at a time.
template <class Value>
FaceRanges face_ranges(int channels, const Value* values) {
  std::array<Range, 8> of;  // by which coordinates are 0
  const int first = channels, row = kLeafSide * channels;
  float numbers[3 * kLeafSide];
  for (int x = 0; x < kLeafSide; ++x)
    for (int y = 0; y < kLeafSide; ++y, values += row) {
      for (int k = 0; k < row; ++k) numbers[k] = as_float(values[k]);
      const int place = (x == 0 ? 4 : 0) | (y == 0 ? 2 : 0);
      for (int k = 0; k < first; ++k) of[size_t(place | 1)].add(numbers[k]);
      Range rest;
      for (int k = first; k < row; ++k) rest.add(numbers[k]);
      of[size_t(place)].add(rest);
    }
  FaceRanges reached;
  for (int m = 0; m < 8; ++m)
    for (int k = 0; k < 8; ++k)
      if ((k & m) == m) reached[size_t(m)].add(of[size_t(k)]);
  return reached;
}

// The blocks of one grid by place, while its nodes are made.
class Blocks {
 public:
  Blocks() {
    ranges_[0] = FaceRanges();
    for (Range& r : ranges_[0]) r.add(0.0f);
  }
  void put_leaf(const Place& leaf, int32_t block) { leaves_[leaf] = block; }
  void put_node(const Place& node, int32_t block) { nodes_[node] = block; }
  void put_ranges(int32_t block, const FaceRanges& ranges) { ranges_[block] = ranges; }

  int32_t block_at(const Place& leaf) const {
    if (const auto found = leaves_.find(leaf); found != leaves_.end()) return found->second;
    if (const auto found = nodes_.find(node_at(leaf)); found != nodes_.end()) return found->second;
    return 0;
  }
  Range range_of_cell(const Place& leaf) const {
    Range r;
    for (int m = 0; m < 8; ++m) r.add(ranges_.at(block_at(above(leaf, m)))[size_t(m)]);
    return r;
  }
  // Places of all nodes in which some value may not be 0.
  std::vector<Place> nodes() const {
    std::unordered_set<Place, PlaceHash> found;
    for (int m = 0; m < 8; ++m) {
      for (const auto& [leaf, block] : leaves_) found.insert(node_at(below(leaf, m)));
      for (const auto& [node, block] : nodes_) found.insert(below(node, m));
    }
    std::vector<Place> sorted(found.begin(), found.end());
    std::sort(sorted.begin(), sorted.end());
    return sorted;
  }
  // Blocks of a node without leaves and of the seven nodes above it, on which its cells depend; none if one of them has leaves.
  std::optional<std::array<int32_t, 8>> blocks_around(const Place& node) const {
    std::array<int32_t, 8> blocks{};
    for (int m = 0; m < 8; ++m) {
      const Place next = above(node, m);
      if (has_leaves_.contains(next)) return std::nullopt;
      if (const auto found = nodes_.find(next); found != nodes_.end()) blocks[size_t(m)] = found->second;
    }
    return blocks;
  }
  void close() {
    for (const auto& [leaf, block] : leaves_) has_leaves_.insert(node_at(leaf));
  }
  // Box of the voxels whose values may not be 0: the lowest, and the first beyond.
  void box(Place& low, Place& high) const {
    low = {INT32_MAX, INT32_MAX, INT32_MAX}, high = {INT32_MIN, INT32_MIN, INT32_MIN};
    const auto add = [&](const Place& place, int32_t side) {
      for (size_t a = 0; a < 3; ++a)
        low[a] = std::min(low[a], place[a] * side), high[a] = std::max(high[a], (place[a] + 1) * side);
    };
    for (const auto& [leaf, block] : leaves_) add(leaf, kLeafSide);
    for (const auto& [node, block] : nodes_) add(node, kNodeSide);
  }

 private:
  std::unordered_map<Place, int32_t, PlaceHash> leaves_, nodes_;
  std::unordered_map<int32_t, FaceRanges> ranges_;
  std::unordered_set<Place, PlaceHash> has_leaves_;
};

// Appends the values of all blocks of a grid to `to`, and notes where they are.
template <class Value>
void add_blocks(const GridInput& grid, const GridValues<Value>& values, std::vector<Value>& to, Blocks& blocks) {
  const size_t width = size_t(grid.channels), size = kLeafVoxels * width;
  const size_t leaves = grid.leaf_origins.size() / 3, tiles = grid.tiles.size() / 4;
  if (values.of_leaves.size() != leaves * size || values.of_tiles.size() != tiles * width)
    throw Error("internal", "a grid's values do not fit its leaves and tiles");
  if (to.size() + (leaves + tiles) * size > size_t(INT32_MAX))
    throw Error("volume-too-large", "the grids of the scene have more than 2^31 values");
  to.reserve(to.size() + (leaves + tiles) * size);
  const auto close_block = [&] {
    const int32_t block = int32_t((to.size() - size) / kLeafVoxels);
    blocks.put_ranges(block, face_ranges(grid.channels, &to[to.size() - size]));
    return block;
  };
  for (size_t i = 0; i < leaves; ++i) {
    const int32_t* at = &grid.leaf_origins[3 * i];
    to.insert(to.end(), values.of_leaves.begin() + ptrdiff_t(i * size), values.of_leaves.begin() + ptrdiff_t((i + 1) * size));
    blocks.put_leaf({at[0] >> 3, at[1] >> 3, at[2] >> 3}, close_block());
  }
  for (size_t i = 0; i < tiles; ++i) {
    const int32_t* tile = &grid.tiles[4 * i];
    for (size_t k = 0; k < size; ++k) to.push_back(values.of_tiles[i * width + k % width]);
    const int32_t block = close_block(), side = tile[3] / kNodeSide;
    if (tile[3] == kLeafSide) blocks.put_leaf({tile[0] >> 3, tile[1] >> 3, tile[2] >> 3}, block);
    for (int32_t x = 0; x < side; ++x)
      for (int32_t y = 0; y < side; ++y)
        for (int32_t z = 0; z < side; ++z) blocks.put_node({(tile[0] >> 7) + x, (tile[1] >> 7) + y, (tile[2] >> 7) + z}, block);
  }
  blocks.close();
}

// Sum of all values of a grid.
template <class Value>
double sum_of(const GridInput& grid, const GridValues<Value>& values) {
  double sum = 0;
  for (const Value& v : values.of_leaves) sum += double(as_float(v));
  for (size_t i = 0; i < values.of_tiles.size(); ++i)
    sum += double(as_float(values.of_tiles[i])) * std::pow(double(grid.tiles[4 * (i / size_t(grid.channels)) + 3]), 3);
  return sum;
}

}  // namespace

int32_t GridTable::node_at(const Row& row, const Place& node) const {
  size_t at = 0;
  for (size_t a = 0; a < 3; ++a) {
    const int32_t k = node[a] - row.first_node[a];
    if (k < 0 || k >= row.nodes_along[a]) return 0;
    at = at * size_t(row.nodes_along[a]) + size_t(k);
  }
  return node_of[size_t(row.node_base) + at];
}

int32_t GridTable::block_at(const Row& row, const Place& place) const {
  const size_t entry = size_t((place[0] & 15) << 8 | (place[1] & 15) << 4 | (place[2] & 15));
  return leaf_of[size_t(node_at(row, primray::node_at(place))) * kNodeEntries + entry];
}

GridTable::GridTable()
    : node_of{0},
      node_ranges(2, 0.0f),
      leaf_of(kNodeEntries, 0),
      leaf_ranges(2 * size_t(kNodeEntries), 0.0f),
      halves(3 * size_t(kLeafVoxels), 0),
      floats(3 * size_t(kLeafVoxels), 0.0f) {}

int GridTable::add(const GridInput& grid) {
  Blocks blocks;
  if (grid.is_half)
    add_blocks(grid, grid.halves, halves, blocks);
  else
    add_blocks(grid, grid.floats, floats, blocks);
  Row row{};
  row.channels = grid.channels, row.is_half = grid.is_half, row.node_base = int32_t(node_of.size());
  const std::vector<Place> nodes = blocks.nodes();
  if (nodes.empty()) {
    rows.push_back(row);
    return int(rows.size()) - 1;
  }

  // Lay out the box of nodes.
  Place low = nodes.front(), high = nodes.front();
  for (const Place& node : nodes)
    for (size_t a = 0; a < 3; ++a) low[a] = std::min(low[a], node[a]), high[a] = std::max(high[a], node[a]);
  size_t count = 1;
  for (size_t a = 0; a < 3; ++a) {
    row.first_node[a] = low[a], row.nodes_along[a] = high[a] - low[a] + 1;
    count *= size_t(row.nodes_along[a]);
    if (count > kMostNodes) throw Error("volume-too-large", "a grid spans more than 2^27 nodes of 128^3 voxels");
  }
  if (node_of.size() + count > size_t(INT32_MAX)) throw Error("volume-too-large", "the grids of the scene span too many nodes");
  node_of.resize(node_of.size() + count, 0);

  // Fill the nodes; those of large tiles with the same neighbours are one.
  Range of_grid;
  std::map<std::array<int32_t, 8>, int32_t> without_leaves;
  for (const Place& node : nodes) {
    const size_t at =
        (size_t(node[0] - low[0]) * size_t(row.nodes_along[1]) + size_t(node[1] - low[1])) * size_t(row.nodes_along[2]) +
        size_t(node[2] - low[2]);
    int32_t& number = node_of[size_t(row.node_base) + at];
    const std::optional<std::array<int32_t, 8>> around = blocks.blocks_around(node);
    if (around) {
      const auto [found, is_new] = without_leaves.try_emplace(*around, int32_t(leaf_of.size() / kNodeEntries));
      number = found->second;
      if (!is_new) continue;
    }
    if (leaf_of.size() > kMostEntries)
      throw Error("volume-too-large", "the grids of the scene have more than 2^18 nodes of 128^3 voxels");
    number = int32_t(leaf_of.size() / kNodeEntries);
    Range of_node;
    for (int32_t k = 0; k < kNodeEntries; ++k) {
      const Place leaf{node[0] * kNodeLeaves + k / 256, node[1] * kNodeLeaves + k / 16 % 16, node[2] * kNodeLeaves + k % 16};
      const Range r = blocks.range_of_cell(leaf);
      leaf_of.push_back(blocks.block_at(leaf));
      leaf_ranges.push_back(r.low), leaf_ranges.push_back(r.high);
      of_node.add(r);
    }
    node_ranges.push_back(of_node.low), node_ranges.push_back(of_node.high);
    of_grid.add(of_node);
  }
  row.least = of_grid.low, row.most = of_grid.high;
  const double sum = grid.is_half ? sum_of(grid, grid.halves) : sum_of(grid, grid.floats);
  Place first, beyond;
  blocks.box(first, beyond);
  for (size_t a = 0; a < 3; ++a) row.low[a] = float(first[a]) - 1.0f, row.high[a] = float(beyond[a]);
  const double voxels = double(row.high[0] - row.low[0]) * (row.high[1] - row.low[1]) * (row.high[2] - row.low[2]);
  row.mean = float(sum / std::max(voxels, 1.0));
  rows.push_back(row);
  return int(rows.size()) - 1;
}

}  // namespace primray
