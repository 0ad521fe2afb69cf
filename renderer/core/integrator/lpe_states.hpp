// States of paths in the automaton of light path expressions: their transitions at scattering events, and per-thread storage of
// shadow rays' states and of each sample's radiance by class, beside the columns of the path pool.
#pragma once

#include <algorithm>
#include <bit>

#include "bsdf/basics/scattering.hpp"
#include "integrator/deep_layers.hpp"
#include "integrator/rays/path_pool.hpp"
#include "lpe/automaton.hpp"

namespace primray {

// Automaton state of one of a path's three channels, a byte each. A path is split between the lobes by which it may have left a
// vertex, and one of them is chosen channel by channel, by its share (resolve_lpe()).
PRIMRAY_INLINE int32_t state_of(int32_t route, int channel) { return route >> (8 * channel) & 255; }
// Light end of one channel, ten bits each: a shadow ray towards several domes attributes each channel to one of them.
PRIMRAY_INLINE int32_t end_of(int32_t ends, int channel) { return ends >> (10 * channel) & 1023; }
PRIMRAY_INLINE int32_t same_ends(int32_t end) { return end | end << 10 | end << 20; }

inline int32_t step(const LpeAutomaton& t, int32_t route, LpeEvent event) {
  int32_t r = 0;
  for (int c = 0; c < 3; ++c) r |= int32_t(t.next[size_t(state_of(route, c) * kLpeEvents + event)]) << (8 * c);
  return r;
}

// Light on its way to a sample: the path's states if its last scattering was diffuse, and otherwise; where it ends; and the
// diffuse share per channel.
struct LpeLight {
  int32_t diffuse, other, ends;
  float share[3];
};

struct ShadowLpeStates {
  alignas(64) int32_t diffuse[ShadowQueue::kSize], other[ShadowQueue::kSize], ends[ShadowQueue::kSize];
  alignas(64) float share[3][ShadowQueue::kSize];

  LpeLight at(int i) const { return {diffuse[i], other[i], ends[i], {share[0][i], share[1][i], share[2][i]}}; }
  void put(int i, const LpeLight& r) {
    diffuse[i] = r.diffuse, other[i] = r.other, ends[i] = r.ends;
    for (int c = 0; c < 3; ++c) share[c][i] = r.share[c];
  }
};

// Radiance of one light that some rays of a packet hit, by lane.
struct RecordedLight {
  uint32_t lanes;
  int32_t end[16];
  float L[3][16];
  float diffuse, specular;  // the light's lobe multipliers
};

// Sums of a sample lie side by side: columns of all slots would be a power of two apart, and fall into the same cache lines.
struct LpeStore {
  const LpeAutomaton& tables;
  size_t stride;            // of a slot
  std::vector<float> sums;  // indexed by slot, class, channel
  std::vector<RecordedLight> recorded;
  ShadowLpeStates shadows, special_shadows;

  LpeStore(const LpeAutomaton& t, int most_slots)
      : tables(t), stride(t.members.size() * 3), sums(stride * size_t(most_slots)) {}

