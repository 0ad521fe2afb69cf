// Choice of the light to sample from a point: each light is weighed by the irradiance that it could cause, or by a tree if
// there are many.
#pragma once

#include "base/flush_denormals.hpp"
#include "light/selection/tree_choice.hpp"

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
// takes into account; 0: any. `shiny`: glossy surfaces, whose lobes it takes into account; probability_of() does not.
template <int W>
PRIMRAY_INLINE LightChoice<W> choose_light(const LightTable& table, vbool<W> m, const vvec3<W>& p, const vvec3<W>& n,
                                           vuint<W> u, const ShinyLanes<W>* shiny = nullptr) {
  if (table.count == 1) return {vint<W>(0), vfloat<W>(1.0f)};
  LightChoice<W> choice{vint<W>(0), vfloat<W>(0.0f)};
  if (table.by_tree()) {
    choose_in_tree(table, vint<W>(0), m, p, n, u, choice.light, choice.probability, shiny);
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

}  // namespace primray
