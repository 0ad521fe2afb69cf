// See triangle_bvh.hpp. Nodes and leaves are written where they stay, in a range of addresses that is as long as the worst case
// needs; only what is written takes memory.
#include "accel/triangle_bvh.hpp"

#include <sys/mman.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <vector>

#include "accel/embree.hpp"
#include "accel/pairs.hpp"
#include "math/box.hpp"
#include "scene/scene.hpp"

namespace primray {

void Unmap::operator()(char* memory) const { munmap(memory, reserved); }
void Unmap::shrink(char* memory, size_t used) {
  if (used < reserved) munmap(memory + used, reserved - used), reserved = used;
}

namespace {

using Bvh = TriangleBvh;

// Products of two coordinates, and of one and the inverse of the least direction, must stay what floats hold; as must those of
// the smallest.
constexpr float kFarthest = 1e12f, kSmallest = 1e-12f;
constexpr float kInf = std::numeric_limits<float>::infinity();

class Builder {
 public:
  Builder(const Scene& scene, const Group& world)
      : positions_(scene.positions.data() + 3 * size_t(world.vertex_base)),
        indices_(scene.indices.data() + 3 * size_t(world.triangle_base)),
        count_(world.triangle_count),
        paired_(count_paired({indices_, 3 * size_t(count_)})) {}