  float* row(int slot) { return sums.data() + size_t(slot) * stride; }
  float& at(int of_class, int channel, int slot) { return row(slot)[3 * of_class + channel]; }
  void clear(int first, int used) { std::fill_n(row(first), size_t(used) * stride, 0.0f); }
  void weigh(int slot, const float (&weight)[3]) {
    for (int k = 0; k < int(tables.members.size()); ++k)
      for (int c = 0; c < 3; ++c) at(k, c, slot) *= weight[c];
  }
  void add(int slot, int channel, const LpeLight& r, float c) {
    if (c == 0) return;
    const int32_t end = end_of(r.ends, channel);
    const uint8_t by_diffuse = tables.class_at(state_of(r.diffuse, channel), end),
                  by_other = tables.class_at(state_of(r.other, channel), end);
    if (by_diffuse == by_other) {
      at(by_diffuse, channel, slot) += c;
      return;
    }
    const float part = c * std::clamp(r.share[channel], 0.0f, 1.0f);
    at(by_diffuse, channel, slot) += part, at(by_other, channel, slot) += c - part;
  }
};

// Adds the contributions `c` of shadow rays at `at` that arrive; `passed` counts the surfaces that each passed straight
// through.
template <int W>
PRIMRAY_RARE void add_arrived(LpeStore& s, const ShadowLpeStates& lpe, int at, vbool<W> m, vint<W> slot, const vvec3<W>& c,
                              vint<W> passed) {
  for (uint32_t b = bits(m); b; b &= b - 1) {
    const int i = __builtin_ctz(b);
    LpeLight r = lpe.at(at + i);
    if (s.tables.counts_straight)
      for (int k = 0; k < passed[i]; ++k)
        r.diffuse = step(s.tables, r.diffuse, kStraight), r.other = step(s.tables, r.other, kStraight);
    const int sum = slot[i] & kSumMask;
    s.add(sum, 0, r, c.x[i]), s.add(sum, 1, r, c.y[i]), s.add(sum, 2, r, c.z[i]);
  }
}

// Transitions of light path states at scattering events.

// Resolves, before paths scatter again, by which lobe they left the last vertex: channel by channel, with the lobe's share as
// its probability.
template <int W>
PRIMRAY_RARE void resolve_lpe(PathLanes<W>& p) {
  if (!any(p.lpe_diffuse != p.lpe_other)) return;
  // This sample dimension is used by camera rays only.
  const vfloat<W> u = p.sampler.single(p.vertex, Purpose::kFilm);
  for (int i = 0; i < W; ++i) {
    int32_t mask = 0;
    if (u[i] < p.diffuse_share.x[i]) mask |= 0xff;
    if (u[i] < p.diffuse_share.y[i]) mask |= 0xff00;
    if (u[i] < p.diffuse_share.z[i]) mask |= 0xff0000;
    const int32_t chosen = (p.lpe_diffuse[i] & mask) | (p.lpe_other[i] & ~mask);
    p.lpe_diffuse.set(i, chosen), p.lpe_other.set(i, chosen);
  }
}

// Resolves the states in lanes `m` only.
template <int W>
PRIMRAY_RARE void resolve_lpe_where(vbool<W> m, PathLanes<W>& p) {
  PathLanes<W> resolved = p;
  resolve_lpe(resolved);
  p.lpe_diffuse = select(m, resolved.lpe_diffuse, p.lpe_diffuse);
  p.lpe_other = select(m, resolved.lpe_other, p.lpe_other);
}

// Sets the states of `n`: paths `p`, already resolved, that continue with the BSDF sample `s`.
template <bool kInMedium, int W>
PRIMRAY_RARE void advance_lpe(const LpeAutomaton& t, const PathLanes<W>& p, const BsdfSample<W>& s, PathLanes<W>& n) {
  for (int i = 0; i < W; ++i) {
    const int32_t route = p.lpe_other[i];
    LpeEvent diffuse = kVolume, other = kVolume;
    if (!kInMedium) {
      diffuse = s.transmits[i] ? kTransmittedDiffuse : kReflectedDiffuse;
      other = s.transmits[i] ? (s.is_delta[i] ? kTransmittedSingular : kTransmittedGlossy)
                             : (s.is_delta[i] ? kReflectedSingular : kReflectedGlossy);
      if (s.straight[i]) diffuse = other = kStraight;
    }
    // A path that enters an opaque surface takes its transition when it leaves.
    const bool stays = s.enters[i];
    n.lpe_diffuse.set(i, stays ? route : step(t, route, diffuse)), n.lpe_other.set(i, stays ? route : step(t, route, other));
  }
}

// Advances the states of paths that scatter in a medium.
template <int W>
PRIMRAY_RARE void advance_lpe_in_medium(const LpeAutomaton& t, vbool<W> m, PathLanes<W>& n) {
  for (uint32_t b = bits(m); b; b &= b - 1) {
    const int i = __builtin_ctz(b);
    const int32_t route = step(t, n.lpe_other[i], kVolume);
    n.lpe_diffuse.set(i, route), n.lpe_other.set(i, route);
  }
}

// Diffuse share of f_cos, weighted by the light's lobe multipliers.
PRIMRAY_INLINE float share_of(float diffuse, float specular) {
  const float sum = diffuse + specular;
  return sum > 0 ? diffuse / sum : 0.0f;
}

// State of the light sample in lane `i` at vertices where the resolved paths `p` scatter.
template <bool kInMedium, int W>
PRIMRAY_INLINE LpeLight sampled_lpe(const LpeAutomaton& t, const PathLanes<W>& p, const BsdfEval<W>& f, bool beyond,
                                    float diffuse, float specular, int32_t end, int i) {
  const int32_t route = p.lpe_other[i];
  const LpeEvent by_diffuse = kInMedium ? kVolume : beyond ? kTransmittedDiffuse : kReflectedDiffuse;
  const LpeEvent by_other = kInMedium ? kVolume : beyond ? kTransmittedGlossy : kReflectedGlossy;
  return {step(t, route, by_diffuse),
          step(t, route, by_other),
          same_ends(end),
          {share_of(f.diffuse.x[i] * diffuse, f.specular.x[i] * specular),
           share_of(f.diffuse.y[i] * diffuse, f.specular.y[i] * specular),
           share_of(f.diffuse.z[i] * diffuse, f.specular.z[i] * specular)}};
}

}  // namespace primray
