// Sparse voxel grids: values in blocks of 8^3 voxels (leaves), which nodes of 16^3 leaves refer to, as in OpenVDB (Museth 2013,
// "VDB: High-Resolution Sparse Volumes with Dynamic Topology"), and the range of values in each leaf and node.
//
// Voxel centres are at integer coordinates. Values between them are interpolated trilinearly, and are 0 outside. A cell is what
// the ranges are of: positions [8 k, 8 k + 8] of a leaf k, or [128 n, 128 n + 128] of a node n. Interpolation there reaches one
// voxel beyond the leaf's own, which the ranges include: they bound the interpolated values exactly.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <span>
#include <vector>

namespace primray {

constexpr int kLeafSide = 8, kLeafVoxels = 512, kNodeLeaves = 16, kNodeSide = 128, kNodeEntries = 4096;
// The most nodes that grids may span, and the most entries of nodes.
constexpr size_t kMostNodes = size_t(1) << 27, kMostEntries = size_t(1) << 30;

// 16-bit float (IEEE 754 binary16), a finite one.
inline float as_float(uint16_t half) {
  const uint32_t size = half & 0x7fffu;
  const float value = size < 1024 ? float(size) * 0x1p-24f : std::bit_cast<float>((size << 13) + (112u << 23));
  return half >> 15 ? -value : value;
}
inline float as_float(float value) { return value; }

// Values of a grid: of leaves (leaves, 512, channels), by voxel, z fastest, then by channel; and of tiles (tiles, channels).
template <class Value>
struct GridValues {
  std::span<const Value> of_leaves, of_tiles;
};

// A grid as files have it. Its values are either halves or floats.
struct GridInput {
  int channels = 1;                       // 1 or 3
  std::span<const int32_t> leaf_origins;  // (leaves, 3): lowest voxels, multiples of 8
  std::span<const int32_t> tiles;         // (tiles, 4): lowest voxel, and side: a cube of 8, 128 or 4096 voxels with one value
  bool is_half = false;
  GridValues<uint16_t> halves;
  GridValues<float> floats;
};

// A grid that velocities blur over the exposure: at time t its value at x is the mean over the eight voxels around x, with the
// weights of trilinear interpolation, of its values at x - v (t - frame), with the voxels' velocities v. It is a row of its own
// that refers to the blocks of the grid, and whose ranges are those of all times.
struct BlurInput {
  int grid = -1, velocity = -1;           // rows; velocities are of three channels, in voxels per span of the exposure
  std::array<int32_t, 3> shift{0, 0, 0};  // from voxels of the grid to those of the velocities, in whole nodes
  float frame = 0;                        // time, as a fraction of the span, at which nothing is displaced
};

// All grids of a scene, in shared arrays, so that the lanes of a packet may read different grids.
struct GridTable {
  // By grid.
  struct Row {
    int32_t first_node[3], nodes_along[3];  // its box of nodes: the lowest, in units of nodes, and how many along each axis
    int32_t node_base;                      // of its box in `node_of`
    int32_t channels, is_half;
    float low[3], high[3];  // box of the positions whose values may not be 0
    float least, most;      // range of its interpolated values
    float mean;             // over its box
    int32_t velocity = -1;  // row of the velocities that blur it; -1: none
    int32_t velocity_shift[3];
    float frame;
  };
  std::vector<Row> rows;
  std::vector<int32_t> node_of;    // by node of a grid's box, z fastest: its number; 0 where all values are 0
  std::vector<float> node_ranges;  // by node: least and greatest value of its cell
  std::vector<int32_t> leaf_of;    // 4096 by node, z fastest: block of the leaf, in units of 512 values; block 0 has zeros
  std::vector<float> leaf_ranges;  // by entry of `leaf_of`: least and greatest value of its cell
  std::vector<uint16_t> halves;    // values of the blocks of grids of halves, and of the others
  std::vector<float> floats;
  bool any_blurred = false;

  GridTable();
  // Adds a grid and returns its number; throws Error with the code "volume-too-large" if the scene's grids have more than 2^31
  // values.
  int add(const GridInput& grid);
  // Adds a blurred grid and returns its number; throws as `add`.
  int add_blurred(const BlurInput& input);
  // Returns the block of the leaf at `place`, in units of leaves; 0, which has zeros, outside the grid.
  int32_t block_at(const Row& row, const std::array<int32_t, 3>& place) const;
  float number(const Row& row, size_t at) const { return row.is_half ? as_float(halves[at]) : floats[at]; }

 private:
  int32_t node_at(const Row& row, const std::array<int32_t, 3>& node) const;
  friend class BlurredRanges;
};

}  // namespace primray
