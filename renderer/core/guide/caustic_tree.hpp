// Construction of a CausticGuide's tree over photons.
#pragma once

#include <vector>

#include "guide/caustic_guide.hpp"

namespace primray {

struct CausticPhoton {
  vec3 landing, source;
  float weight;        // area of unoccluded light that it represents
  vec3 gradient[3]{};  // derivative of the source's x, y and z by the landing point; 0: unknown
};

// Builds the tree. The order of photons only decides which few are dropped to make leaves equal.
void build_caustic_tree(std::vector<CausticPhoton>& photons, CausticGuide& guide, int threads);

}  // namespace primray
