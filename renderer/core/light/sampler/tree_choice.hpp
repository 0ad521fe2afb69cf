// Sampling of the light tree (light/tree/light_tree.hpp), and the probability of a given light.
//
// Slots are weighed by approximately the irradiance that they cause on a surface at p with normal n, and by 0 only if all of it
// comes from below the surface or is emitted elsewhere. Where a cluster's mean is a poor estimate, since the surface's plane
// cuts the cluster or the point is close, it is weighed by the sum of its own slots (cf. the paper's adaptive splitting). Paths
// traverse the tree one after the other; the lanes of a vector are slots, added up in an order that does not depend on the
// vector width of this machine.
#pragma once

#include <algorithm>

#include "light/light.hpp"
#include "light/tree/light_tree.hpp"
#include "medium/phase_function.hpp"

namespace primray {

// Importance of one light at a point: the weight by which lights are chosen, one by one or in the leaves of a tree.

// Upper estimate of the irradiance at p from one light; 0 only if it cannot reach p. Depends on the position alone, so that the
// next vertex can recompute the probability of the choice from the ray's origin.
template <int W>
PRIMRAY_INLINE vfloat<W> light_importance(const float* row, const vvec3<W>& p) {
  vfloat<W> found(row[kImportance]);
  with_light_type(row, [&]<class T>(T) {
    const vvec3<W> to = p - LightRow<W>(row).vector(T::kCenter);
    found = T::importance(row, to, max(dot(to, to), 1e-30f), found);
  });
  return found;
}

// Importance of a light that moves, as if all of it could be at the nearest point of its path. The choice does not depend on
// time.
template <int W>
PRIMRAY_RARE vfloat<W> passing_importance(const LightPath& path, const float* row, const vvec3<W>& p) {
  const vfloat<W> power(row[kImportance]);
  if (!(path.radius > 0)) return power;
  const vvec3<W> to = p - vvec3<W>(vfloat<W>(path.center.x), vfloat<W>(path.center.y), vfloat<W>(path.center.z));
  return power * path.spread / max(dot(to, to), path.radius * path.radius);
}

// Weight of light number `i` at p: its importance, with its shaping.
template <int W>
PRIMRAY_INLINE vfloat<W> light_weight(const LightTable& table, int i, const vvec3<W>& p) {
  const float* row = table.row(i);
  if (const int32_t path = table.motion.any() ? table.motion.row(i) : -1; path >= 0)
    return passing_importance(table.motion.paths[size_t(path)], row, p);
  const vfloat<W> unshaped = light_importance(row, p);
  const int shaping = int_at(row, kShaping);
  if (shaping == 0 || (int_at(row, kLightFlags) & kMoving)) return unshaped;
  const vvec3<W> to = p - LightRow<W>(row).vector(light_center(row));
  return unshaped * shaping_importance(table.shaping, shaping, to);
}

// Lanes in which slots are weighed, however many paths are rendered at once.
#if defined(__AVX512F__)
constexpr int kTreeLanes = 16;
#elif defined(__AVX2__)
constexpr int kTreeLanes = 8;
#else
constexpr int kTreeLanes = 4;
#endif

// Preview of lobes for telling lights apart, in lanes `m`. Of glossy surfaces: a GGX lobe about the mirror direction of unit wo
// with share `specular` of the albedo, and `rest` in all directions. In media: the phase function `phase` about -wo
// (medium/phase_function.hpp); 0 elsewhere.
template <int W>
struct LobePreview {
  vbool<W> m;
  vvec3<W> wo;
  vfloat<W> alpha2, specular, rest, phase{0.0f};
};

// Shading point: position, and the normal on its lit side; 0: lit from all around.
struct LitPoint {
  float p[3], n[3], across[3];  // `across`: |n|
  bool has_normal, previewed = false;
  float wo[3], alpha2, specular, rest, phase;  // if `previewed`
  DropletLobes<1> droplets;                    // if `phase` is of droplets