  Bvh build() {
    std::vector<rtc::BuildPrimitive> primitives;
    if (!bound(primitives)) return {};
    // No leaf is without a pair and no node without two children.
    const size_t n = primitives.size(), most = n * (sizeof(Bvh::Leaf) + sizeof(Bvh::Node)) + kBlock * kMostBlocks;
    if (most / Bvh::kUnit >= size_t(1) << 30) return {};
    void* const range = mmap(nullptr, most, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (range == MAP_FAILED) return {};
    Bvh made;
    made.memory = std::unique_ptr<char, Unmap>(static_cast<char*>(range), {most});
    base_ = made.memory.get();
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
    if (!root) return {};
    made.root = id_in(root), made.bytes = used_;
    made.memory.get_deleter().shrink(made.memory.get(), made.bytes);
    return made;
  }

 private:
  // Builder threads take blocks; what of them is left over is never written.
  static constexpr size_t kBlock = size_t(1) << 16, kMostBlocks = 1024;

  // Boxes of what goes into leaves: pairs, and triangles without one. False where that is not for floats.
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

  // Corners d, b, c, a; of a lone triangle (d, a, c), b is c.
  std::array<uint32_t, 4> corners_of(uint32_t k) const {
    if (k < paired_ / 2) {
      const uint32_t* i = indices_ + 6 * size_t(k) + 2;
      return {i[0], i[2], i[3], i[1]};
    }
    const uint32_t* i = indices_ + 3 * size_t(first_of(k));
    return {i[2], i[1], i[1], i[0]};
  }
  uint32_t first_of(uint32_t k) const { return k < paired_ / 2 ? 2 * k : k + paired_ / 2; }

  template <class T>
  T* allocate() {
    thread_local struct {
      uint64_t build = 0;
      size_t at = 0, end = 0;
    } block;
    if (block.build != build_ || block.at + sizeof(T) > block.end) {
      block.build = build_, block.at = used_.fetch_add(kBlock), block.end = block.at + kBlock;
    }
    T* const made = reinterpret_cast<T*>(base_ + block.at);
    block.at += sizeof(T);
    return made;
  }
  uint32_t id_in(const void* tagged) const {
    const size_t at = size_t(static_cast<const char*>(tagged) - base_);
    return Bvh::id_of(at / Bvh::kUnit, at % Bvh::kUnit ? Bvh::kLeaf : Bvh::kNode);
  }

  static void* create_node(void*, unsigned, void* user) { return static_cast<Builder*>(user)->allocate<Bvh::Node>(); }

  // Called before set_children(), with the children in the same order.
  static void set_bounds(void* to, const rtc::Bounds** bounds, unsigned count, void*) {
    Bvh::Node& node = *static_cast<Bvh::Node*>(to);
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
    Bvh::Node& node = *static_cast<Bvh::Node*>(to);
    const Bvh::Node unordered = node;
    const std::array<int, Bvh::kWidth> child_in = ordered(unordered, int(count));
    for (int slot = 0; slot < Bvh::kWidth; ++slot) {
      const int from = child_in[slot];
      for (int side = 0; side < 2; ++side)
        for (int axis = 0; axis < 3; ++axis)
          node.bounds[axis][side][slot] = from < 0 ? (side ? -kInf : kInf) : unordered.bounds[axis][side][from];
      node.child[slot] = from < 0 ? uint32_t(Bvh::kEnd) : static_cast<Builder*>(user)->id_in(children[from]);
    }
  }

  // Which child goes into which slot, -1: none. Bit k of a slot is for what lies above the middle along axis k; the child that
  // gains most by a slot takes it first.
  static std::array<int, Bvh::kWidth> ordered(const Bvh::Node& node, int count) {
    float away[Bvh::kWidth][3];
    for (int axis = 0; axis < 3; ++axis) {
      const float *low = node.bounds[axis][0], *high = node.bounds[axis][1];
      const float middle = *std::min_element(low, low + count) + *std::max_element(high, high + count);
      for (int i = 0; i < count; ++i) away[i][axis] = low[i] + high[i] - middle;
    }
    struct Choice {
      float gain;
      int child, slot;
    };
    std::array<Choice, Bvh::kWidth * Bvh::kWidth> choices;
    int n = 0;
    for (int i = 0; i < count; ++i)
      for (int slot = 0; slot < Bvh::kWidth; ++slot) {
        const auto along = [&](int axis) { return slot >> axis & 1 ? away[i][axis] : -away[i][axis]; };
        choices[n++] = {along(0) + along(1) + along(2), i, slot};
      }
    std::stable_sort(choices.begin(), choices.begin() + n, [](const Choice& a, const Choice& b) { return a.gain > b.gain; });
    std::array<int, Bvh::kWidth> child_in;
    child_in.fill(-1);
    uint32_t placed = 0;
    for (int k = 0; k < n; ++k) {
      const Choice& c = choices[k];
      if (child_in[c.slot] >= 0 || placed >> c.child & 1) continue;
      child_in[c.slot] = c.child, placed |= 1u << c.child;
    }
    return child_in;
  }

  // Leaves are told from nodes by the lowest bit of their address.
  static void* create_leaf(void*, const rtc::BuildPrimitive* primitives, size_t count, void* user) {
    Builder& self = *static_cast<Builder*>(user);
    Bvh::Leaf& leaf = *self.allocate<Bvh::Leaf>();
    leaf.there = 0;
    for (size_t i = 0; i < Bvh::kLeafPairs; ++i) {
      const uint32_t k = primitives[std::min(i, count - 1)].prim_id;
      const std::array<uint32_t, 4> corners = self.corners_of(k);
      for (int c = 0; c < 4; ++c)
        for (int axis = 0; axis < 3; ++axis) leaf.at[axis][c][i] = self.positions_[3 * size_t(corners[c]) + axis];
      leaf.first[i] = self.first_of(k);
      if (i < count) leaf.there |= (k < self.paired_ / 2 ? 1u | 1u << Bvh::kLeafPairs : 1u) << i;
    }
    return reinterpret_cast<char*>(&leaf) + 1;
  }

  const float* const positions_;
  const uint32_t* const indices_;
  const uint32_t count_, paired_;
  char* base_ = nullptr;
  std::atomic<size_t> used_{0};
  const uint64_t build_ = ++builds_;  // threads keep what is left of a block, which must not go into the next hierarchy
  static inline std::atomic<uint64_t> builds_{0};
};

}  // namespace

TriangleBvh build_triangle_bvh(const Scene& scene) {
  const Group& world = scene.groups[0];
  const bool more = world.cutout_count + world.sphere_count + world.placement_count > 0;
  if (!Bvh::kBuilt || more || world.triangle_count == 0) return {};
  return Builder(scene, world).build();
}

}  // namespace primray
