// A hierarchy of our own for worlds that consist of triangles alone, so laid out that many rays can go through it at once, each
// on its own way: bvh/interleaved.hpp. Only where a CPU has AVX-512; Embree has all else.
//
// Embree's builder decides on the splits. A node holds the boxes of up to 8 children, each in the slot whose bits best say on
// which side of the others it lies: slots, taken in the order of their numbers XOR a ray's octant, are then about ordered along
// the ray (Ylitie, Karras and Laine 2017, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs").
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "math/lanes.hpp"

namespace primray {

// Triangles by corners that count from the first position; the first `paired` of them stand in pairs (bvh/pairs.hpp).
struct TriangleSoup {
  const float* positions;   // x, y, z
  const uint32_t* indices;  // three a triangle
  uint32_t count, paired;
};

struct Unmap {
  size_t bytes = 0;
  void operator()(char* memory) const;
};

struct TriangleBvh {
  static constexpr int kWidth = 8, kLeafPairs = 4;
  static constexpr uint32_t kMaxDepth = 32;
  static constexpr bool kBuilt = PRIMRAY_MAX_LANES >= 16;

  // Where a child lies: the number of its unit of 64 bytes, and what it is.
  enum Kind : uint32_t { kNode = 0, kLeaf = 1, kEnd = 2 };
  static constexpr uint32_t kUnit = 64;
  static constexpr uint32_t id_of(size_t unit, Kind kind) { return uint32_t(unit) << 2 | kind; }
  static constexpr size_t offset_of(uint32_t id) { return size_t(id & ~3u) * (kUnit / 4); }
  static constexpr Kind kind_of(uint32_t id) { return Kind(id & 3); }

  struct alignas(kUnit) Node {
    float bounds[3][2][kWidth];  // by axis; lower, upper
    uint32_t child[kWidth];      // kEnd in empty slots, whose boxes are inside out
  };
  // Pairs of triangles (d, a, c) and (b, c, a), as Embree's quads are (bvh/pairs.hpp); fewer are filled up with the last.
  struct alignas(kUnit) Leaf {
    float at[3][4][kLeafPairs];  // by axis and corner d, b, c, a
    uint32_t first[kLeafPairs];  // the number of (d, a, c) in its group; (b, c, a) has the next
    uint32_t there;              // a bit for each (d, a, c) that is there, then for each (b, c, a)
  };

  std::unique_ptr<char, Unmap> memory;
  size_t bytes = 0;
  uint32_t root = 0;

  bool any() const { return kBuilt && memory != nullptr; }
};

// Of the triangles of a world that has nothing else. Empty where floats
// cannot hold their products: Embree then has them. That is a fact of the scene, as its bits depend on it; where memory cannot
// be had, this throws.
TriangleBvh build_triangle_bvh(const TriangleSoup& soup);

}  // namespace primray
