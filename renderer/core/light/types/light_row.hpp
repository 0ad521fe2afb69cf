// Row that describes one light, with the same layout for every type, and how lanes read it: floats, and integers as their bits.
//
// Area lights have a frame of their own without scale (their size is in kSize0, kSize1), so that sampling by solid angle there
// is sampling by solid angle in world space; only a sheared frame changes it, by the Jacobian |det A| / |A w|^3 of directions
// under A. Lights are not geometry: they cast no shadows, and emit from their front only.
#pragma once

#include <cstdint>

#include "light/shape/local_shape.hpp"
#include "math/lane_checks.hpp"
#include "math/matrix.hpp"
#include "math/row.hpp"

namespace primray {

// Values of a row's kType. Of its other fields kImage, kLightFlags, kShaping and those below are integers.
enum class LightType : int32_t { kPoint, kSphere, kDisk, kRect, kCylinder, kDistant, kDome, kMesh, kLine, kVolume };

enum LightField : int {
  kType,
  kAxisX,  // columns of world_from_light
  kAxisY = kAxisX + 3,
  kAxisZ = kAxisY + 3,
  kOrigin = kAxisZ + 3,
  kInverseX = kOrigin + 3,  // columns of light_from_world
  kInverseY = kInverseX + 3,
  kInverseZ = kInverseY + 3,
  kInverseDet = kInverseZ + 3,  // |det light_from_world|; 1 unless sheared
  kSize0,                       // half width, radius (of a mesh: bounding sphere), or 1 - cos of a distant light's half-angle
  kSize1,                       // half height or half length
  kRadiance,                    // radiance; of a point: radiant intensity; of a line: intensity per length; of a sun with angle
                                // 0: irradiance
  kAnchor = kRadiance + 3,      // of a sphere or cylinder: a point of its surface near the core's origin, and its normal there
  kAnchorNormal = kAnchor + 3,  // in the light's frame
  kImportance = kAnchorNormal + 3,  // luminance of what light selection weighs
  kDiffuseFactor,
  kSpecularFactor,
  kImage,           // of a rectangle: 1 + index of its texture in LightTable::images; 0: none
  kEmissionFactor,  // of geometry: factor of its material's emission, or its own radiance (kOwnRadiance)
  kLightFlags = kEmissionFactor + 3,
  kShaping,  // 1 + index in ShapingTable; 0: none
  kLightFields,
  // Mesh lights have no inverse and no single radiance. In place of these they store the centre of the bounding sphere, half
  // edges if the mesh is a rectangle.
  kMeshCenter = kInverseX,
  kMeshHalfX = kInverseY,
  kMeshHalfY = kInverseZ,
  // Integers in the place of sizes or radiance that a type does not have.
  kMeshPlacement = kRadiance,  // 1 + index of the placement; 0: none
  kMeshInstance = kRadiance + 1,
  kMeshIndex = kSize1,  // of the mesh in EmitterTable
  kPoseIndex = kSize1,  // of a moving sphere's frame in EmitterTable
  kDomeIndex = kSize1
};
enum LightFlag : int32_t {
  kSheared = 1,
  kGeometry = 2,   // rays hit it as a shape of the scene, not as a light
  kRectangle = 4,  // a mesh that is a rectangle (build/emitters/emitters.hpp)
  kHidden = 16,    // hidden from the camera
  kSpecial = 32,   // its shadows differ from those of the geometry: found by light sampling only, with weight 1
                   // (light/shadow.hpp)
  // Geometry with UsdLux LightAPI (light:materialSyncMode):
  kOwnRadiance = 1 << 10,  // emits kEmissionFactor, whatever its material emits
  kMoving = 1 << 11,       // it moves: the row has the bounding sphere of its path, by which it is chosen
                           // (light/mesh/moving_emitter.hpp)
};

template <int W>
struct LightSample {
  vvec3<W> wi;       // unit
  vfloat<W> t, pdf;  // distance; density per solid angle excluding the choice of the light, 0: no contribution
  vvec3<W> L;
  vbool<W> is_delta;
  vint<W> light;
};

// Rows of each lane's light; the table is read once if all lanes chose the same light.
template <int W>
struct LightRow {
  const float* rows;
  vint<W> offset;
  int uniform;  // offset shared by all lanes, or -1

