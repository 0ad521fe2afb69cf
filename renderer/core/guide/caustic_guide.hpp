// Where the light of small lights comes from after metal and glass: guides scattered rays into caustics.
//
// A path tracer finds a small sun through a glass or on smooth metal by luck alone: one sample in thousands, as bright as the
// sun. So before a render photons are followed from small lights over smooth surfaces (pilot/caustic_photons.hpp). What is
// kept of each is where it landed and the point of the smooth surface it came from. A balanced tree over the landings cuts
// them into leaves of equally many; a surface point in a leaf sends a part of its scattered rays towards those points, each
// under a lobe as wide as the leaf's photons lie apart. As the point moves over its surface so does the one that light comes
// from, by gradients that photons bring along (photon differentials, Schjøth et al. 2007), or lobes would have to be as wide as
// a leaf is. Only densities change: the picture stays what it was without it, and photons, as directions (Jensen 1995,
// "Importance Driven Path Tracing using the Photon Map"), may be as wrong as they like.
#pragma once

#include <vector>

#include "math/transcendental.hpp"

namespace primray {

struct CausticGuide {
  static constexpr int kMostInLeaf = 24;
  int levels = 0;              // of the tree
  int leaf_photons = 0;        // in each leaf
  std::vector<int32_t> axis;   // of inner nodes, children of node i at 2 i + 1 and 2 i + 2
  std::vector<float> split;    // where to part them
  std::vector<float> photons;  // kPhotonFields a photon, leaf after leaf
  std::vector<float> leaf;     // kLeafFields a leaf
  // Of the photons' weight, in leaves whose lobes are so narrow that hardly any ray would find that light without them.
  float sharp = 0;
  bool any() const { return leaf_photons > 0; }
  int64_t memory_bytes() const { return int64_t(4 * (axis.size() + split.size() + photons.size() + leaf.size())); }
};

enum CausticLeafField : int {
  kLow,               // corner of the box about the photons' landings
  kHigh = kLow + 3,   // the opposite one
  kFade = kHigh + 3,  // 1 / distance^2 at which a point beside the box has a quarter of its density
  kDensity,           // photons' density over that of unhindered light
  kWidth2,            // of a lobe: squared chord, a^2
  kReach2,            // squared distance beyond which a photon counts for little
  kLeafFields
};

enum CausticPhotonField : int {
  kSource,                   // the point that it came from
  kLanding = kSource + 3,    // where it landed
  kGradient = kLanding + 3,  // of the source's x, y and z as the landing moves
  kPhotonFields = 16         // a row of memory
};

// Sources move at most this far (squared; over the way to the landing): near foci their gradients grow without bound.
constexpr float kFarthest2 = 0.1f;

// Where a photon that had landed `beside` its landing would have come from.
template <class F>
PRIMRAY_INLINE Vec3<F> source_seen(const Vec3<F>& source, const Vec3<F>& landing, const Vec3<F>& beside,
                                   const Vec3<F> (&gradient)[3]) {
  using std::sqrt;
  const Vec3<F> moved{dot(gradient[0], beside), dot(gradient[1], beside), dot(gradient[2], beside)}, way = source - landing;
  const F farthest2 = kFarthest2 * dot(way, way);
  return source + moved * sqrt(farthest2 / (dot(moved, moved) + farthest2 + F(1e-30f)));
}

// How much a photon counts at a point so far from its landing.
template <class F>
PRIMRAY_INLINE F caustic_nearness(F distance2, F reach2) {
  const F q = 1.0f + distance2 / reach2;
  return 1.0f / (q * q);
}

// At most so much of a point's rays goes there, and the density at which it is half of that. Smaller shares are not worth their
// cost.
constexpr float kMostGuided = 0.5f, kHalfDensity = 0.05f, kLeastShare = 0.002f, kLeastDensity = 2e-4f;

// The leaf of each lane, and the share of its scattered rays that follows it.
template <int W>
struct CausticLanes {
  int photons;
  vfloat<W> share, width2;
  // Of the leaf's photons: unit directions to where they came from, and the chances of their lobes, by how near they landed.
  vvec3<W> towards[CausticGuide::kMostInLeaf];
  vfloat<W> chance[CausticGuide::kMostInLeaf];

  // `suits(w, width2)`: how much of what comes from about w the surface there sends on along the path, over a white Lambert
  // one.
  template <class Suits>
  CausticLanes(const CausticGuide& g, vbool<W> m, const vvec3<W>& p, Suits suits) : photons(g.leaf_photons) {
    vint<W> node(0);
    for (int level = 0; level < g.levels; ++level) {
      const vint<W> axis = gather<W>(g.axis.data(), node);
      const vfloat<W> x = select(axis == vint<W>(0), p.x, select(axis == vint<W>(1), p.y, p.z));
      const vbool<W> upper = x >= gather<W>(g.split.data(), node);
      node = node * vint<W>(2) + select(upper, vint<W>(2), vint<W>(1));
    }
    const vint<W> leaf = node - vint<W>((1 << g.levels) - 1);
    const auto field = [&](int f) { return gather<W>(g.leaf.data() + f, leaf * vint<W>(kLeafFields)); };
    const auto beyond = [&](vfloat<W> x, int k) { return max(max(field(kLow + k) - x, x - field(kHigh + k)), 0.0f); };
    const vvec3<W> off{beyond(p.x, 0), beyond(p.y, 1), beyond(p.z, 2)};
    const vfloat<W> near = 1.0f / (1.0f + dot(off, off) * field(kFade)), density = field(kDensity) * near * near;
    share = vfloat<W>(0.0f);
    m &= density > vfloat<W>(kLeastDensity);
    if (!any(m)) return;
    width2 = field(kWidth2);
    const vfloat<W> reach2 = field(kReach2);
    vfloat<W> total(0.0f), sent(0.0f);
    for (int k = 0; k < photons; ++k) {
      const float* photon = g.photons.data();
      const vint<W> at = (leaf * vint<W>(photons) + vint<W>(k)) * vint<W>(kPhotonFields);
      const FourLanes<float, W> a = gather_four<W>(photon, at), b = gather_four<W>(photon + 4, at);
      const FourLanes<float, W> c = gather_four<W>(photon + 8, at), d = gather_four<W>(photon + 12, at);
      const vvec3<W> source{a.x, a.y, a.z}, landing{a.w, b.x, b.y}, beside = p - landing;
      const vvec3<W> gradient[3] = {{b.z, b.w, c.x}, {c.y, c.z, c.w}, {d.x, d.y, d.z}};
      const vvec3<W> to = source_seen(source, landing, beside, gradient) - p;
      towards[k] = to * (1.0f / sqrt(max(dot(to, to), 1e-30f)));
      chance[k] = caustic_nearness(dot(beside, beside), reach2);
      total += chance[k];
      chance[k] *= suits(towards[k], width2);
      sent += chance[k];
    }
    const vfloat<W> light = density * sent / max(total, 1e-30f);
    share = select(m, kMostGuided * light / (light + kHalfDensity), share);
    share = select(share < vfloat<W>(kLeastShare), vfloat<W>(0.0f), share);
    const vfloat<W> scale = 1.0f / max(sent, 1e-30f);
    for (int k = 0; k < photons; ++k) chance[k] *= scale;
  }

  // A lobe about a direction d: density a^2 (a^2 + 4) / (4 pi (a^2 + |w - d|^2)^2), which is 1 over the sphere, since |w - d|^2
  // is uniform there over [0, 4]. Heavy tails: no photon says for certain where light does not come from.
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

}  // namespace primray
