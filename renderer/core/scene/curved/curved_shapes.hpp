// Shapes that are not made of triangles. A new kind is a file beside these and its Embree geometry in accel/; its struct is one
// name in the list here.
//
// A kind has: kGeometry, its id among Embree's geometries of a group (scene.hpp); kBuilt, whether this build has it; Record,
// the data of one shape; make, box and area of one; geometry, Embree's geometry over records; at, the points that rays hit.
#pragma once

#include <algorithm>
#include <array>
#include <concepts>
#include <cstdint>
#include <tuple>
#include <vector>

#include "scene/curved/sphere.hpp"

namespace primray {

template <class... K>
struct CurvedKindList {
  static constexpr size_t kCount = sizeof...(K);
  static constexpr uint32_t kLastGeometry = std::max({K::kGeometry...});
  using Records = std::tuple<std::vector<typename K::Record>...>;

  template <class Wanted>
  static constexpr int32_t index_of() {
    int32_t index = -1, i = 0;
    ((std::same_as<K, Wanted> ? index = i++ : i++), ...);
    return index;
  }
  template <class F>
  static PRIMRAY_INLINE void for_each(const F& f) {
    (f(K{}), ...);
  }
};

using CurvedKinds = CurvedKindList<SphereShape>;

// Calls f(K{}) for each kind.
template <class F>
PRIMRAY_INLINE void for_curved_kinds(const F& f) {
  CurvedKinds::for_each(f);
}

// A group's shapes of one kind: the first record and the first row; the others follow.
struct CurvedRange {
  uint32_t first = 0, first_row = 0, count = 0;
  bool has_row(int32_t row) const { return uint32_t(row) - first_row < count; }
  uint32_t record_of(int32_t row) const { return first + uint32_t(row) - first_row; }
};

// One range per kind.
struct CurvedRanges {
  std::array<CurvedRange, CurvedKinds::kCount> all;

  template <class K>
  CurvedRange& of() {
    return all[CurvedKinds::index_of<K>()];
  }
  template <class K>
  const CurvedRange& of() const {
    return all[CurvedKinds::index_of<K>()];
  }
  bool any() const {
    for (const CurvedRange& r : all)
      if (r.count > 0) return true;
    return false;
  }
  bool has_row(int32_t row) const {
    for (const CurvedRange& r : all)
      if (r.has_row(row)) return true;
    return false;
  }
};

struct CurvedTable {
  CurvedKinds::Records by_kind;
  // By row, which counts the shapes of all kinds in their input order.
  std::vector<int32_t> surface, link;  // the latter like MeshTable::link

  template <class K>
  std::vector<typename K::Record>& records() {
    return std::get<CurvedKinds::index_of<K>()>(by_kind);
  }
  template <class K>
  const std::vector<typename K::Record>& records() const {
    return std::get<CurvedKinds::index_of<K>()>(by_kind);
  }
  // Whether the scene has shapes of the kind, if this build has it.
  template <class K>
  bool has() const {
    return K::kBuilt && !records<K>().empty();
  }
  // Whether it has shapes of a kind that this build lacks.
  bool is_left_out() const {
    bool found = false;
    for_curved_kinds([&]<class K>(K) { found |= !K::kBuilt && !records<K>().empty(); });
    return found;
  }
  size_t rows() const { return surface.size(); }
  // Whether it has shapes of kinds that this build has.
  bool any() const {
    bool found = false;
    for_curved_kinds([&]<class K>(K) { found |= has<K>(); });
    return found;
  }
};

}  // namespace primray
