// Construction of triangle_bvh.hpp. The number of nodes is not known beforehand, so they are written into slabs, whose pages
// are then remapped to be contiguous: nothing is copied, and no more memory is requested than is used.
#include "bvh/triangle_bvh.hpp"

#include <sys/mman.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <memory>
#include <mutex>
#include <new>
#include <optional>
#include <utility>
#include <vector>

#include "base/error.hpp"
#include "embree/embree.hpp"
#include "math/box.hpp"

namespace primray {

void Unmap::operator()(char* memory) const { munmap(memory, bytes); }

namespace {

using Bvh = TriangleBvh;

// Products of two coordinates, and of one and the inverse of the smallest direction, must stay within the range of floats.
constexpr float kFarthest = 1e12f, kSmallest = 1e-12f;
constexpr float kInf = std::numeric_limits<float>::infinity();

using Mapped = std::unique_ptr<char, Unmap>;
Mapped map(size_t bytes) {
  void* const range = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (range == MAP_FAILED) throw std::bad_alloc();
  return Mapped(static_cast<char*>(range), {bytes});
}

// Units of 64 bytes, numbered by their final position.
class Slabs {
 public:
  explicit Slabs(size_t most_bytes) : slabs_(most_bytes / kSlab + 1) {}

  char* at(size_t unit) const { return slabs_[unit / kUnits].get() + unit % kUnits * Bvh::kUnit; }

  // Allocates units for one T, for this thread; threads take blocks, and the rest of a block stays empty.
  template <class T>
  size_t allocate() {
    constexpr size_t units = sizeof(T) / Bvh::kUnit;
    thread_local struct {
      uint64_t number = 0;
      size_t next = 0, end = 0;
    } block;
    if (block.number != number_ || block.next + units > block.end)
      block.number = number_, block.next = take_block(), block.end = block.next + kBlock;
    block.next += units;
    return block.next - units;
  }

  Mapped joined() {
    const std::lock_guard lock(mutex_);
    const size_t bytes = used_ * Bvh::kUnit;
    Mapped made = map(bytes);
    for (size_t k = 0; k * kSlab < bytes; ++k) {
      const size_t held = std::min(kSlab, bytes - k * kSlab);
      if (mremap(slabs_[k].get(), held, held, MREMAP_MAYMOVE | MREMAP_FIXED, made.get() + k * kSlab) == MAP_FAILED)
        throw std::bad_alloc();
      char* const rest = slabs_[k].release() + held;
      if (held < kSlab) munmap(rest, kSlab - held);
    }
    return made;
  }

 private:
  static constexpr size_t kSlab = size_t(1) << 22, kUnits = kSlab / Bvh::kUnit, kBlock = 1024;

  size_t take_block() {
    const std::lock_guard lock(mutex_);
    Mapped& slab = slabs_.at(used_ / kUnits);
    if (!slab) slab = map(kSlab);
    return std::exchange(used_, used_ + kBlock);
  }

  std::mutex mutex_;
  std::vector<Mapped> slabs_;
  size_t used_ = 0;
  const uint64_t number_ = ++built_;  // the rest of a thread's block must not be used by the next hierarchy
  static inline std::atomic<uint64_t> built_{0};
};

class Builder {
 public:
  explicit Builder(const TriangleSoup& soup)
      : positions_(soup.positions), indices_(soup.indices), count_(soup.count), paired_(soup.paired) {}

