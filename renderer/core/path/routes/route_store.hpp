// Per-thread storage for light path expressions, beside the columns of the path pool: states of shadow rays, and the radiance
// of each sample by class.
#pragma once

#include <algorithm>
#include <bit>

#include "path/rays/pool.hpp"
#include "route/route_tables.hpp"

namespace primray {

// Automaton state of one of a path's three channels, a byte each. A path is split between the lobes by which it may have left a
// vertex, and one of them is chosen channel by channel, by its share (resolve_routes()).
PRIMRAY_INLINE int32_t state_of(int32_t route, int channel) { return route >> (8 * channel) & 255; }
// Light end of one channel, ten bits each: a shadow ray towards several domes attributes each channel to one of them.
PRIMRAY_INLINE int32_t end_of(int32_t ends, int channel) { return ends >> (10 * channel) & 1023; }
PRIMRAY_INLINE int32_t same_ends(int32_t end) { return end | end << 10 | end << 20; }

inline int32_t step(const RouteTables& t, int32_t route, RouteEvent event) {
  int32_t r = 0;
  for (int c = 0; c < 3; ++c) r |= int32_t(t.next[size_t(state_of(route, c) * kRouteEvents + event)]) << (8 * c);
  return r;
}

// Light on its way to a sample: the path's states if its last scattering was diffuse, and otherwise; where it ends; and the
// diffuse share per channel.
struct RoutedLight {
  int32_t diffuse, other, ends;
  float share[3];
};

struct ShadowRoutes {
  alignas(64) int32_t diffuse[ShadowQueue::kSize], other[ShadowQueue::kSize], ends[ShadowQueue::kSize];
  alignas(64) float share[3][ShadowQueue::kSize];

  RoutedLight at(int i) const { return {diffuse[i], other[i], ends[i], {share[0][i], share[1][i], share[2][i]}}; }
  void put(int i, const RoutedLight& r) {
    diffuse[i] = r.diffuse, other[i] = r.other, ends[i] = r.ends;
    for (int c = 0; c < 3; ++c) share[c][i] = r.share[c];
  }
};

// Radiance of one light that some rays of a packet hit, by lane.
struct MetLight {
  uint32_t lanes;
  int32_t end[16];
  float L[3][16];
  float diffuse, specular;  // the light's lobe multipliers
};

struct RouteStore {
  const RouteTables& tables;
  int slots;
  std::vector<float> sums;  // indexed by class, channel, slot
  std::vector<MetLight> met;
  ShadowRoutes shadows, special_shadows;

  RouteStore(const RouteTables& t, int most_slots)
      : tables(t), slots(most_slots), sums(t.members.size() * 3 * size_t(most_slots)) {}

  float* column(int of_class, int channel) { return sums.data() + (size_t(of_class) * 3 + size_t(channel)) * size_t(slots); }
  void clear(int first, int used) {
    for (size_t i = size_t(first); i < sums.size(); i += size_t(slots)) std::fill_n(sums.data() + i, used, 0.0f);
  }
  void weigh(int slot, const float (&weight)[3]) {
    for (int k = 0; k < int(tables.members.size()); ++k)
      for (int c = 0; c < 3; ++c) column(k, c)[slot] *= weight[c];
  }
  void add(int slot, int channel, const RoutedLight& r, float c) {
    if (c == 0) return;
    const int32_t end = end_of(r.ends, channel);
    const uint8_t by_diffuse = tables.class_at(state_of(r.diffuse, channel), end),
                  by_other = tables.class_at(state_of(r.other, channel), end);
    if (by_diffuse == by_other) {
      column(by_diffuse, channel)[slot] += c;
      return;
    }
    const float part = c * std::clamp(r.share[channel], 0.0f, 1.0f);
    column(by_diffuse, channel)[slot] += part, column(by_other, channel)[slot] += c - part;
  }
};

// Adds the contributions `c` of shadow rays at `at` that arrive; `passed` counts the surfaces that each passed straight
// through.
template <int W>
PRIMRAY_RARE void add_arrived(RouteStore& s, const ShadowRoutes& routes, int at, vbool<W> m, vint<W> slot, const vvec3<W>& c,
                              vint<W> passed) {
  for (uint32_t b = bits(m); b; b &= b - 1) {
    const int i = __builtin_ctz(b);
    RoutedLight r = routes.at(at + i);
    if (s.tables.counts_straight)
      for (int k = 0; k < passed[i]; ++k)
        r.diffuse = step(s.tables, r.diffuse, kStraight), r.other = step(s.tables, r.other, kStraight);
    s.add(slot[i], 0, r, c.x[i]), s.add(slot[i], 1, r, c.y[i]), s.add(slot[i], 2, r, c.z[i]);
  }
}

}  // namespace primray