  // `table`: a LightTable.
  template <class Table>
  PRIMRAY_INLINE LightRow(const Table& table, vint<W> light) : rows(table.rows.data()), offset(light * vint<W>(kLightFields)) {
    PRIMRAY_ASSERT(are_rows(light, table.rows.size() / kLightFields));
    uniform = all(offset == vint<W>(offset[0])) ? offset[0] : -1;
  }
  // One row per lane, stored one after the other.
  static PRIMRAY_INLINE LightRow by_lane(const float* rows) { return {rows, lane_numbers<W>() * vint<W>(kLightFields), -1}; }
  // One row for all lanes.
  explicit PRIMRAY_INLINE LightRow(const float* row) : rows(row), offset(0), uniform(0) {}
  PRIMRAY_INLINE LightRow(const float* rows_, vint<W> offset_, int uniform_)
      : rows(rows_), offset(offset_), uniform(uniform_) {}
  PRIMRAY_INLINE vfloat<W> operator()(int field) const {
    return uniform >= 0 ? vfloat<W>(rows[uniform + field]) : gather<W>(rows + field, offset);
  }
  // Reads three fields at once; no vector is the last of a row.
  PRIMRAY_INLINE vvec3<W> vector(int field) const {
    if (uniform >= 0) return {(*this)(field), (*this)(field + 1), (*this)(field + 2)};
    const FourLanes<float, W> v = gather_four<W>(rows + field, offset);
    return {v.x, v.y, v.z};
  }
  PRIMRAY_INLINE vint<W> integer(int field) const { return bit_cast<vint<W>>((*this)(field)); }
  PRIMRAY_INLINE vint<W> flags() const { return integer(kLightFlags); }
  PRIMRAY_INLINE vint<W> type() const { return integer(kType); }
  PRIMRAY_INLINE vvec3<W> to_light(const vvec3<W>& v) const {
    return vector(kInverseX) * v.x + vector(kInverseY) * v.y + vector(kInverseZ) * v.z;
  }
  // distance^2 - radius^2 of p from a sphere (`axial` 1) or cylinder (0) of that radius. Computed from a point of its surface,
  // since for lights large beside the scene a difference of squares is imprecise: |r n + q|^2 - r^2 = |q|^2 + 2 r n.q.
  PRIMRAY_INLINE vfloat<W> outside(const vvec3<W>& p, vfloat<W> radius, vfloat<W> axial) const {
    const vvec3<W> q = to_light(p - vector(kAnchor)), n = vector(kAnchorNormal);
    return q.x * q.x * axial + q.y * q.y + q.z * q.z + 2.0f * radius * dot(n, q);
  }
  PRIMRAY_INLINE vvec3<W> to_world(const vvec3<W>& v) const {
    return vector(kAxisX) * v.x + vector(kAxisY) * v.y + vector(kAxisZ) * v.z;
  }
};

template <int W>
PRIMRAY_INLINE vbool<W> is_type(vint<W> type, LightType t) {
  return type == vint<W>(int32_t(t));
}

// Anchor of a round light: a surface point that keeps LightRow::outside() precise.

// Stores the point of a round light's surface (of a cylinder without ends) that is nearest to the core's origin. `axial`:
// weight of the light's axis in distances.
inline void put_anchor(float* row, const daffine& m, float axial) {
  if (m.determinant() == 0) return;  // such a light is skipped
  dvec3 out = inverse(m).point(dvec3(0.0));
  const double along = axial == 0 ? out.x : 0.0;
  out.x -= along;
  out = length(out) > 0 ? normalize(out) : dvec3{0, 0, 1};
  const dvec3 nearest = out * double(row[kSize0]);
  put(row, kAnchor, m.point({nearest.x + along, nearest.y, nearest.z}));
  put(row, kAnchorNormal, out);
}

}  // namespace primray
