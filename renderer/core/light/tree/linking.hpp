// Light and shadow linking: which surfaces are in which collections, and the choice among the lights that illuminate a surface.
//
// Surfaces are assigned a row of the table, lights name a collection; collection 0 holds everything. Scenes without linking
// have no table and no cost.
#pragma once

#include <cstdint>
#include <vector>

#include "base/features.hpp"
#include "light/tree/light_tree.hpp"
#include "math/vec3.hpp"

namespace primray {

// Link row of rays that have left no surface yet: every light is visible to the camera.
constexpr int32_t kUnlinkedRow = -1;

struct LinkTable {
  int rows = 0, words = 0;    // words of 32 collections per row
  std::vector<int32_t> bits;  // membership[row][collection], one bit each
  bool any() const { return built::kLinks && words > 0; }
  bool holds(int row, int collection) const {
    return collection == 0 || (uint32_t(bits[size_t(row) * words + (collection >> 5)]) >> (collection & 31) & 1);
  }
};

inline constexpr int32_t kBits[32] = {1 << 0,  1 << 1,  1 << 2,  1 << 3,  1 << 4,  1 << 5,  1 << 6,  1 << 7,
                                      1 << 8,  1 << 9,  1 << 10, 1 << 11, 1 << 12, 1 << 13, 1 << 14, 1 << 15,
                                      1 << 16, 1 << 17, 1 << 18, 1 << 19, 1 << 20, 1 << 21, 1 << 22, 1 << 23,
                                      1 << 24, 1 << 25, 1 << 26, 1 << 27, 1 << 28, 1 << 29, 1 << 30, int32_t(0x80000000u)};

// Returns the lanes whose row is in the collection, or that have no row.
template <int W>
PRIMRAY_INLINE vbool<W> in_collection(const LinkTable& table, vint<W> row, int collection) {
  if (collection == 0 || !table.any()) return vbool<W>(true);
  const vint<W> word = gather<W>(table.bits.data() + (collection >> 5), max(row, 0) * vint<W>(table.words));
  return (row < vint<W>(0)) | ((word & vint<W>(kBits[collection & 31])) != vint<W>(0));
}

// Returns the lanes whose row is in the lane's own collection.
template <int W>
PRIMRAY_INLINE vbool<W> in_collection(const LinkTable& table, vint<W> row, vint<W> collection) {
  if (!table.any()) return vbool<W>(true);
  const vint<W> word = gather<W>(table.bits.data(), max(row, 0) * vint<W>(table.words) + (collection >> 5));
  const vint<W> bit = gather<W>(kBits, collection & vint<W>(31));
  return (row < vint<W>(0)) | (collection == vint<W>(0)) | ((word & bit) != vint<W>(0));
}

// Lights that illuminate each row of the LinkTable, in ascending order, and the light tree over them where there are too many
// to weigh each. Rows with the same lights share both. Empty if it would need too much memory: lights are then chosen among
// all.
struct LinkedLights {
  std::vector<int32_t> first, count, root;  // root -1: no light
  std::vector<int32_t> lights;
  std::vector<LightTree::Place> places;  // positions of `lights` in the tree
  int longest = 0;
  static constexpr size_t kMost = size_t(1) << 23;
  bool any() const { return !first.empty(); }
};

// Returns the last i in [0, count) with table[base + i] <= x, or 0 where count is 0. `longest`: upper limit of count.
template <class T, int W>
PRIMRAY_INLINE vint<W> last_not_above(const T* table, vint<W> base, vint<W> count, int longest, Vector<T, W> x) {
  vint<W> lo(0);
  if (longest == 0) return lo;
  for (int step = 1 << (31 - __builtin_clz(unsigned(longest))); step > 0; step >>= 1) {
    const vint<W> mid = lo + vint<W>(step);
    const vbool<W> inside = mid < count;
    const Vector<T, W> value = gather<W>(table, base + select(inside, mid, vint<W>(0)));
    lo = select(inside & (value <= x), mid, lo);
  }
  return lo;
}

}  // namespace primray
