// Object spaces of shapes within their groups, for surfaces whose patterns read them.
#pragma once

#include <cstdint>
#include <vector>

#include "math/matrix.hpp"

namespace primray {

struct ObjectSpaces {
  // 12 floats each: columns x, y, z, origin. The first is the group's own space, for all shapes that do not read theirs.
  std::vector<float> group_from_object, object_from_group;
  // Index of the space by row of the MeshTable and the CurvedTable; may be shorter than these.
  std::vector<int32_t> of_mesh, of_curved;

  bool any() const { return !group_from_object.empty(); }
  void put(size_t number, const daffine& m) {
    // A degenerate matrix has no inverse: the shape's space is then its group's.
    const daffine own = is_regular(m) ? m : kItself;
    const size_t at = 12 * number;
    if (group_from_object.size() < at + 12) group_from_object.resize(at + 12), object_from_group.resize(at + 12);
    put_columns(own, &group_from_object[at]), put_columns(inverse(own), &object_from_group[at]);
  }
  // Adds a space and returns its index.
  int32_t add(const daffine& m) {
    if (!any()) put(0, kItself);
    put(group_from_object.size() / 12, m);
    return int32_t(group_from_object.size() / 12) - 1;
  }

 private:
  static inline const daffine kItself{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, dvec3(0.0)};
};

}  // namespace primray