  Bvh build() {
    std::vector<rtc::BuildPrimitive> primitives;
    if (!bound(primitives)) return {};
    // Every leaf has a pair and every node two children.
    const size_t n = primitives.size(), most = n * (sizeof(Bvh::Leaf) + sizeof(Bvh::Node)) + kLeftOver;
    if (most / Bvh::kUnit >= size_t(1) << 30) return {};
    slabs_.emplace(most);
    const rtc::Api& e = embree();
    rtc::BuildArguments arguments;
    arguments.branching = Bvh::kWidth, arguments.max_depth = Bvh::kMaxDepth;
    // Four pairs take as long as one: subtrees of so few are leaves.
    arguments.block = arguments.min_leaf = arguments.max_leaf = Bvh::kLeafPairs;
    arguments.bvh = e.rtcNewBVH(embree_device());
    arguments.primitives = primitives.data(), arguments.count = arguments.capacity = n;
    arguments.create_node = create_node, arguments.set_children = set_children, arguments.set_bounds = set_bounds;
    arguments.create_leaf = create_leaf, arguments.user = this;
    const void* const root = e.rtcBuildBVH(&arguments);
    e.rtcReleaseBVH(arguments.bvh);
    check_embree();
    if (!root) throw Error("embree", "Embree could not build the triangle hierarchy");
    Bvh made;
    made.memory = slabs_->joined(), made.bytes = made.memory.get_deleter().bytes, made.root = id_of(root);
    return made;
  }

 private:
  static constexpr size_t kLeftOver = size_t(1) << 26;  // at the ends of blocks, one for each thread

  // Computes the boxes of leaf primitives: pairs, and single triangles. Returns false if they are outside the range of floats.
  bool bound(std::vector<rtc::BuildPrimitive>& to) const {
    const uint32_t pairs = paired_ / 2, n = count_ - pairs;
    to.resize(n);
    float reach = 0;
    for (uint32_t k = 0; k < n; ++k) {
      Box box;
      for (const uint32_t c : corners_of(k)) {
        const float* p = positions_ + 3 * size_t(c);
        const float farthest = std::max({std::abs(p[0]), std::abs(p[1]), std::abs(p[2])});
        if (!(farthest < kFarthest) || std::isnan(p[0] + p[1] + p[2])) return false;
        box.add({p[0], p[1], p[2]}), reach = std::max(reach, farthest);
      }
      to[k] = {box.low.x, box.low.y, box.low.z, 0, box.high.x, box.high.y, box.high.z, k};
    }
    return reach > kSmallest;
  }

  // Corners d, b, c, a; for a single triangle (d, a, c), b is c.
  std::array<uint32_t, 4> corners_of(uint32_t k) const {
    if (k < paired_ / 2) {
      const uint32_t* i = indices_ + 6 * size_t(k) + 2;
      return {i[0], i[2], i[3], i[1]};
    }
    const uint32_t* i = indices_ + 3 * size_t(first_of(k));
    return {i[2], i[1], i[1], i[0]};
  }
  uint32_t first_of(uint32_t k) const { return k < paired_ / 2 ? 2 * k : k + paired_ / 2; }

  // Embree holds numbers in place of pointers, plus one so that none is null.
  static void* pointer_of(size_t unit, Bvh::Kind kind) {
    return reinterpret_cast<void*>(uintptr_t(Bvh::id_of(unit, kind)) + 1);
  }
  static uint32_t id_of(const void* pointer) { return uint32_t(reinterpret_cast<uintptr_t>(pointer) - 1); }
  Bvh::Node& node_of(void* pointer) { return *reinterpret_cast<Bvh::Node*>(slabs_->at(id_of(pointer) >> 2)); }

  static void* create_node(void*, unsigned, void* user) {
    return pointer_of(static_cast<Builder*>(user)->slabs_->allocate<Bvh::Node>(), Bvh::kNode);
  }

  // Called before set_children(), with the children in the same order.
  static void set_bounds(void* to, const rtc::Bounds** bounds, unsigned count, void* user) {
    Bvh::Node& node = static_cast<Builder*>(user)->node_of(to);
    for (unsigned i = 0; i < Bvh::kWidth; ++i) {
      const bool there = i < count;
      const float low[3] = {there ? bounds[i]->lower_x : kInf, there ? bounds[i]->lower_y : kInf,
                            there ? bounds[i]->lower_z : kInf};
      const float high[3] = {there ? bounds[i]->upper_x : -kInf, there ? bounds[i]->upper_y : -kInf,
                             there ? bounds[i]->upper_z : -kInf};
      for (int axis = 0; axis < 3; ++axis) node.bounds[axis][0][i] = low[axis], node.bounds[axis][1][i] = high[axis];
    }
  }

