// Guide for caustics: directions from which light of small sources arrives after metal or glass.
//
// A path tracer finds a small sun through glass or on smooth metal by chance only: one sample in thousands, as bright as the
// sun. So before a render, photons are traced from small lights over smooth surfaces (guiding/pilot/caustic_photons.hpp). Each
// is stored with its landing point and the direction that it came from. A balanced tree over the landing points divides them
// into leaves of equally many; a surface point in a leaf sends part of its scattered rays in those directions, each with a lobe
// as wide as the spacing of the leaf's photons. As the surface point moves, directions turn, by gradients stored with the
// photons (photon differentials, Schjøth et al. 2007); otherwise lobes would have to be as wide as a leaf. Only densities
// change: the image stays unbiased, and photons, used as directions (Jensen 1995, "Importance Driven Path Tracing using the
// Photon Map"), may be arbitrarily wrong.
#pragma once

#include <algorithm>
#include <bit>
#include <vector>

#include "math/transcendental.hpp"

namespace primray {

struct CausticGuide {
  static constexpr int kMostInLeaf = 24;
  struct Node {
    float split;   // position of the splitting plane
    int32_t axis;  // that it is perpendicular to
  };
  int levels = 0;              // of the tree
  int leaf_photons = 0;        // per leaf
  std::vector<Node> nodes;     // children of node i are 2 i + 1 and 2 i + 2
  std::vector<float> photons;  // kPhotonFields per photon, leaf after leaf
  std::vector<float> leaf;     // kLeafFields per leaf
  // Share of the photons' weight in leaves whose lobes are so narrow that hardly any ray would find that light without them.
  float sharp = 0;
  bool any() const { return leaf_photons > 0; }
  int64_t memory_bytes() const { return int64_t(sizeof(Node) * nodes.size() + 4 * (photons.size() + leaf.size())); }
};

enum CausticLeafField : int {
  kLow,               // corner of the bounding box of the landing points
  kHigh = kLow + 3,   // opposite corner
  kFade = kHigh + 3,  // 1 / distance^2 at which a point outside the box has a quarter of its density
  kDensity,           // density of photons relative to unoccluded light
  kWidth2,            // of a lobe: squared chord, a^2
  kReach2,            // squared distance beyond which a photon has little weight
  kLeafFields
};

enum CausticPhotonField : int {
  kDirection,                 // unit, towards where it came from
  kLanding = kDirection + 3,  // its landing point
  kGradient = kLanding + 3,   // derivative of the direction's x, y and z by the landing point
  kPhotonFields = 16          // one row of memory
};

// Largest change of a direction (squared): near foci gradients are unbounded.
constexpr float kFarthest2 = 0.1f;

// Direction, not normalized, of a photon that would have landed at `offset` from its landing point.
template <class F>
PRIMRAY_INLINE Vec3<F> direction_seen(const Vec3<F>& direction, const Vec3<F>& offset, const Vec3<F> (&gradient)[3]) {
  using std::sqrt;
  const Vec3<F> moved{dot(gradient[0], offset), dot(gradient[1], offset), dot(gradient[2], offset)};
  const F farthest2(kFarthest2);
  return direction + moved * sqrt(farthest2 / (dot(moved, moved) + farthest2));
}

// Weight of a photon at that distance from its landing point.
template <class F>
PRIMRAY_INLINE F caustic_nearness(F distance2, F reach2) {
  const F q = 1.0f + distance2 / reach2;
  return 1.0f / (q * q);
}

// Largest share of a point's rays that follow photons, and the density at which it is half of that. Smaller shares are not
// worth their cost.
constexpr float kMostGuided = 0.5f, kHalfDensity = 0.05f, kLeastShare = 0.002f, kLeastDensity = 2e-4f;

// Returns the number of the leaf of each lane.
template <int W>
PRIMRAY_INLINE vint<W> caustic_leaf(const CausticGuide& g, const vvec3<W>& p) {
  vint<W> node(0);
  const auto descend = [&](vfloat<W> split, vint<W> axis) {
    const vfloat<W> x = select(axis == vint<W>(0), p.x, select(axis == vint<W>(1), p.y, p.z));
    node = node * vint<W>(2) + select(x >= split, vint<W>(2), vint<W>(1));
  };
  int level = 0;
  // The W - 1 nodes of the first levels fit into vectors.
  if constexpr (W > 1) {
    const TwoLanes<int32_t, W> top = gather_words<W, int(sizeof(CausticGuide::Node))>(g.nodes.data(), lane_numbers<W>());
    for (const int end = std::min(g.levels, int(std::bit_width(unsigned(W))) - 1); level < end; ++level)
      descend(bit_cast<vfloat<W>>(permute(top.x, node)), permute(top.y, node));
  }
  for (; level < g.levels; ++level) {
    const TwoLanes<int32_t, W> n = gather_words<W, int(sizeof(CausticGuide::Node))>(g.nodes.data(), node);
    descend(bit_cast<vfloat<W>>(n.x), n.y);
  }
  return node - vint<W>((1 << g.levels) - 1);
}

// Leaf of each lane, and the share of its scattered rays that follow it.
template <int W>
struct CausticLanes {
  int photons;
  vfloat<W> share, width2;
  // Unit directions of the leaf's photons, and the probabilities of their lobes, by distance to their landing points.
  vvec3<W> towards[CausticGuide::kMostInLeaf];
  vfloat<W> chance[CausticGuide::kMostInLeaf];

