// All lights: one table of floats, one dispatch by type and lane. What a type samples is in a file of its own, as rect.hpp.
//
// Area lights live in a frame of their own without size (their size is in kSize0, kSize1), so that sampling by solid angle
// there is sampling by solid angle here; only a sheared frame changes it, by the Jacobian |det A| / |A w|^3 of directions under
// A. Lights are not geometry: they shadow nothing, and emit from their front alone.
#pragma once

#include <cstdint>
#include <vector>

#include "light/choice/hierarchy.hpp"
#include "light/choice/linking.hpp"
#include "light/choice/tree.hpp"
#include "light/cylinder.hpp"
#include "light/disk.hpp"
#include "light/distant.hpp"
#include "light/dome/dome.hpp"
#include "light/line.hpp"
#include "light/rect.hpp"
#include "light/shaping/shaping.hpp"
#include "light/sphere.hpp"
#include "light/textured_rect.hpp"

namespace primray {

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
  kMeshInstance = kRadiance + 1,
  // Unit axes in the world of a mesh that is a light: its own x, and its own z, away from which it points.
  kMeshFrameX = kAnchor,
  kMeshFrameZ = kAnchorNormal
};
enum LightFlag : int32_t {
  kSheared = 1,
  kGeometry = 2,   // rays meet it as a shape of the scene, not as a light
  kRectangle = 4,  // a mesh that is one (build/emitters/emitter_rectangles.hpp)
  kHidden = 16,    // the camera does not see it
  kSpecial = 32,   // its shadows are not the geometry's: light sampling alone finds it, with weight 1 (light/shadow.hpp)
  // Of geometry that is a light (UsdLux LightAPI, light:materialSyncMode):
  kOwnRadiance = 1 << 10,  // it gives kGlow, whatever glow its material has
};

// A light's multipliers of what surfaces reflect diffusely and specularly (UsdLux inputs:diffuse, inputs:specular).
struct LobeFactors {
  float diffuse = 1, specular = 1;
};

// What else there is to know of a dome, sampled or not.
struct DomeTraits {
  int link = 0;
  bool hidden = false, special = false;  // as LightFlag has them
};

struct LightTable {
  std::vector<float> rows;  // of the lights that are sampled
  int count = 0;
  int listed = 0;               // those before geometry that emits: rays meet the others as shapes of the scene
  std::vector<Dome> domes;      // all of them, sampled or not
  std::vector<int> dome_light;  // by dome: its row, or -1
  std::vector<LobeFactors> dome_factors;
  std::vector<DomeTraits> dome_traits;
  std::vector<LightImage> images;  // of rectangles; several may have the same
  std::vector<LightTable>
      portals;         // by dome: rectangles of radiance 1 that guide its samples (light/selection/portal.hpp); or empty
  LightTree tree;      // to choose among them, where there are too many lights to weigh each
  LightHierarchy met;  // of the lights that rays can meet, where there are many
  bool needs_hit_test = false;  // some light has area or a cone that BSDF rays can meet
  bool camera_sees_area = false;
  Fact<built::kLobeFactors> lobe_factors = false;  // some light's diffuse or specular factor is not 1
  // Linking; all empty where nothing is linked. Row by row, the collection that a light reaches.
  LinkTable links;
  std::vector<int32_t> light_link;
  LinkedLights linked;
  std::vector<float> shadow_rows;  // kShadowFields a row, where some light is special; else empty
  ShapingTable shaping;
  Fact<built::kShaping> has_shaping = false;  // some light's emission depends on its direction
  // At most so many are weighed at every vertex; from there on the tree's weights, which know the surface, are worth their
  // cost. Portals are few as a rule, and so weighed that none is chosen where none can be seen.
  static constexpr int kWeighed = 3, kWeighedPortals = 16;
  int weighed = kWeighed;

  bool has_portals() const { return built::kPortals && !portals.empty(); }
  bool has_special() const { return built::kSpecialShadows && !shadow_rows.empty(); }
  bool has_images() const { return built::kLightImages && !images.empty(); }
  bool by_tree() const { return count > weighed; }
  const float* row(int light) const { return rows.data() + light * kLightFields; }
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