  static void set_children(void* to, void** children, unsigned count, void* user) {
    Bvh::Node& node = static_cast<Builder*>(user)->node_of(to);
    const Bvh::Node unordered = node;
    const std::array<int, Bvh::kWidth> child_in = ordered(unordered, int(count));
    for (int slot = 0; slot < Bvh::kWidth; ++slot) {
      const int from = child_in[slot];
      for (int side = 0; side < 2; ++side)
        for (int axis = 0; axis < 3; ++axis)
          node.bounds[axis][side][slot] = from < 0 ? (side ? -kInf : kInf) : unordered.bounds[axis][side][from];
      node.child[slot] = from < 0 ? uint32_t(Bvh::kEnd) : id_of(children[from]);
    }
  }

  // Assigns children to slots, -1: none. Bit k of a slot means above the middle along axis k; children farthest from the middle
  // choose first.
  static std::array<int, Bvh::kWidth> ordered(const Bvh::Node& node, int count) {
    float away[3][Bvh::kWidth] = {}, reach[Bvh::kWidth] = {};
    for (int axis = 0; axis < 3; ++axis) {
      const float *low = node.bounds[axis][0], *high = node.bounds[axis][1];
      const float middle = *std::min_element(low, low + count) + *std::max_element(high, high + count);
      for (int i = 0; i < count; ++i) away[axis][i] = low[i] + high[i] - middle, reach[i] += std::abs(away[axis][i]);
    }
    std::array<int, Bvh::kWidth> child_in, by_reach = {0, 1, 2, 3, 4, 5, 6, 7};
    std::sort(by_reach.begin(), by_reach.begin() + count,
              [&](int a, int b) { return reach[a] != reach[b] ? reach[a] > reach[b] : a < b; });
    child_in.fill(-1);
    for (int k = 0; k < count; ++k) {
      const int child = by_reach[k];
      int best = -1;
      float most = -kInf;
      for (int slot = 0; slot < Bvh::kWidth; ++slot) {
        const auto along = [&](int axis) { return slot >> axis & 1 ? away[axis][child] : -away[axis][child]; };
        const float gain = along(0) + along(1) + along(2);
        if (child_in[slot] < 0 && (best < 0 || gain > most)) best = slot, most = gain;
      }
      child_in[best] = child;
    }
    return child_in;
  }

  static void* create_leaf(void*, const rtc::BuildPrimitive* primitives, size_t count, void* user) {
    Builder& self = *static_cast<Builder*>(user);
    const size_t unit = self.slabs_->allocate<Bvh::Leaf>();
    Bvh::Leaf& leaf = *reinterpret_cast<Bvh::Leaf*>(self.slabs_->at(unit));
    leaf.there = 0;
    for (size_t i = 0; i < Bvh::kLeafPairs; ++i) {
      const uint32_t k = primitives[std::min(i, count - 1)].prim_id;
      const std::array<uint32_t, 4> corners = self.corners_of(k);
      for (int c = 0; c < 4; ++c)
        for (int axis = 0; axis < 3; ++axis) leaf.at[axis][c][i] = self.positions_[3 * size_t(corners[c]) + axis];
      leaf.first[i] = self.first_of(k);
      if (i < count) leaf.there |= (k < self.paired_ / 2 ? 1u | 1u << Bvh::kLeafPairs : 1u) << i;
    }
    return pointer_of(unit, Bvh::kLeaf);
  }

  const float* const positions_;
  const uint32_t* const indices_;
  const uint32_t count_, paired_;
  std::optional<Slabs> slabs_;
};

}  // namespace

TriangleBvh build_triangle_bvh(const TriangleSoup& soup) {
  if (!Bvh::kBuilt || soup.count == 0) return {};
  return Builder(soup).build();
}

}  // namespace primray
