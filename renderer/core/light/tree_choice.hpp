// Choosing a light by the tree of light/tree.hpp, and finding the probability of a choice again.
//
// Slots are weighed by about the irradiance that they bring to a surface at p with normal n, and by 0 only where all of it
// comes from below the surface or is sent elsewhere. Paths go down one after the other; the lanes of a vector are slots, in an
// order of additions that does not depend on how many this machine has.
#pragma once

#include "light/importance.hpp"
#include "light/tree.hpp"

namespace primray {

// Lanes in which slots are weighed, whatever the number of paths side by side.
#if defined(__AVX512F__)
constexpr int kTreeLanes = 16;
#elif defined(__AVX2__)
constexpr int kTreeLanes = 8;
#else
constexpr int kTreeLanes = 4;
#endif

// Where light is wanted: a point, and the normal of its surface on the side that is lit; 0: from all around.
struct LitPoint {
  float p[3], n[3], across[3];  // `across`: |n|
  bool has_normal;

  template <int W>
  PRIMRAY_INLINE LitPoint(const vvec3<W>& at, const vvec3<W>& normal, int lane)
      : p{at.x[lane], at.y[lane], at.z[lane]}, n{normal.x[lane], normal.y[lane], normal.z[lane]} {
    for (int a = 0; a < 3; ++a) across[a] = n[a] < 0 ? -n[a] : n[a];
    has_normal = across[0] + across[1] + across[2] > 0;
  }
};

// The part of a cluster's light that arrives by its distance and the surface's cosine: about the mean of cos / d^2.
template <int N>
PRIMRAY_INLINE vfloat<N> geometry_of_slots(const LightTree::Block& block, int at, const LitPoint& x, vvec3<N>& to) {
  using F = vfloat<N>;
  const F near = load<N>(block.near + at);
  to = {load<N>(block.center[0] + at) - near * x.p[0], load<N>(block.center[1] + at) - near * x.p[1],
        load<N>(block.center[2] + at) - near * x.p[2]};
  const F d2 = max(dot(to, to), load<N>(block.least2 + at)), d = sqrt(d2), inverse = 1.0f / d;
  if (!x.has_normal) return inverse * inverse;
  const F h = to.x * x.n[0] + to.y * x.n[1] + to.z * x.n[2];
  const F a = load<N>(block.half[0] + at) * x.across[0], b = load<N>(block.half[1] + at) * x.across[1],
          c = load<N>(block.half[2] + at) * x.across[2];
  // The mean of what is above the surface of heights about h: half of the spread's half there, h far above.
  const F above = 0.5f * (h + sqrt(h * h + 0.25f * (a * a + b * b + c * c)));
  return select(h + (a + b + c) > F(0.0f), max(above, 1e-6f * d) * inverse * (inverse * inverse), F(0.0f));
}

// The part that is sent towards the point by lights that do not emit all around.
template <int N>
PRIMRAY_INLINE vfloat<N> cone_of_slots(const LightTree::Block& block, int at, const vvec3<N>& to) {
  using F = vfloat<N>;
  const F one(1.0f), none(0.0f);
  const vvec3<N> axis{load<N>(block.axis[0] + at), load<N>(block.axis[1] + at), load<N>(block.axis[2] + at)};
  const F distance = max(sqrt(dot(to, to)), 1e-30f), radius = load<N>(block.radius + at);
  const F cosine = -dot(axis, to) / distance, sine = safe_sqrt(one - cosine * cosine);
  const F sin_seen = min(radius / distance, one), cos_seen = safe_sqrt(one - sin_seen * sin_seen);
  const F cos_axis = load<N>(block.cos_axis + at), sin_axis = load<N>(block.sin_axis + at);
  // The angle off the nearest axis from the nearest place, as a cosine: that of the sum of both is all that can be gained.
  const F cos_sum = cos_axis * cos_seen - sin_axis * sin_seen, sin_sum = sin_axis * cos_seen + cos_axis * sin_seen;
  const vbool<N> within = (radius >= distance) | (cosine >= cos_sum) | (sin_sum < none);
  const F off = select(within, one, cosine * cos_sum + sine * sin_sum);
  return select(off > load<N>(block.cos_end + at), max(off, load<N>(block.floor + at)), none);
}

// Weights of a block's slots.
PRIMRAY_INLINE void weigh_block(const LightTable& table, const LightTree::Block& block, const LitPoint& x, float* weights) {
  constexpr int N = kTreeLanes;
  using F = vfloat<N>;
  for (int at = 0; at < LightTree::kBlock; at += N) {
    vvec3<N> to;
    F w = geometry_of_slots<N>(block, at, x, to);
    if (block.directed != 0) w = w * cone_of_slots<N>(block, at, to);
    const F intensity = load<N>(block.intensity + at);
    // Never 0 for being small.
    w = select((w > F(0.0f)) & (intensity > F(0.0f)), max(w * intensity, 1e-36f), F(0.0f));
    store(weights + at, w);
  }
  for (uint32_t left = block.exact; left; left &= left - 1) {
    const int s = __builtin_ctz(left);
    if (!(weights[s] > 0)) continue;
    vvec3<1> to;
    const vvec3<1> p{vfloat<1>(x.p[0]), vfloat<1>(x.p[1]), vfloat<1>(x.p[2])};
    const float seen = geometry_of_slots<1>(block, s, x, to)[0];
    const float d2 = std::max(dot(to, to)[0], block.least2[s]);
    const float own = light_weight(table, ~block.child[s], p)[0] * table.tree.scale * (seen * d2);
    weights[s] = own > 0 ? std::max(own, 1e-36f) : 0.0f;
  }
}

// Sums of a block's weights up to each and with it, added in one order on every machine.
PRIMRAY_INLINE void sum_block(const float* weights, float* sums) {
#if defined(__AVX512F__)
  const vint<16> lane = lane_numbers<16>();
  vfloat<16> s = load<16>(weights);
  for (int step = 1; step < 16; step *= 2)
    s = s + select(lane >= vint<16>(step), permute(s, lane - vint<16>(step)), vfloat<16>(0.0f));
  store(sums, s);
#else
  float s[2][16];
  for (int i = 0; i < 16; ++i) s[0][i] = weights[i];
  int from = 0;
  for (int step = 1; step < 16; step *= 2, from ^= 1)
    for (int i = 0; i < 16; ++i) s[from ^ 1][i] = s[from][i] + (i >= step ? s[from][i - step] : 0.0f);
  for (int i = 0; i < 16; ++i) sums[i] = s[from][i];
#endif
}

// A node's slots, weighed.
struct WeighedNode {
  alignas(64) float weights[LightTree::kMostSlots], sums[LightTree::kMostSlots];
  float before[LightTree::kBlocks + 1];  // sum of the weights of earlier blocks

