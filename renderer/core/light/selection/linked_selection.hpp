// Light selection with light linking: a surface chooses only among the lights that illuminate it.
#pragma once

#include "base/flush_denormals.hpp"
#include "light/selection/selection.hpp"

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

template <int W>
PRIMRAY_RARE LightChoice<W> choose_linked_light(const LightTable& table, vbool<W> m, const vvec3<W>& p, const vvec3<W>& n,
                                                vuint<W> u, vint<W> link) {
  if (table.by_tree()) {
    LightChoice<W> choice;
    if (table.linked.any()) {
      const vint<W> root = gather<W>(table.linked.root.data(), max(link, 0));
      choose_in_tree(table, root, m & (root >= vint<W>(0)), p, n, u, choice.light, choice.probability);
      return choice;
    }
    choice = choose_light(table, m, p, n, u);
    const vint<W> collection = gather<W>(table.light_link.data(), choice.light);
    choice.probability = select(in_collection(table.links, link, collection), choice.probability, vfloat<W>(0.0f));
    return choice;
  }
  const vfloat<W> total = linked_total_importance(table, p, link), wanted = unit_float(u) * total;
  vfloat<W> run(0.0f), chosen(0.0f);
  vint<W> light(0);
  for (int i = 0; i < table.count; ++i) {
    const vfloat<W> w = linked_importance(table, i, p, link);
    const vbool<W> here = (run <= wanted) & (w > vfloat<W>(0.0f));
    light = select(here, vint<W>(i), light);
    chosen = select(here, w, chosen);
    run += w;
  }
  return {light, select(total > vfloat<W>(0.0f), chosen / max(total, kLeastNormal), vfloat<W>(0.0f))};
}

// Probability with which choose_linked_light() chooses each lane's own light, which illuminates it, in the lanes of `m`.
template <int W>
PRIMRAY_RARE vfloat<W> linked_probability_of(const LightTable& table, vint<W> light, vbool<W> m, const vvec3<W>& p,
                                             const vvec3<W>& n, vint<W> link) {
  const vint<W> valid = select(m, light, vint<W>(0));
  if (table.by_tree()) {
    const LinkedLights& linked = table.linked;
    if (!linked.any()) return probability_of(table, light, m, p, n);
    const vint<W> row = max(link, 0), first = gather<W>(linked.first.data(), row), count = gather<W>(linked.count.data(), row);
    const vint<W> at = first + last_not_above<int32_t, W>(linked.lights.data(), first, count, linked.longest, valid);
    const vbool<W> listed = m & (count > vint<W>(0));
    return probability_in_tree(table, linked.places.data(), select(listed, at, vint<W>(0)), listed, p, n);
  }
  vfloat<W> total(0.0f), chosen(0.0f);
  for (int i = 0; i < table.count; ++i) {
    const vfloat<W> w = linked_importance(table, i, p, link);
    chosen = select(valid == vint<W>(i), w, chosen);
    total += w;
  }
  return chosen / max(total, kLeastNormal);
}

// Probability with which choose_linked_light() chooses light number `i`, which illuminates the lanes `m`; `total` from
// linked_total_importance() (few lights).
template <int W>
PRIMRAY_RARE vfloat<W> linked_probability(const LightTable& table, int i, vbool<W> m, const vvec3<W>& p, const vvec3<W>& n,
                                          vfloat<W> total, vint<W> link) {
  if (table.by_tree()) return linked_probability_of(table, vint<W>(i), m, p, n, link);
  return linked_importance(table, i, p, link) / max(total, kLeastNormal);
}

}  // namespace primray
