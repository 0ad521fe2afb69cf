// Exact spheres and ellipsoids: a unit sphere, and a matrix. Their hits carry the unit normal in the sphere's own space as Ng.
#pragma once

#include <cmath>
#include <optional>
#include <vector>

#include "base/features.hpp"
#include "embree/embree.hpp"
#include "math/box.hpp"
#include "math/ellipsoid.hpp"
#include "math/matrix.hpp"
#include "math/vec3.hpp"
#include "ray/ray.hpp"

namespace primray {

// Point on a curved shape that a ray hit, in the space of the shape's group.
template <int W>
struct CurvedPoint {
  vvec3<W> p;
  vvec3<W> normal;  // outwards, of any length
  vvec3<W> spread;  // magnitude of what was rounded in computing p, by axis
};

struct SphereShape {
  static constexpr uint32_t kGeometry = 1;
  static constexpr bool kBuilt = built::kSpheres;

  struct Record {
    float group_from_object[12];  // columns x, y, z, origin; the object is the unit sphere
    double object_from_group[12];

    daffine to_group() const { return affine_from_columns(group_from_object); }
  };

  // Makes a record from a radius; none if the matrix has no inverse.
  static std::optional<Record> make(double radius, const daffine& group_from_object) {
    const daffine size{{radius, 0, 0}, {0, radius, 0}, {0, 0, radius}, dvec3(0.0)};
    const daffine m = group_from_object * size;
    if (!is_regular(m)) return std::nullopt;
    Record r;
    put_columns(m, r.group_from_object), put_columns(inverse(m), r.object_from_group);
    return r;
  }

  // Geometry over `count` records, which must outlive it (accel/sphere_geometry.cpp).
  static OwnedGeometry geometry(const Record* records, uint32_t count);

  static Box box(const Record& r) {
    const float* m = r.group_from_object;
    const vec3 o{m[9], m[10], m[11]};
    const vec3 half{std::hypot(m[0], m[3], m[6]), std::hypot(m[1], m[4], m[7]), std::hypot(m[2], m[5], m[8])};
    Box box;
    box.add(o - half), box.add(o + half);
    return box;
  }

  static double area(const Record& r, const daffine& world_from_group) {
    daffine m = r.to_group();
    m.o = dvec3(0.0);
    return ellipsoid_area(world_from_group * m);
  }

  template <int W>
  static PRIMRAY_INLINE CurvedPoint<W> at(const std::vector<Record>& records, vint<W> record, const Hits<W>& h) {
    const AffineLanes<W> m(records[0].group_from_object, record * vint<W>(int(sizeof(Record) / sizeof(float))));
    // The centre of a big sphere is further away than its surface, and rounded accordingly.
    return {m.vector(h.ng) + m.o, m.normal(h.ng), abs(m.x * h.ng.x) + abs(m.y * h.ng.y) + abs(m.z * h.ng.z) + abs(m.o)};
  }
};

}  // namespace primray