  LitPoint() = default;
  template <int W>
  PRIMRAY_INLINE LitPoint(const vvec3<W>& at, const vvec3<W>& normal, int lane)
      : p{at.x[lane], at.y[lane], at.z[lane]}, n{normal.x[lane], normal.y[lane], normal.z[lane]} {
    for (int a = 0; a < 3; ++a) across[a] = n[a] < 0 ? -n[a] : n[a];
    has_normal = across[0] + across[1] + across[2] > 0;
  }
  template <int W>
  PRIMRAY_INLINE void send_on(const LobePreview<W>& s, int lane) {
    previewed = s.m[lane] != 0;
    wo[0] = s.wo.x[lane], wo[1] = s.wo.y[lane], wo[2] = s.wo.z[lane];
    alpha2 = s.alpha2[lane], specular = s.specular[lane], rest = s.rest[lane], phase = s.phase[lane];
    if (phase > 1) droplets = DropletLobes<1>::of(vfloat<1>(phase));
  }
};

// Geometry of a cluster: its mean position relative to the point, the clamped squared distance and its inverse, its height
// above the surface, and half of its extent in height.
template <int N>
struct SlotPlace {
  using F = vfloat<N>;
  vvec3<N> to;
  F near, d2, inverse, h{0.0f}, reach{0.0f};

