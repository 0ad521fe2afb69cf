// The tree of a CausticGuide over photons.
#pragma once

#include <vector>

#include "guide/caustic_guide.hpp"

namespace primray {

struct CausticPhoton {
  vec3 landing, source;
  float weight;        // area of unhindered light that it stands for
  vec3 gradient[3]{};  // of the source's x, y and z by the landing; 0: not known
};

// Photons' order decides nothing but which few are left out, so that leaves are equal.
void build_caustic_tree(std::vector<CausticPhoton>& photons, CausticGuide& guide, int threads);

}  // namespace primray
