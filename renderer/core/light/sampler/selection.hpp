// Choice of the light to sample from a point, with and without light linking: each light is weighed by the irradiance that it
// could cause, or by a tree if there are many.
#pragma once

#include "base/flush_denormals.hpp"
#include "light/sampler/tree_choice.hpp"

namespace primray {

// Chosen light and its probability; 0 if no light can reach p.
template <int W>
struct LightChoice {
  vint<W> light;
  vfloat<W> probability;
};

template <int W>
PRIMRAY_INLINE vfloat<W> total_importance(const LightTable& table, const vvec3<W>& p) {
  vfloat<W> total(0.0f);
  for (int i = 0; i < table.count; ++i) total += light_weight(table, i, p);
  return total;
}

// Chooses lights in the lanes of `m`, with 32 random bits each. `n`: normal on the lit side, which the choice among many lights
// takes into account; 0: any. `lobes`: those that it takes into account; probability_of() does not.
template <int W>
PRIMRAY_INLINE LightChoice<W> choose_light(const LightTable& table, vbool<W> m, const vvec3<W>& p, const vvec3<W>& n,
                                           vuint<W> u, const LobePreview<W>* lobes = nullptr) {
  if (table.count == 1) return {vint<W>(0), vfloat<W>(1.0f)};
  LightChoice<W> choice{vint<W>(0), vfloat<W>(0.0f)};
  if (table.by_tree()) {
    choose_in_tree(table, vint<W>(0), m, p, n, u, choice.light, choice.probability, lobes);
    return choice;
  }
  const vfloat<W> total = total_importance(table, p), wanted = unit_float(u) * total;
  vfloat<W> run(0.0f), chosen(0.0f);
  for (int i = 0; i < table.count; ++i) {
    const vfloat<W> w = light_weight(table, i, p);
    // The last light whose interval begins at or before `wanted` and is not empty.
    const vbool<W> here = (run <= wanted) & (w > vfloat<W>(0.0f));
    choice.light = select(here, vint<W>(i), choice.light);
    chosen = select(here, w, chosen);
    run += w;
  }
  choice.probability = select(total > vfloat<W>(0.0f), chosen / max(total, kLeastNormal), vfloat<W>(0.0f));
  return choice;
}

// Probability with which choose_light() chooses light number `i` in lanes `m`; `total` from total_importance() (few lights).
template <int W>
PRIMRAY_INLINE vfloat<W> light_probability(const LightTable& table, int i, vbool<W> m, const vvec3<W>& p, const vvec3<W>& n,
                                           vfloat<W> total) {
  if (table.count == 1) return vfloat<W>(1.0f);
  if (table.by_tree()) return probability_in_tree(table, table.tree.places.data(), vint<W>(i), m, p, n);
  return light_weight(table, i, p) / max(total, kLeastNormal);
}

// Probability with which choose_light() chooses each lane's own light, in the lanes of `m`.
template <int W>
PRIMRAY_INLINE vfloat<W> probability_of(const LightTable& table, vint<W> light, vbool<W> m, const vvec3<W>& p,
                                        const vvec3<W>& n) {
  if (table.count == 1) return vfloat<W>(1.0f);
  const vint<W> valid = select(m, light, vint<W>(0));
  if (table.by_tree()) return probability_in_tree(table, table.tree.places.data(), valid, m, p, n);
  vfloat<W> total(0.0f), chosen(0.0f);
  for (int i = 0; i < table.count; ++i) {
    const vfloat<W> w = light_weight(table, i, p);
    chosen = select(valid == vint<W>(i), w, chosen);
    total += w;
  }
  return chosen / max(total, kLeastNormal);
}

// Light selection with light linking: a surface chooses only among the lights that illuminate it.
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
