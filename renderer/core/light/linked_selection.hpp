// selection.hpp where lights are linked: a surface chooses among the lights that reach it, and no other.
#pragma once

#include "light/selection.hpp"

namespace primray {

template <int W>
PRIMRAY_INLINE vfloat<W> linked_importance(const LightTable& table, int i, const vvec3<W>& p, vint<W> link) {
  const vfloat<W> w = light_weight(table, i, p);
  return select(in_collection(table.links, link, table.light_link[i]), w, vfloat<W>(0.0f));
}

template <int W>
PRIMRAY_RARE vfloat<W> linked_total_importance(const LightTable& table, const vvec3<W>& p, vint<W> link) {
  vfloat<W> total(0.0f);
  for (int i = 0; i < table.count; ++i) total += linked_importance(table, i, p, link);
  return total;
}

// The lanes' lists of lights, where there are too many to weigh each.
template <int W>
struct LinkedList {
  vint<W> first, count, cdf;
  PRIMRAY_INLINE LinkedList(const LinkedLights& linked, vint<W> link) {
    const vint<W> row = max(link, 0);
    first = gather<W>(linked.first.data(), row), count = gather<W>(linked.first.data() + 1, row) - first;
    cdf = first + row;
  }
};

template <int W>
PRIMRAY_RARE LightChoice<W> choose_linked_light(const LightTable& table, const vvec3<W>& p, vfloat<W> u, vint<W> link) {
  if (table.count > LightTable::kWeighed) {
    if (!table.linked.any()) {
      LightChoice<W> any_light = choose_light(table, p, u);
      const vint<W> collection = gather<W>(table.light_link.data(), any_light.light);
      any_light.probability = select(in_collection(table.links, link, collection), any_light.probability, vfloat<W>(0.0f));
      return any_light;
    }
    const LinkedList<W> list(table.linked, link);
    const float* cdf = table.linked.cdf.data();
    const vint<W> i = last_not_above<float, W>(cdf, list.cdf, list.count, table.linked.longest, u);
    const vbool<W> some = list.count > vint<W>(0);
    const vint<W> at = select(some, list.cdf + i, vint<W>(0));
    const vfloat<W> probability = select(some, gather<W>(cdf + 1, at) - gather<W>(cdf, at), vfloat<W>(0.0f));
    return {gather<W>(table.linked.lights.data(), select(some, list.first + i, vint<W>(0))), probability};
  }
  const vfloat<W> total = linked_total_importance(table, p, link), wanted = u * total;
  vfloat<W> run(0.0f), chosen(0.0f);
  vint<W> light(0);
  for (int i = 0; i < table.count; ++i) {
    const vfloat<W> w = linked_importance(table, i, p, link);
    const vbool<W> here = (run <= wanted) & (w > vfloat<W>(0.0f));
    light = select(here, vint<W>(i), light);
    chosen = select(here, w, chosen);
    run += w;
  }
  return {light, select(total > vfloat<W>(0.0f), chosen / max(total, 1e-38f), vfloat<W>(0.0f))};
}

// The probability with which choose_linked_light picks a light of its own in every lane of `m`; all of them reach their lanes.
template <int W>
PRIMRAY_RARE vfloat<W> linked_probability_of(const LightTable& table, vint<W> light, vbool<W> m, const vvec3<W>& p,
                                             vint<W> link) {
  const vint<W> valid = select(m, light, vint<W>(0));
  if (table.count > LightTable::kWeighed) {
    if (!table.linked.any()) return probability_of(table, light, m, p);
    const LinkedList<W> list(table.linked, link);
    const vint<W> i =
        last_not_above<int32_t, W>(table.linked.lights.data(), list.first, list.count, table.linked.longest, valid);
    const vint<W> at = list.cdf + i;
    const vbool<W> listed = m & (list.count > vint<W>(0));
    const vint<W> safe = select(listed, at, vint<W>(0));
    const float* cdf = table.linked.cdf.data();
    return select(listed, gather<W>(cdf + 1, safe) - gather<W>(cdf, safe), vfloat<W>(0.0f));
  }
  vfloat<W> total(0.0f), chosen(0.0f);
  for (int i = 0; i < table.count; ++i) {
    const vfloat<W> w = linked_importance(table, i, p, link);
    chosen = select(valid == vint<W>(i), w, chosen);
    total += w;
  }
  return chosen / max(total, 1e-38f);
}

// The probability with which choose_linked_light picks light number `i`, which reaches the lanes `m`; `total` from
// linked_total_importance (few lights).
template <int W>
PRIMRAY_RARE vfloat<W> linked_probability(const LightTable& table, int i, vbool<W> m, const vvec3<W>& p, vfloat<W> total,
                                          vint<W> link) {
  if (table.count > LightTable::kWeighed) return linked_probability_of(table, vint<W>(i), m, p, link);
  return linked_importance(table, i, p, link) / max(total, 1e-38f);
}

}  // namespace primray