  PRIMRAY_INLINE WeighedNode(const LightTable& table, const LightTree::Node& node, const LitPoint& x) {
    before[0] = 0;
    for (int k = 0; k < node.blocks; ++k) {
      float *w = weights + k * LightTree::kBlock, *s = sums + k * LightTree::kBlock;
      weigh_block(table, table.tree.blocks[size_t(node.block + k)], x, w);
      sum_block(w, s);
      before[k + 1] = before[k] + s[LightTree::kBlock - 1];
    }
  }
};

struct TreeChoice {
  int32_t light;
  float probability;  // 0: no light of the tree can reach the point
};

// The light that the number u in [0, 1) stands for.
inline TreeChoice choose_from_node(const LightTable& table, int32_t root, const LitPoint& x, double u) {
  double probability = 1;
  for (int32_t at = root;;) {
    const LightTree::Node& node = table.tree.nodes[size_t(at)];
    const WeighedNode w(table, node, x);
    const float total = w.before[node.blocks];
    if (!(total > 0)) return {0, 0.0f};
    const double wanted = u * double(total);
    // The last block that begins at or before the wanted sum and is not empty.
    int k = 0;
    for (int i = 1; i < node.blocks; ++i)
      if (double(w.before[i]) <= wanted && w.before[i + 1] > w.before[i]) k = i;
    if (!(w.before[k + 1] > w.before[k]))
      while (!(w.before[k + 1] > w.before[k])) ++k;
    const float *weights = w.weights + k * LightTree::kBlock, *sums = w.sums + k * LightTree::kBlock;
    const double within = wanted - double(w.before[k]);
    int s = 0;
    uint32_t open = 0, positive = 0;
    for (int i = 0; i < LightTree::kBlock; ++i) {
      open |= uint32_t(double(sums[i]) > within) << i;
      positive |= uint32_t(weights[i] > 0) << i;
    }
    open &= positive;
    s = open ? __builtin_ctz(open) : 31 - __builtin_clz(positive);
    probability *= double(weights[s]) / double(total);
    const double start = s > 0 ? double(sums[s - 1]) : 0.0;
    u = std::min(std::max((within - start) / double(weights[s]), 0.0), 0x1.fffffffep-1);
    const int32_t child = table.tree.blocks[size_t(node.block + k)].child[s];
    if (child < 0) return {~child, float(probability)};
    at = child;
  }
}

// With what probability that finds the light that stands at `place`.
inline float probability_from_leaf(const LightTable& table, LightTree::Place place, const LitPoint& x) {
  double probability = 1;
  while (place.node >= 0) {
    const LightTree::Node& node = table.tree.nodes[size_t(place.node)];
    const WeighedNode w(table, node, x);
    const float own = w.weights[place.slot];
    if (!(own > 0)) return 0.0f;
    probability *= double(own) / double(w.before[node.blocks]);
    place = {node.parent, node.parent_slot};
  }
  return float(probability);
}

// The same for the lanes of `m`, each with a tree of its own by `root`, and a number of 32 bits.
template <int W>
PRIMRAY_RARE void choose_in_tree(const LightTable& table, vint<W> root, vbool<W> m, const vvec3<W>& p, const vvec3<W>& n,
                                 vuint<W> u, vint<W>& light, vfloat<W>& probability) {
  light = vint<W>(0), probability = vfloat<W>(0.0f);
  for (uint32_t left = bits(m); left; left &= left - 1) {
    const int i = __builtin_ctz(left);
    const TreeChoice c = choose_from_node(table, root[i], LitPoint(p, n, i), double(u[i]) * 0x1p-32);
    light.set(i, c.light), probability.set(i, c.probability);
  }
}

// `places` and `at`: each lane's light stands at places[at].
template <int W>
PRIMRAY_RARE vfloat<W> probability_in_tree(const LightTable& table, const LightTree::Place* places, vint<W> at, vbool<W> m,
                                           const vvec3<W>& p, const vvec3<W>& n) {
  vfloat<W> probability(0.0f);
  for (uint32_t left = bits(m); left; left &= left - 1) {
    const int i = __builtin_ctz(left);
    probability.set(i, probability_from_leaf(table, places[at[i]], LitPoint(p, n, i)));
  }
  return probability;
}

}  // namespace primray