  // `response(w, width2)`: response of the surface to light from about w, relative to a white Lambert surface.
  template <class Response>
  CausticLanes(const CausticGuide& g, vbool<W> m, const vvec3<W>& p, Response response) : photons(g.leaf_photons) {
    const vint<W> leaf = caustic_leaf(g, p);
    const vint<W> row = leaf * vint<W>(kLeafFields);
    static_assert(kLow == 0 && kHigh == 3 && kFade == 6 && kDensity == 7 && kWidth2 == 8 && kReach2 == 9);
    const FourLanes<float, W> front = gather_four<W>(g.leaf.data(), row), back = gather_four<W>(g.leaf.data() + 4, row);
    const TwoLanes<float, W> lobes = gather_two<W>(g.leaf.data() + kWidth2, row);
    const auto beyond = [](vfloat<W> x, vfloat<W> low, vfloat<W> high) { return max(max(low - x, x - high), 0.0f); };
    const vvec3<W> off{beyond(p.x, front.x, front.w), beyond(p.y, front.y, back.x), beyond(p.z, front.z, back.y)};
    const vfloat<W> near = 1.0f / (1.0f + dot(off, off) * back.z), density = back.w * near * near;
    share = vfloat<W>(0.0f);
    m &= density > vfloat<W>(kLeastDensity);
    if (!any(m)) return;
    width2 = lobes.x;
    const vfloat<W> reach2 = lobes.y;
    // Where all lanes that need them have one leaf's photons, these are broadcast.
    const int32_t first = leaf[__builtin_ctz(bits(m))];
    const bool is_one_leaf = all((leaf == vint<W>(first)) | !m);
    vfloat<W> total(0.0f), sent(0.0f);
    for (int k = 0; k < photons; ++k) {
      FourLanes<float, W> a, b, c, d;
      if (is_one_leaf) {
        const float* const photon = &g.photons[size_t(first * photons + k) * kPhotonFields];
        const auto four = [&](int i) {
          return FourLanes<float, W>{vfloat<W>(photon[i]), vfloat<W>(photon[i + 1]), vfloat<W>(photon[i + 2]),
                                     vfloat<W>(photon[i + 3])};
        };
        a = four(0), b = four(4), c = four(8), d = four(12);
      } else {
        const float* const photon = g.photons.data();
        const vint<W> at = (leaf * vint<W>(photons) + vint<W>(k)) * vint<W>(kPhotonFields);
        a = gather_four<W>(photon, at), b = gather_four<W>(photon + 4, at);
        c = gather_four<W>(photon + 8, at), d = gather_four<W>(photon + 12, at);
      }
      const vvec3<W> direction{a.x, a.y, a.z}, landing{a.w, b.x, b.y}, offset = p - landing;
      const vvec3<W> gradient[3] = {{b.z, b.w, c.x}, {c.y, c.z, c.w}, {d.x, d.y, d.z}};
      const vvec3<W> to = direction_seen(direction, offset, gradient);
      towards[k] = to * (1.0f / sqrt(max(dot(to, to), 1e-30f)));
      chance[k] = caustic_nearness(dot(offset, offset), reach2);
      total += chance[k];
      chance[k] *= response(towards[k], width2);
      sent += chance[k];
    }
    const vfloat<W> light = density * sent / max(total, 1e-30f);
    share = select(m, kMostGuided * light / (light + kHalfDensity), share);
    share = select(share < vfloat<W>(kLeastShare), vfloat<W>(0.0f), share);
    const vfloat<W> scale = 1.0f / max(sent, 1e-30f);
    for (int k = 0; k < photons; ++k) chance[k] *= scale;
  }

  // Samples a lobe about a direction d: density a^2 (a^2 + 4) / (4 pi (a^2 + |w - d|^2)^2), which is normalized over the
  // sphere, since |w - d|^2 is uniform there over [0, 4]. Its tails are heavy: no photon proves where light does not come from.
  vvec3<W> sample(vfloat<W> choice, vfloat<W> u, vfloat<W> v) const {
    vvec3<W> axis = towards[0];
    vfloat<W> run = chance[0];
    for (int k = 1; k < photons; ++k) {
      axis = select((choice >= run) & (chance[k] > vfloat<W>(0.0f)), towards[k], axis);
      run += chance[k];
    }
    const Frame<vfloat<W>> frame(axis);
    const vfloat<W> t = u * 4.0f / (width2 + 4.0f), chord2 = min(width2 * t / (1.0f - t), 4.0f);
    const vfloat<W> sine = safe_sqrt(chord2 * (1.0f - 0.25f * chord2));
    const SinCos<W> phi = sincos_turns(v);
    return normalize(frame.to_world({sine * phi.cos, sine * phi.sin, 1.0f - 0.5f * chord2}));
  }
  vfloat<W> pdf(const vvec3<W>& w) const {
    vfloat<W> sum(0.0f);
    for (int k = 0; k < photons; ++k) {
      const vvec3<W> off = w - towards[k];
      const vfloat<W> q = width2 + dot(off, off);
      sum += chance[k] / (q * q);
    }
    return sum * (width2 * (width2 + 4.0f)) * (0.25f * kInvPi);
  }
};

// Construction of a CausticGuide's tree over photons.
struct CausticPhoton {
  vec3 landing, direction;  // the direction is a unit vector towards where it came from
  float distance;           // to there
  float weight;             // area of unoccluded light that it represents
  vec3 gradient[3]{};       // derivative of the direction's x, y and z by the landing point; 0: unknown
};

// Builds the tree. The order of photons only decides which few are dropped to make leaves equal.
void build_caustic_tree(std::vector<CausticPhoton>& photons, CausticGuide& guide, int threads);

}  // namespace primray