  PRIMRAY_INLINE LightRow(const LightTable& table, vint<W> light)
      : rows(table.rows.data()), offset(light * vint<W>(kLightFields)) {
    uniform = all(offset == vint<W>(offset[0])) ? offset[0] : -1;
  }
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

// Shaping of the lights `row` in lanes `m`, for what they send back along wi.
template <int W>
PRIMRAY_INLINE vvec3<W> light_shaping(const LightTable& table, const LightRow<W>& row, vbool<W> m, const vvec3<W>& wi) {
  const vint<W> number = select(m, truncate(row(kShaping)), vint<W>(0));
  const vbool<W> shaped = number != vint<W>(0);
  const vvec3<W> one(vfloat<W>(1.0f));
  if (!any(shaped)) return one;
  const vint<W> valid = select(shaped, number, vint<W>(number[__builtin_ctz(bits(shaped))]));
  return select(shaped, shaping_factor(table.shaping, valid, -wi), one);
}

// The same for one light that rays along wi met.
template <int W>
PRIMRAY_INLINE vvec3<W> met_shaping(const LightTable& table, const float* row, const vvec3<W>& wi) {
  const int number = int(row[kShaping]);
  return number == 0 ? vvec3<W>(vfloat<W>(1.0f)) : shaping_factor(table.shaping, vint<W>(number), -wi);
}

// A direction towards `light` from world point p. Its pdf leaves out the choice of the light.
template <int W>
PRIMRAY_INLINE LightSample<W> light_sample(const LightTable& table, vint<W> light, vbool<W> active, const vvec3<W>& p,
                                           vfloat<W> u, vfloat<W> v) {
  const LightRow<W> row(table, light);
  const vint<W> type = select(active, row.type(), vint<W>(-1));
  const vfloat<W> size0 = row(kSize0), size1 = row(kSize1);
  const vvec3<W> local = row.to_light(p - row.vector(kOrigin));
  LocalSample<W> s{vvec3<W>(vfloat<W>(0.0f)), vfloat<W>(kInfinity), vfloat<W>(0.0f)};
  const auto take = [&](LightType t, auto sample) {
    const vbool<W> m = is_type(type, t);
    if (!any(m)) return;
    const LocalSample<W> n = sample();
    s = {select(m, n.w, s.w), select(m, n.t, s.t), select(m, n.pdf, s.pdf)};
  };
  take(LightType::kSphere, [&] { return sphere_sample(local, size0, row.outside(p, size0, 1.0f), u, v); });
  take(LightType::kDisk, [&] { return disk_sample(local, size0, u, v); });
  take(LightType::kRect, [&] { return rect_sample(local, size0, size1, u, v); });
  take(LightType::kCylinder, [&] { return cylinder_sample(local, size0, size1, row.outside(p, size0, 0.0f), u, v); });
  take(LightType::kDistant, [&] { return distant_sample(size0, u, v); });
  LightSample<W> r;
  r.light = light;
  r.L = row.vector(kRadiance);
  if (table.has_images()) {
    const vint<W> image = truncate(row(kImage));
    for (vbool<W> left = is_type(type, LightType::kRect) & (image > vint<W>(0)); any(left);) {
      const int k = image[__builtin_ctz(bits(left))];
      const vbool<W> same = left & (image == vint<W>(k));
      left &= !same;
      vvec3<W> value;
      const LocalSample<W> n = textured_rect_sample(table.images[k - 1], local, size0, size1, u, v, value);
      s = {select(same, n.w, s.w), select(same, n.t, s.t), select(same, n.pdf, s.pdf)};
      r.L = select(same, r.L * value, r.L);
    }
  }
  r.wi = row.to_world(s.w), r.t = s.t, r.pdf = s.pdf;
  const vbool<W> sheared = (row.flags() & vint<W>(kSheared)) != vint<W>(0);
  if (any(sheared & active)) {
    const vfloat<W> len = length(r.wi);
    r.wi = select(sheared, r.wi * (1.0f / len), r.wi);
    r.t = select(sheared, r.t * len, r.t);
    r.pdf = select(sheared, r.pdf * row(kInverseDet) * len * len * len, r.pdf);
  }
  r.is_delta = is_type(type, LightType::kPoint) | (is_type(type, LightType::kDistant) & (size0 == vfloat<W>(0.0f)));
  const vbool<W> point = is_type(type, LightType::kPoint);
  if (any(point)) {
    const vvec3<W> to = row.vector(kOrigin) - p;
    const vfloat<W> d2 = dot(to, to), d = sqrt(d2);
    r.wi = select(point, to * (1.0f / d), r.wi);
    r.t = select(point, d, r.t);
    r.pdf = select(point, select(d2 > vfloat<W>(0.0f), vfloat<W>(1.0f), vfloat<W>(0.0f)), r.pdf);
    r.L = select(point, r.L * (1.0f / d2), r.L);
  }
  const vbool<W> line = is_type(type, LightType::kLine);
  if (any(line)) {
    const LineSample<W> l = line_sample(row.vector(kOrigin) - p, row.vector(kAxisX), size1, u);
    r.wi = select(line, l.wi, r.wi), r.t = select(line, l.t, r.t);
    r.pdf = select(line, select(l.usable, vfloat<W>(1.0f), vfloat<W>(0.0f)), r.pdf);
    r.L = select(line, r.L * l.worth, r.L);
    r.is_delta |= line;
  }
  const vbool<W> dome = is_type(type, LightType::kDome);
  if (any(dome)) {
    for (int k = 0; k < int(table.domes.size()); ++k) {
      const vbool<W> m = dome & (truncate(size1) == vint<W>(k));
      if (!table.domes[k].sampled || !any(m)) continue;
      const vvec3<W> w = dome_sample(table.domes[k], u, v);
      vfloat<W> pdf;
      const vvec3<W> L = dome_eval(table.domes[k], w, pdf);
      r.wi = select(m, w, r.wi), r.pdf = select(m, pdf, r.pdf), r.L = select(m, L, r.L);
    }
  }
  if (table.has_shaping) r.L *= light_shaping(table, row, active & (r.pdf > vfloat<W>(0.0f)), r.wi);
  return r;
}

// Where the ray p + t wi (unit wi) meets a light's row, for all light types that a ray can meet but domes; the pdf leaves out
// the choice.
template <int W>
PRIMRAY_INLINE LocalHit<W> light_hit(const float* row, const vvec3<W>& p, const vvec3<W>& wi) {
  const auto vector = [&](int field) {
    return vvec3<W>(vfloat<W>(row[field]), vfloat<W>(row[field + 1]), vfloat<W>(row[field + 2]));
  };
  const auto to_light = [&](const vvec3<W>& x) {
    return vector(kInverseX) * x.x + vector(kInverseY) * x.y + vector(kInverseZ) * x.z;
  };
  const LightType type = LightType(int(row[kType]));
  vvec3<W> w = to_light(wi);
  vfloat<W> len(1.0f);
  const bool sheared = int(row[kLightFlags]) & kSheared;
  if (sheared) {
    len = length(w);
    w = w * (1.0f / len);
  }
  const vvec3<W> local = to_light(p - vector(kOrigin));
  const vfloat<W> size0(row[kSize0]), size1(row[kSize1]);
  const auto outside = [&](vfloat<W> axial) {  // as LightRow has it
    const vvec3<W> q = to_light(p - vector(kAnchor));
    return q.x * q.x * axial + q.y * q.y + q.z * q.z + 2.0f * size0 * dot(vector(kAnchorNormal), q);
  };
  LocalHit<W> h{vfloat<W>(kInfinity), vfloat<W>(0.0f)};
  switch (type) {
    case LightType::kSphere:
      h = sphere_hit(local, w, size0, outside(1.0f));
      break;
    case LightType::kDisk:
      h = disk_hit(local, w, size0);
      break;
    case LightType::kRect:
      h = rect_hit(local, w, size0, size1);
      break;
    case LightType::kCylinder:
      h = cylinder_hit(local, w, size0, size1, outside(0.0f));
      break;
    case LightType::kDistant:
      h = distant_hit(w, size0);
      break;
    case LightType::kPoint:
    case LightType::kDome:
    case LightType::kMesh:
    case LightType::kLine:
      break;
  }
  if (sheared) {
    h.t = h.t * (1.0f / len);
    h.pdf = h.pdf * row[kInverseDet] / (len * len * len);
  }
  return h;
}

// The same of light number `i`, whose radiance L is multiplied with what its image has there.
template <int W>
PRIMRAY_INLINE LocalHit<W> light_hit(const LightTable& table, int i, const vvec3<W>& p, const vvec3<W>& wi, vvec3<W>& L) {
  const float* row = table.row(i);
  LocalHit<W> h = light_hit<W>(row, p, wi);
  const int image = table.has_images() ? int(row[kImage]) : 0;
  if (image == 0 || !any(h.pdf > vfloat<W>(0.0f))) return h;
  const LightRow<W> light(table, vint<W>(i));
  const vvec3<W> local = light.to_light(p - light.vector(kOrigin));
  vvec3<W> w = light.to_light(wi);
  const vfloat<W> len = length(w);
  const bool sheared = int(row[kLightFlags]) & kSheared;
  const vfloat<W> stretch = sheared ? row[kInverseDet] / (len * len * len) : vfloat<W>(1.0f);
  if (sheared) w = w * (1.0f / len);
  const vfloat<W> distance = sheared ? h.t * len : h.t;
  vvec3<W> value;
  const vfloat<W> pdf = textured_rect_hit(table.images[image - 1], local, w, vfloat<W>(row[kSize0]), vfloat<W>(row[kSize1]),
                                          distance, h.pdf / stretch, value);
  L *= value;
  h.pdf = select(h.pdf > vfloat<W>(0.0f), pdf * stretch, h.pdf);
  return h;
}

}  // namespace primray
