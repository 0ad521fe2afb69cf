// Bounding volume hierarchy for worlds that consist of triangles alone, with a layout for many rays that traverse it at once
// (bvh/interleaved.hpp). Only used on CPUs with AVX-512; Embree handles everything else.
//
// Embree's builder decides on the splits. A node holds the boxes of up to 8 children, each in the slot whose bits best describe
// on which side of the others it is: slots, visited in the order of their numbers XOR a ray's octant, are then approximately
// ordered along the ray (Ylitie, Karras and Laine 2017, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide
// BVHs").
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "math/lanes.hpp"

namespace primray {

// Triangles with corner indices from the first position on; the first `paired` of them are in pairs (bvh/pairs.hpp).
struct TriangleSoup {
  const float* positions;   // x, y, z
  const uint32_t* indices;  // three per triangle
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

  // Reference to a child: the number of its unit of 64 bytes, and its kind.
  enum Kind : uint32_t { kNode = 0, kLeaf = 1, kEnd = 2 };
  static constexpr uint32_t kUnit = 64;
  static constexpr uint32_t id_of(size_t unit, Kind kind) { return uint32_t(unit) << 2 | kind; }
  static constexpr size_t offset_of(uint32_t id) { return size_t(id & ~3u) * (kUnit / 4); }
  static constexpr Kind kind_of(uint32_t id) { return Kind(id & 3); }

  struct alignas(kUnit) Node {
    float bounds[3][2][kWidth];  // by axis; lower, upper
    uint32_t child[kWidth];      // kEnd in empty slots, whose boxes are inverted
  };
  // Pairs of triangles (d, a, c) and (b, c, a), as in Embree's quads (bvh/pairs.hpp); the last one is repeated to fill the
  // leaf.
  struct alignas(kUnit) Leaf {
    float at[3][4][kLeafPairs];  // by axis and corner d, b, c, a
    uint32_t first[kLeafPairs];  // index of (d, a, c) in its group; (b, c, a) has the next
    uint32_t there;              // one bit for each (d, a, c) that is present, then for each (b, c, a)
  };

  std::unique_ptr<char, Unmap> memory;
  size_t bytes = 0;
  uint32_t root = 0;

  bool any() const { return kBuilt && memory != nullptr; }
};

// Builds the hierarchy of a world that has only these triangles. Empty if floats cannot hold their products: Embree then
// handles them. That is a property of the scene, as its bits depend on it; if memory runs out, this throws.
TriangleBvh build_triangle_bvh(const TriangleSoup& soup);

}  // namespace primray