  PRIMRAY_INLINE SlotPlace(const LightTree::Block& block, int at, const LitPoint& x) : near(load<N>(block.near + at)) {
    to = {load<N>(block.center[0] + at) - near * x.p[0], load<N>(block.center[1] + at) - near * x.p[1],
          load<N>(block.center[2] + at) - near * x.p[2]};
    d2 = min(max(dot(to, to), load<N>(block.least2 + at)), 1e24f);
    inverse = 1.0f / sqrt(d2);
    if (!x.has_normal) return;
    h = to.x * x.n[0] + to.y * x.n[1] + to.z * x.n[2];
    reach = load<N>(block.half[0] + at) * x.across[0] + load<N>(block.half[1] + at) * x.across[1] +
            load<N>(block.half[2] + at) * x.across[2];
  }
};

// Cosine at the surface towards a cluster, approximately averaged over it.
template <int N>
PRIMRAY_INLINE vfloat<N> cosine_of_slots(const LightTree::Block& block, int at, const LitPoint& x, const SlotPlace<N>& s) {
  using F = vfloat<N>;
  if (!x.has_normal) return F(1.0f);
  const F up = s.h + s.reach;
  F above = s.h;
  // Mean height of the part above the surface: that of the mean position if all of it is; otherwise as if it were uniform over
  // heights, but for clusters mostly below, no more than Cantelli's inequality allows to be above at all.
  if (any((s.h < s.reach) & (up > F(0.0f)))) {
    const F spread2 = load<N>(block.least2 + at), below = min(s.h, 0.0f);
    const F part = 0.25f * up * (up * spread2 / (s.reach * (spread2 + below * below)));
    above = select(s.h >= s.reach, s.h, part);
  }
  return select(up > F(0.0f), max(above * s.inverse, 1e-6f), F(0.0f));
}

// Upper bound of the squared cosine / d^2 for clusters whose lights could all be at the nearest position, or at the highest one
// above the surface; 0 for clusters that are far away and entirely visible.
template <int N>
PRIMRAY_INLINE vfloat<N> most_of_slots(const LightTree::Block& block, int at, const LitPoint& x, const SlotPlace<N>& s) {
  using F = vfloat<N>;
  const F zero(0.0f), up = s.h + s.reach, radius = load<N>(block.radius + at);
  const vbool<N> close = (s.near > zero) & ((s.d2 < radius * radius * 2.0f) | ((s.h < s.reach) & (up > zero)));
  if (!any(close)) return zero;
  const F dx = max(abs(s.to.x) - load<N>(block.half[0] + at), zero), dy = max(abs(s.to.y) - load<N>(block.half[1] + at), zero),
          dz = max(abs(s.to.z) - load<N>(block.half[2] + at), zero);
  const F least2 = clamp(dx * dx + dy * dy + dz * dz, 1e-12f, 1e12f);
  const F cos2 = x.has_normal ? min(up * up, least2) : least2;
  return select(close & (up >= zero), cos2 / (least2 * least2 * least2), zero);
}

// Share of the emission that directed lights send towards the point.
template <int N>
PRIMRAY_INLINE vfloat<N> cone_of_slots(const LightTree::Block& block, int at, const SlotPlace<N>& s) {
  using F = vfloat<N>;
  const F one(1.0f), none(0.0f);
  const vvec3<N> axis{load<N>(block.axis[0] + at), load<N>(block.axis[1] + at), load<N>(block.axis[2] + at)};
  const F cosine = -dot(axis, s.to) * s.inverse;
  F off = cosine;
  if (block.wide != 0) {
    const F sine = safe_sqrt(one - cosine * cosine), sin_seen = min(load<N>(block.radius + at) * s.inverse, one);
    const F cos_seen = safe_sqrt(one - sin_seen * sin_seen);
    const F cos_axis = load<N>(block.cos_axis + at), sin_axis = load<N>(block.sin_axis + at);
    // Cosine of the smallest possible angle off the axis as seen from the nearest position: bounded by the sum of both angles.
    const F cos_sum = cos_axis * cos_seen - sin_axis * sin_seen, sin_sum = sin_axis * cos_seen + cos_axis * sin_seen;
    const vbool<N> within = (sin_seen >= one) | (cosine >= cos_sum) | (sin_sum < none);
    off = select(within, one, cosine * cos_sum + sine * sin_sum);
  }
  return select(off > load<N>(block.cos_end + at), max(off, load<N>(block.floor + at)), none);
}

// Phase function of Henyey and Greenstein at a cosine, relative to isotropic scattering. Its peak is widened by the angular
// size `seen` of a cluster: with a far-off angle a it is a function of (1 - |g|)^2 + |g| a^2, to which the mean square of the
// size is added.
template <int N>
PRIMRAY_INLINE vfloat<N> widened_peak(vfloat<N> g, vfloat<N> cosine, vfloat<N> seen) {
  return henyey_greenstein_at(max(1.0f + g * g - 2.0f * g * cosine + 0.5f * abs(g) * seen * seen, 1e-6f), g, 1.0f);
}

// Phase function towards a cluster, relative to isotropic scattering.
template <int N>
PRIMRAY_INLINE vfloat<N> scattered_from_slots(const LightTree::Block& block, int at, const LitPoint& x, const SlotPlace<N>& s) {
  using F = vfloat<N>;
  const F seen = min(load<N>(block.radius + at) * s.inverse, 1.0f);
  const F cosine = -(s.to.x * x.wo[0] + s.to.y * x.wo[1] + s.to.z * x.wo[2]) * s.inverse;
  if (!(x.phase > 1)) return widened_peak<N>(F(x.phase), cosine, seen);
  const DropletLobes<1>& lobes = x.droplets;
  const float weight = lobes.weight[0], alpha = lobes.draine.alpha[0], norm = lobes.draine.norm()[0];
  const F broad = widened_peak<N>(F(lobes.draine.g[0]), cosine, seen) * (1.0f + alpha * cosine * cosine) * (1 / norm);
  return (1 - weight) * widened_peak<N>(F(lobes.g[0]), cosine, seen) + weight * broad;
}

// Response of a glossy surface to a cluster, relative to a white Lambert surface: about pi times its BRDF, with the lobe
// widened by the cluster's angular size.
template <int N>
PRIMRAY_INLINE vfloat<N> sent_on_from_slots(const LightTree::Block& block, int at, const LitPoint& x, const SlotPlace<N>& s) {
  using F = vfloat<N>;
  if (x.phase != 0) return scattered_from_slots<N>(block, at, x, s);
  const F seen = min(load<N>(block.radius + at) * s.inverse, 1.0f);
  const vvec3<N> h{s.to.x * s.inverse + x.wo[0], s.to.y * s.inverse + x.wo[1], s.to.z * s.inverse + x.wo[2]};
  const F along = h.x * x.n[0] + h.y * x.n[1] + h.z * x.n[2], along2 = along * along, h2 = dot(h, h);
  const F tan2 = max(h2 - along2, 0.0f) / max(max(along2, 1e-6f * h2), 1e-20f);
  const F q = x.alpha2 + 0.25f * seen * seen + tan2;
  return x.rest + x.specular * 0.25f * x.alpha2 / (q * q);
}

// Weights of a block's slots, and the squares of their upper bounds over the positions of their lights.
PRIMRAY_INLINE void weigh_block(const LightTable& table, const LightTree::Block& block, const LitPoint& x, float* weights,
                                float* most2) {
  constexpr int N = kTreeLanes;
  using F = vfloat<N>;
  for (int at = 0; at < LightTree::kBlock; at += N) {
    const SlotPlace<N> place(block, at, x);
    F w = cosine_of_slots<N>(block, at, x, place) * (place.inverse * place.inverse);
    const F intensity = load<N>(block.intensity + at);
    F sent(1.0f);
    if (block.directed != 0) w = w * (sent = cone_of_slots<N>(block, at, place));
    if (block.clusters != 0) {
      const F all = intensity * sent;
      store(most2 + at, most_of_slots<N>(block, at, x, place) * all * all);
    }
    if (x.previewed) w = w * sent_on_from_slots<N>(block, at, x, place);
    // Small weights must not become 0.
    w = select((w > F(0.0f)) & (intensity > F(0.0f)), max(w * intensity, 1e-36f), F(0.0f));
    store(weights + at, w);
  }
  for (uint32_t left = block.exact; left; left &= left - 1) {
    const int s = __builtin_ctz(left);
    if (!(weights[s] > 0)) continue;
    const vvec3<1> p{vfloat<1>(x.p[0]), vfloat<1>(x.p[1]), vfloat<1>(x.p[2])};
    const SlotPlace<1> place(block, s, x);
    float own = light_weight(table, ~block.child[s], p)[0] * table.tree.scale * cosine_of_slots<1>(block, s, x, place)[0];
    if (x.previewed) own *= sent_on_from_slots<1>(block, s, x, place)[0];
    weights[s] = own > 0 ? std::max(own, 1e-36f) : 0.0f;
  }
}

// Inclusive prefix sums of 16 weights, added in the same order on every machine: each to those 1, 2, 4 and 8 before it.
PRIMRAY_INLINE void running_sums(const float* weights, float* sums) {
  constexpr int N = kTreeLanes, kVectors = 16 / N;
  const vint<N> lane = lane_numbers<N>();
  vfloat<N> s[kVectors];
  for (int k = 0; k < kVectors; ++k) s[k] = load<N>(weights + k * N);
  for (int step = 1; step < 16; step *= 2) {
    for (int k = kVectors - 1; k >= step / N; --k) {
      if (step >= N) {
        s[k] = s[k] + s[k - step / N];
        continue;
      }
      const vint<N> from = lane - vint<N>(step);  // modulo N
      const vfloat<N> before = k > 0 ? permute(s[k > 0 ? k - 1 : 0], from) : vfloat<N>(0.0f);
      s[k] = s[k] + select(lane >= vint<N>(step), permute(s[k], from), before);
    }
  }
  for (int k = 0; k < kVectors; ++k) store(sums + k * N, s[k]);
}

// Sum of 16 weights, added in the same order on every machine.
PRIMRAY_INLINE float sum_of_block(const float* w) {
  const vfloat<4> s = (load<4>(w) + load<4>(w + 8)) + (load<4>(w + 4) + load<4>(w + 12));
  return (s[0] + s[2]) + (s[1] + s[3]);
}

// A cluster's slots are weighed if it could have at least the share kWorthwhile of its node's weight, and kDoubtful times the
// weight of its mean. On three halls of 500 lamps, 64 samples, relMSE fell by 12 to 37 %; kDoubtful = 2 instead of 100 gains
// another 0 to 3 %, for 50 to 90 % more CPU time.
constexpr float kWorthwhile = 0.5f, kDoubtful = 100;

// Weighed slots of a node: slots of the same lane in all blocks are a column, and columns follow each other.
struct WeighedNode {
  alignas(64) float weights[LightTree::kLastSlots], columns[LightTree::kBlock], sums[LightTree::kBlock];
  alignas(64) float most2[LightTree::kLastSlots];  // of the slots that are clusters: see weigh_block()
  uint32_t clusters;                               // 0: there are none

