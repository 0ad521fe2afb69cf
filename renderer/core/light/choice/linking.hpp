// Light and shadow linking: which surfaces are in which collections, and the choice among the lights that reach a surface.
//
// Surfaces wear a row, lights name a collection; number 0 holds everything. Scenes without linking have no table, and pay
// nothing.
#pragma once

#include <cstdint>
#include <vector>

#include "base/features.hpp"
#include "light/choice/tree.hpp"
#include "math/vec3.hpp"

namespace primray {

// The row of rays that left no surface yet: every light may show itself to the camera.
constexpr int32_t kUnlinkedRow = -1;

struct LinkTable {
  int rows = 0, words = 0;    // words of 32 collections a row
  std::vector<int32_t> bits;  // row by row: whether what wears the row is in the collection
  bool any() const { return built::kLinks && words > 0; }
  bool holds(int row, int collection) const {
    return collection == 0 || (uint32_t(bits[size_t(row) * words + (collection >> 5)]) >> (collection & 31) & 1);
  }
};

inline constexpr int32_t kBits[32] = {1 << 0,  1 << 1,  1 << 2,  1 << 3,  1 << 4,  1 << 5,  1 << 6,  1 << 7,
                                      1 << 8,  1 << 9,  1 << 10, 1 << 11, 1 << 12, 1 << 13, 1 << 14, 1 << 15,
                                      1 << 16, 1 << 17, 1 << 18, 1 << 19, 1 << 20, 1 << 21, 1 << 22, 1 << 23,
                                      1 << 24, 1 << 25, 1 << 26, 1 << 27, 1 << 28, 1 << 29, 1 << 30, int32_t(0x80000000u)};

// Lanes whose row is in the collection; all of those without a row.
template <int W>
PRIMRAY_INLINE vbool<W> in_collection(const LinkTable& table, vint<W> row, int collection) {
  if (collection == 0 || !table.any()) return vbool<W>(true);
  const vint<W> word = gather<W>(table.bits.data() + (collection >> 5), max(row, 0) * vint<W>(table.words));
  return (row < vint<W>(0)) | ((word & vint<W>(kBits[collection & 31])) != vint<W>(0));
}

// The same for a collection of its own in every lane.
template <int W>
PRIMRAY_INLINE vbool<W> in_collection(const LinkTable& table, vint<W> row, vint<W> collection) {
  if (!table.any()) return vbool<W>(true);
  const vint<W> word = gather<W>(table.bits.data(), max(row, 0) * vint<W>(table.words) + (collection >> 5));
  const vint<W> bit = gather<W>(kBits, collection & vint<W>(31));
  return (row < vint<W>(0)) | (collection == vint<W>(0)) | ((word & bit) != vint<W>(0));
}

// By row of the LinkTable, the lights that reach it, ascending, and the tree by which they are chosen: where there are too many
// lights to weigh each. Rows that the same lights reach share both. Empty if that would take too much memory: the choice is
// then among all lights.
struct LinkedLights {
  std::vector<int32_t> first, count, root;  // root -1: no light
  std::vector<int32_t> lights;
  std::vector<LightTree::Place> places;  // of `lights`
  int longest = 0;
  static constexpr size_t kMost = size_t(1) << 23;
  bool any() const { return !first.empty(); }
};

// The last i in [0, count) with table[base + i] <= x; 0 where count is 0. `longest`: no count is larger.
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
