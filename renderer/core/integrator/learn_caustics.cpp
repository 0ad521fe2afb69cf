// See learn_caustics.hpp. Whether photons found caustics decides; what guided rays would gain is not tried out.
#include "integrator/learn_caustics.hpp"

#include "integrator/caustic_photons.hpp"
#include "light/caustic_tree.hpp"

namespace primray {

std::unique_ptr<CausticGuide> learn_caustics(const Scene& scene, int max_depth, int threads) {
  if (max_depth < 2) return nullptr;
  std::vector<CausticPhoton> photons = trace_photons(scene, max_depth, threads);
  auto guide = std::make_unique<CausticGuide>();
  build_caustic_tree(photons, *guide, threads);
  return guide->any() ? std::move(guide) : nullptr;
}

}  // namespace primray