  WeighedNode() = default;
  PRIMRAY_INLINE WeighedNode(const LightTable& table, const LightTree::Node& node, const LitPoint& x) {
    weigh(table, node, x);
    look_into_clusters(table, node, x);
  }

  // Weighs slots, clusters by their means.
  PRIMRAY_INLINE void weigh(const LightTable& table, const LightTree::Node& node, const LitPoint& x) {
    clusters = 0;
    for (int k = 0; k < node.blocks; ++k) {
      const LightTree::Block& block = table.tree.blocks[size_t(node.block + k)];
      weigh_block(table, block, x, weights + k * LightTree::kBlock, most2 + k * LightTree::kBlock);
      clusters |= block.clusters;
    }
    add_up(node);
  }

  PRIMRAY_INLINE void add_up(const LightTree::Node& node) {
    constexpr int N = kTreeLanes;
    for (int k = 0; k < node.blocks; ++k) {
      const float* w = weights + k * LightTree::kBlock;
      for (int at = 0; at < LightTree::kBlock; at += N)
        store(columns + at, k == 0 ? load<N>(w + at) : load<N>(columns + at) + load<N>(w + at));
    }
    running_sums(columns, sums);
  }

  // Weighs clusters whose mean is a poor estimate by their own slots.
  PRIMRAY_INLINE void look_into_clusters(const LightTable& table, const LightTree::Node& node, const LitPoint& x) {
    if (clusters != 0) look_into(table, node, x);
  }
  inline void look_into(const LightTable& table, const LightTree::Node& node, const LitPoint& x) {
    constexpr int N = kTreeLanes;
    const vfloat<N> worthwhile(kWorthwhile * total());
    bool changed = false;
    for (int k = 0; k < node.blocks; ++k) {
      const LightTree::Block& block = table.tree.blocks[size_t(node.block + k)];
      float* w = weights + k * LightTree::kBlock;
      uint32_t doubtful = 0;
      for (int at = 0; at < LightTree::kBlock; at += N) {
        const vfloat<N> least = max(load<N>(w + at) * kDoubtful, worthwhile);
        doubtful |= bits(load<N>(most2 + k * LightTree::kBlock + at) > least * least) << at;
      }
      for (doubtful &= block.clusters; doubtful; doubtful &= doubtful - 1) {
        const int s = __builtin_ctz(doubtful);
        w[s] = total_of_node(table, block.child[s], x);
        changed = true;
      }
    }
    if (changed) add_up(node);
  }
  static float total_of_node(const LightTable& table, int32_t node, const LitPoint& x);
  PRIMRAY_INLINE float total() const { return sums[LightTree::kBlock - 1]; }

