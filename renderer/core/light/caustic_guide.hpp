// Where the light of small lights comes from after metal and glass: guides scattered rays into caustics.
//
// A path tracer finds a small sun through a glass or on smooth metal by luck alone: one sample in thousands, as bright as the
// sun. So before a render photons are followed from small lights over smooth surfaces (integrator/caustic_photons.hpp). What is
// kept of each is where it landed and the point of the smooth surface it came from. A balanced tree over the landings cuts
// them into leaves of equally many; a surface point in a leaf sends a part of its scattered rays towards those points, each
// under a lobe as wide as the leaf's photons lie apart. Only densities change: the picture stays what it was without it, and
// photons, as directions (Jensen 1995, "Importance Driven Path Tracing using the Photon Map"), may be as wrong as they like.
#pragma once

#include <vector>

#include "math/transcendental.hpp"

namespace primray {

struct CausticGuide {
  int levels = 0;       // of the tree
  int leaf_photons = 0;  // in each leaf
  std::vector<int32_t> axis;     // of inner nodes, children of node i at 2 i + 1 and 2 i + 2
  std::vector<float> split;      // where to part them
  std::vector<float> source;     // 3 floats a photon, leaf after leaf: the point that it came from
  std::vector<float> leaf;       // kLeafFields a leaf
  bool any() const { return leaf_photons > 0; }
};

enum CausticLeafField : int {
  kLow,                   // corner of the box about the photons' landings
  kHigh = kLow + 3,       // the opposite one
  kFade = kHigh + 3,      // 1 / distance^2 at which a point beside the box has hardly any of its light
  kDensity,               // photons' density over that of unhindered light
  kWidth2,                // of a lobe: squared chord, a^2
  kLeafFields
};

// At most so much of a point's rays goes there, and the density at which it is half of that.
constexpr float kMostGuided = 0.5f, kHalfDensity = 0.05f;

// The leaf of each lane, and the share of its scattered rays that follows it.
template <int W>
struct CausticLanes {
  const CausticGuide& guide;
  vvec3<W> p;
  vint<W> leaf;
  vfloat<W> share, width2;

  CausticLanes(const CausticGuide& g, vbool<W> m, const vvec3<W>& at) : guide(g), p(at) {
    vint<W> node(0);
    for (int level = 0; level < g.levels; ++level) {
      const vint<W> axis = gather<W>(g.axis.data(), node);
      const vfloat<W> x = select(axis == vint<W>(0), p.x, select(axis == vint<W>(1), p.y, p.z));
      const vbool<W> upper = x >= gather<W>(g.split.data(), node);
      node = node * vint<W>(2) + select(upper, vint<W>(2), vint<W>(1));
    }
    leaf = node - vint<W>((1 << g.levels) - 1);
    const auto field = [&](int f) { return gather<W>(g.leaf.data() + f, leaf * vint<W>(kLeafFields)); };
    const auto beyond = [&](vfloat<W> x, int k) { return max(max(field(kLow + k) - x, x - field(kHigh + k)), 0.0f); };
    const vvec3<W> off{beyond(p.x, 0), beyond(p.y, 1), beyond(p.z, 2)};
    const vfloat<W> near = 1.0f / (1.0f + dot(off, off) * field(kFade)), density = field(kDensity) * near * near;
    share = select(m, kMostGuided * density / (density + kHalfDensity), vfloat<W>(0.0f));
    share = select(share < vfloat<W>(0.002f), vfloat<W>(0.0f), share);
    width2 = field(kWidth2);
  }

  // Unit direction to the source of photon `k` of the leaf.
  PRIMRAY_INLINE vvec3<W> towards(vint<W> k) const {
    const vint<W> at = (leaf * vint<W>(guide.leaf_photons) + k) * vint<W>(3);
    const float* s = guide.source.data();
    const vvec3<W> to = vvec3<W>{gather<W>(s, at), gather<W>(s + 1, at), gather<W>(s + 2, at)} - p;
    return to * (1.0f / sqrt(max(dot(to, to), 1e-30f)));
  }

  // A lobe about a direction d: density a^2 (a^2 + 4) / (4 pi (a^2 + |w - d|^2)^2), which is 1 over the sphere, since |w - d|^2
  // is uniform there over [0, 4]. Heavy tails: no photon says for certain where light does not come from.
  vvec3<W> sample(vfloat<W> choice, vfloat<W> u, vfloat<W> v) const {
    const vint<W> k = min(truncate(choice * float(guide.leaf_photons)), guide.leaf_photons - 1);
    const Frame<vfloat<W>> frame(towards(k));
    const vfloat<W> t = u * 4.0f / (width2 + 4.0f), chord2 = min(width2 * t / (1.0f - t), 4.0f);
    const vfloat<W> sine = safe_sqrt(chord2 * (1.0f - 0.25f * chord2));
    const SinCos<W> phi = sincos_turns(v);
    return normalize(frame.to_world({sine * phi.cos, sine * phi.sin, 1.0f - 0.5f * chord2}));
  }
  vfloat<W> pdf(const vvec3<W>& w) const {
    vfloat<W> sum(0.0f);
    for (int k = 0; k < guide.leaf_photons; ++k) {
      const vvec3<W> off = w - towards(vint<W>(k));
      const vfloat<W> q = width2 + dot(off, off);
      sum += 1.0f / (q * q);
    }
    return sum * (width2 * (width2 + 4.0f)) * (0.25f * kInvPi / float(guide.leaf_photons));
  }
};

}  // namespace primray
