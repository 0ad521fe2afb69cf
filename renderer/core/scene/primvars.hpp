// Primvars that surface inputs read by name: one flat array of values, and a table of the shapes that have them.
#pragma once

#include <cstdint>
#include <vector>

namespace primray {

// Order as in scene_upload.
enum class PrimvarKind : int32_t { kConstant, kFace, kPoint, kCorner, kInstance };

struct PrimvarTable {
  std::vector<float> values;
  // By primvar: interpolation, components per row (1 to 4), and the offset of its first row.
  std::vector<int32_t> kind, width, base;
  // By (owner, name): the primvar, or -1. Names are those that some surface reads, numbered from 0.
  int names = 0;
  std::vector<int32_t> of_mesh, of_curved, of_placement;

  int32_t add(PrimvarKind k, int w, int32_t at) {
    kind.push_back(int32_t(k)), width.push_back(w), base.push_back(at);
    return int32_t(kind.size()) - 1;
  }
};

}  // namespace primray