  // Returns the slot where the prefix sum exceeds `wanted`, in [0, total()), and the position of `wanted` within it, in [0, 1).
  PRIMRAY_INLINE int find(int blocks, double wanted, double& within) const {
    constexpr int N = kTreeLanes;
    uint32_t beyond = 0, some = 0;
    for (int at = 0; at < LightTree::kBlock; at += N) {
      beyond |= bits(load<N>(sums + at) > vfloat<N>(float(wanted))) << at;
      some |= bits(load<N>(columns + at) > vfloat<N>(0.0f)) << at;
    }
    beyond &= some;
    const int column = beyond ? __builtin_ctz(beyond) : 31 - __builtin_clz(some);
    const double rest = wanted - (column > 0 ? double(sums[column - 1]) : 0.0);
    double begin = 0, end = 0;
    int slot = 0;
    for (int k = 0; k < blocks; ++k) {
      const int s = k * LightTree::kBlock + column;
      if (!(weights[s] > 0)) continue;
      slot = s, begin = end, end += double(weights[s]);
      if (rest < end) break;
    }
    within = std::min(std::max((rest - begin) / double(weights[slot]), 0.0), 0x1.fffffffep-1);
    return slot;
  }
};

inline float WeighedNode::total_of_node(const LightTable& table, int32_t number, const LitPoint& x) {
  const LightTree::Node& node = table.tree.nodes[size_t(number)];
  const LightTree::Block& first = table.tree.blocks[size_t(node.block)];
  if (node.blocks > 1 || first.clusters != 0) return WeighedNode(table, node, x).total();
  alignas(64) float w[LightTree::kBlock], most2[LightTree::kBlock];
  weigh_block(table, first, x, w, most2);
  return sum_of_block(w);
}

// Choice of a path that traverses a tree.
struct TreeChoice {
  int32_t node;
  double u, probability;  // in [0, 1): where in the node the path chooses; of the nodes chosen so far
  int32_t light = -1;     // chosen; -1: none yet, or no light of the tree can reach the point

