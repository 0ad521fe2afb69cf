// Where shapes stand in their groups, for surfaces whose patterns ask for a shape's own space.
#pragma once

#include <cstdint>
#include <vector>

#include "math/matrix.hpp"

namespace primray {

struct ObjectSpaces {
  // 12 floats each: columns x, y, z, origin. The first is that of all that did not ask: a group's own space.
  std::vector<float> group_from_object, object_from_group;
  // By row of the MeshTable and the CurvedTable: which; short where the last rows have none.
  std::vector<int32_t> of_mesh, of_curved;

  bool any() const { return !group_from_object.empty(); }
  void put(size_t number, const daffine& m) {
    // What is flattened has no way back: then its own space is its group's.
    const daffine own = is_regular(m) ? m : kItself;
    const size_t at = 12 * number;
    if (group_from_object.size() < at + 12) group_from_object.resize(at + 12), object_from_group.resize(at + 12);
    put_columns(own, &group_from_object[at]), put_columns(inverse(own), &object_from_group[at]);
  }
  // The number of a space that is new.
  int32_t add(const daffine& m) {
    if (!any()) put(0, kItself);
    put(group_from_object.size() / 12, m);
    return int32_t(group_from_object.size() / 12) - 1;
  }

 private:
  static inline const daffine kItself{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, dvec3(0.0)};
};

}  // namespace primray
