// Surfaces that reflect sharply enough for that to decide which of many lights is sampled.
#pragma once

#include "bsdf/bsdf.hpp"
#include "light/selection/tree_choice.hpp"

namespace primray {

// Those that send on so much of their light by a lobe no wider than this.
constexpr float kShiny = 0.04f, kDullAlpha = 0.6f;
// Lights are chosen as if this much at least were sent on in all directions, since the lobe is only about what it is taken for.
constexpr float kLeastRest = 0.02f;

// Which of the lanes `scatters` are, seen along unit wo (of the world), and how they reflect; whether there are any.
template <int W, class Lobes>
PRIMRAY_RARE bool find_shiny(vbool<W> scatters, const Lobes& b, const vvec3<W>& wo, ShinyLanes<W>& s) {
  const vbool<W> by_coat = b.any_coat ? b.p_coat > b.p_specular : vbool<W>(false);
  const vfloat<W> alpha = b.any_coat ? select(by_coat, b.coat_alpha, b.alpha) : b.alpha;
  s.specular = select(by_coat, b.p_coat, b.p_specular), s.rest = max(1.0f - s.specular, kLeastRest);
  s.shiny = scatters & b.preview & (by_coat | !b.mirror) & (s.specular > vfloat<W>(kShiny)) & (alpha < vfloat<W>(kDullAlpha));
  s.wo = wo, s.alpha2 = alpha * alpha;
  return any(s.shiny);
}

}  // namespace primray
