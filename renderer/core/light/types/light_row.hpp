// A light's row of floats, which every type lays out alike, and how lanes read it.
//
// Area lights live in a frame of their own without size (their size is in kSize0, kSize1), so that sampling by solid angle
// there is sampling by solid angle here; only a sheared frame changes it, by the Jacobian |det A| / |A w|^3 of directions under
// A. Lights are not geometry: they shadow nothing, and emit from their front alone.
#pragma once

#include <cstdint>

#include "light/shape/local_shape.hpp"

namespace primray {

// What a row's kType holds.
enum class LightType : int32_t { kPoint, kSphere, kDisk, kRect, kCylinder, kDistant, kDome, kMesh, kLine };

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
  kSize0,                       // half width, radius (a mesh's: of a ball about it), or 1 - cos of a distant light's half-angle
  kSize1,                       // half height, half length, a dome's number, or a mesh's in EmitterTable
  kRadiance,                    // radiance; radiant intensity of a point, of a line by length; irradiance of a sun of angle 0
  kAnchor = kRadiance + 3,      // a sphere's or cylinder's: a point of its surface near the core's origin, and its normal there
  kAnchorNormal = kAnchor + 3,  // in the light's frame
  kImportance = kAnchorNormal + 3,  // luminance of what selection weighs
  kDiffuseFactor,
  kSpecularFactor,
  kImage,  // of a rectangle: its texture in LightTable::images, counted from 1; 0: none
  kGlow,   // of geometry: what it makes of its material's glow, or its own radiance (kOwnRadiance)
  kLightFlags = kGlow + 3,
  kShaping,  // its number in ShapingTable, from 1; 0: none
  kLightFields,
  // A mesh needs no inverse and has no one radiance, but its ball's centre, half its edges where it is a rectangle, and the
  // placement (-1: none) and its instance.
  kMeshCenter = kInverseX,
  kMeshHalfX = kInverseY,
  kMeshHalfY = kInverseZ,
  kMeshPlacement = kRadiance,
  kMeshInstance = kRadiance + 1
};
enum LightFlag : int32_t {
  kSheared = 1,
  kGeometry = 2,   // rays meet it as a shape of the scene, not as a light
  kRectangle = 4,  // a mesh that is one (build/emitters/emitter_rectangles.hpp)
  kHidden = 16,    // the camera does not see it
  kSpecial = 32,   // its shadows are not the geometry's: light sampling alone finds it, with weight 1 (light/shadow.hpp)
  // Of geometry that is a light (UsdLux LightAPI, light:materialSyncMode):
  kOwnRadiance = 1 << 10,  // it gives kGlow, whatever glow its material has
  kPassing = 1 << 11,      // it moves: the row is of a ball about its way, by which it is chosen (emitter/passing_emitter.hpp)
};

template <int W>
struct LightSample {
  vvec3<W> wi;       // unit
  vfloat<W> t, pdf;  // distance, density per solid angle without the choice of the light; 0: nothing
  vvec3<W> L;
  vbool<W> is_delta;
  vint<W> light;
};

// One lane's light each; reads the table once where all lanes chose the same.
template <int W>
struct LightRow {
  const float* rows;
  vint<W> offset;
  int uniform;  // offset shared by all lanes, or -1

  // `table`: a LightTable.
  template <class Table>
  PRIMRAY_INLINE LightRow(const Table& table, vint<W> light) : rows(table.rows.data()), offset(light * vint<W>(kLightFields)) {
    uniform = all(offset == vint<W>(offset[0])) ? offset[0] : -1;
  }
  // A row for every lane, one after the other.
  static PRIMRAY_INLINE LightRow by_lane(const float* rows) { return {rows, lane_numbers<W>() * vint<W>(kLightFields), -1}; }
  // One row for all lanes.
  explicit PRIMRAY_INLINE LightRow(const float* row) : rows(row), offset(0), uniform(0) {}
  PRIMRAY_INLINE LightRow(const float* rows_, vint<W> offset_, int uniform_)
      : rows(rows_), offset(offset_), uniform(uniform_) {}
  PRIMRAY_INLINE vfloat<W> operator()(int field) const {
    return uniform >= 0 ? vfloat<W>(rows[uniform + field]) : gather<W>(rows + field, offset);
  }
  PRIMRAY_INLINE vvec3<W> vector(int field) const { return {(*this)(field), (*this)(field + 1), (*this)(field + 2)}; }
  PRIMRAY_INLINE vint<W> flags() const { return truncate((*this)(kLightFlags)); }
  PRIMRAY_INLINE vint<W> type() const { return truncate((*this)(kType)); }
  PRIMRAY_INLINE vvec3<W> to_light(const vvec3<W>& v) const {
    return vector(kInverseX) * v.x + vector(kInverseY) * v.y + vector(kInverseZ) * v.z;
  }
  // How far p lies outside a sphere (`axial` 1) or cylinder (0) of that radius, as distance^2 - radius^2. By way of a point of
  // its surface, since where it is large beside the scene a difference of squares has no digits left: |r n + q|^2 - r^2 =
  // |q|^2 + 2 r n.q.
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

}  // namespace primray
