// Surfaces glossy enough to influence which of many lights is sampled.
#pragma once

#include "bsdf/bsdf.hpp"
#include "light/selection/tree_choice.hpp"

namespace primray {

// Minimum albedo, and maximum roughness (alpha), of a specular lobe that influences the choice.
constexpr float kShiny = 0.04f, kDullAlpha = 0.6f;
// Minimum weight of the diffuse remainder, since the preview lobe is only approximate.
constexpr float kLeastRest = 0.02f;

// Finds the lanes of `scatters` whose surface, seen along unit wo (world space), is glossy, and their lobes; returns whether
// there are any.
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