  // Chooses among the slots of its node; returns whether it has come to another node.
  PRIMRAY_INLINE bool step(const LightTable& table, const WeighedNode& w) {
    const LightTree::Node& at = table.tree.nodes[size_t(node)];
    const float total = w.total();
    if (!(total > 0)) return false;
    const int slot = w.find(at.blocks, u * double(total), u);
    probability *= double(w.weights[slot]) / double(total);
    node = table.tree.blocks[size_t(at.block + slot / LightTree::kBlock)].child[slot % LightTree::kBlock];
    if (node < 0) light = ~node;
    return node >= 0;
  }
};

// Probability with which choose_in_tree() chooses the light at `place`.
inline float probability_from_leaf(const LightTable& table, LightTree::Place place, const LitPoint& x) {
  double probability = 1;
  while (place.node >= 0) {
    const LightTree::Node& node = table.tree.nodes[size_t(place.node)];
    const WeighedNode w(table, node, x);
    const float own = w.weights[place.slot];
    if (!(own > 0)) return 0.0f;
    probability *= double(own) / double(w.total());
    place = {node.parent, node.parent_slot};
  }
  return float(probability);
}

// Chooses a light in the lanes of `m`, each from the tree with its `root`, by 32 random bits; its probability is 0 if no light
// of the tree can reach the point. All paths take a step before any takes the next, and each part of a step is done for all of
// them: one path's is a long chain of operations, of which a processor overlaps those of several paths.
template <int W>
PRIMRAY_RARE void choose_in_tree(const LightTable& table, vint<W> root, vbool<W> m, const vvec3<W>& p, const vvec3<W>& n,
                                 vuint<W> u, vint<W>& light, vfloat<W>& probability, const LobePreview<W>* lobes = nullptr) {
  TreeChoice choices[W];
  LitPoint points[W];
  WeighedNode nodes[W];
  int under_way[W], count = 0;
  for (uint32_t left = bits(m); left; left &= left - 1) {
    const int i = __builtin_ctz(left);
    points[i] = LitPoint(p, n, i);
    if (lobes) points[i].send_on(*lobes, i);
    choices[i] = {root[i], double(u[i]) * 0x1p-32, 1};
    under_way[count++] = i;
  }
  while (count > 0) {
    const auto node_of = [&](int i) -> const LightTree::Node& { return table.tree.nodes[size_t(choices[i].node)]; };
    for (int k = 0; k < count; ++k) nodes[under_way[k]].weigh(table, node_of(under_way[k]), points[under_way[k]]);
    for (int k = 0; k < count; ++k) nodes[under_way[k]].look_into_clusters(table, node_of(under_way[k]), points[under_way[k]]);
    int stay = 0;
    for (int k = 0; k < count; ++k) {
      const int i = under_way[k];
      under_way[stay] = i;
      stay += choices[i].step(table, nodes[i]) ? 1 : 0;
    }
    count = stay;
  }
  alignas(64) int32_t chosen[W];
  alignas(64) float chances[W];
  for (int i = 0; i < W; ++i) {
    const bool found = bits(m) >> i & 1 && choices[i].light >= 0;
    chosen[i] = found ? choices[i].light : 0, chances[i] = found ? float(choices[i].probability) : 0.0f;
  }
  light = load<W>(chosen), probability = load<W>(chances);
}

// Probability of the light at places[at] in each lane of `m`.
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
