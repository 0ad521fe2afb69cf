// Surface table: one row of floats per surface, reduced from UsdPreviewSurface's inputs to what the BSDF evaluates. An OpenPBR
// surface has another row beside it (open_pbr/row.hpp), and so has hair (hair/row.hpp); the row here has the properties that
// are read for any surface.
#pragma once

#include <cstdint>
#include <optional>
#include <type_traits>
#include <vector>

#include "bsdf/basics/varying_inputs.hpp"
#include "bsdf/hair/row.hpp"
#include "bsdf/open_pbr/row.hpp"
#include "math/lane_checks.hpp"

namespace primray {

// Visibility of surfaces to the camera, directly or through transmissive surfaces: render passes hide shapes from it, or make
// them mattes (holdouts).
enum class CameraVisibility : int32_t { kSeen, kHidden, kMatte };

// Camera visibility by surface; empty if the camera sees all.
struct CameraVisibilityTable {
  std::vector<int32_t> of_surface;

  bool any() const { return !of_surface.empty(); }
  // Adds the next surface.
  void add(size_t surface, CameraVisibility visibility) {
    if (visibility != CameraVisibility::kSeen) of_surface.resize(surface, 0);
    if (visibility != CameraVisibility::kSeen || any()) of_surface.push_back(int32_t(visibility));
  }
  template <int W>
  vbool<W> lanes_with(CameraVisibility visibility, vbool<W> m, vint<W> surface) const {
    if (!any()) return vbool<W>(false);
    return m & (gather<W>(of_surface.data(), select(m, surface, vint<W>(0))) == vint<W>(int32_t(visibility)));
  }
};

// Homogeneous medium inside a closed shape, per world unit of length; `emission` is radiance per length.
struct VolumeInput {
  vec3 extinction{0.0f}, scattering{0.0f}, emission{0.0f};
  float phase = 0;  // see medium/phase_function.hpp
};

// Inputs with the names of UsdPreviewSurface (scene description, not lanes).
struct SurfaceInput : VaryingInputs<vec3, float> {
  SurfaceInput()
      : VaryingInputs{.diffuse_color{0.18f, 0.18f, 0.18f},
                      .emissive_color{0.0f, 0.0f, 0.0f},
                      .specular_color{0.0f, 0.0f, 0.0f},
                      .metallic = 0,
                      .roughness = 0.5f,
                      .clearcoat = 0,
                      .clearcoat_roughness = 0.01f,
                      .opacity = 1,
                      .ior = 1.5f} {}
  bool lambert = true;
  bool use_specular_workflow = false;
  bool presence = false, thin = false;
  float opacity_threshold = 0;    // above 0: a cutout, opaque where present
  float dielectric_priority = 0;  // where objects overlap the higher one prevails
  CameraVisibility camera = CameraVisibility::kSeen;
  std::optional<OpenPbrInput> open_pbr;
  std::optional<HairInput> hair;
  // What is inside. Without an interface the surface only bounds it: light passes, and overlapping volumes add.
  std::optional<VolumeInput> volume;
  bool interface = true;
};

// Columns of a row: floats, but for kFlags and kOpenPbrRow, which are integers as their bits.
enum SurfaceField : int {
  kFlags,
  kDiffuse,                // albedo of the diffuse lobe
  kF0 = kDiffuse + 3,      // reflectance at normal incidence
  kF90 = kF0 + 3,          // reflectance at grazing incidence
  kEmission = kF90 + 3,    // radiance
  kAlpha = kEmission + 3,  // GGX width; 0: mirror
  kRoughness,              // sqrt(alpha), the albedo table's axis
  kTransmission,           // transmitted share of the light that is not reflected
  kPresence,               // probability that the surface is present
  kIor,
  kClearcoat,
  kClearcoatAlpha,
  kClearcoatRoughness,
  kClearcoatF0,
  kOpenPbrRow,  // row of an OpenPBR surface, or of hair, in its own table
  kSurfaceFields
};
enum SurfaceFlag : int32_t { kPreview = 1, kEmits = 2, kThin = 4, kOpenPbr = 8, kHair = 16 };

// Inputs in lanes, all of one surface.
template <int W>
struct SurfaceValues : VaryingInputs<vvec3<W>, vfloat<W>> {
  PRIMRAY_INLINE explicit SurfaceValues(const SurfaceInput& s) {
    for_each_input([&](InputField, const char*, InputRange, auto member) {
      auto& value = member(*this);
      value = std::remove_reference_t<decltype(value)>(member(s));
    });
  }
  // Sets a value that varies: the first component of `x`, or all three; NaN becomes the lower bound.
  PRIMRAY_INLINE void set(InputField field, const vvec3<W>& x) {
    for_each_input([&](InputField own, const char*, InputRange range, auto member) {
      if (own != field) return;
      const auto clamped = [&](vfloat<W> c) { return clamp(c, range.low, range.high); };
      auto& value = member(*this);
      if constexpr (std::is_same_v<decltype(value), vvec3<W>&>)
        value = {clamped(x.x), clamped(x.y), clamped(x.z)};
      else
        value = clamped(x.x);
    });
  }
};

template <int W>
PRIMRAY_INLINE void put_flags(int32_t flags, vbool<W> emits, vfloat<W> (&row)[kSurfaceFields]) {
  row[kFlags] = bit_cast<vfloat<W>>(select(emits, vint<W>(flags | kEmits), vint<W>(flags)));
}

// Computes the columns of W rows of the surface `s`, whose constants `v` may vary. With an opacity threshold, a surface is
// either absent or opaque.
template <int W>
PRIMRAY_INLINE void reduce_surface(const SurfaceInput& s, const SurfaceValues<W>& v, vfloat<W> (&row)[kSurfaceFields]) {
  using F = vfloat<W>;
  const F one(1.0f), zero(0.0f);
  const auto lerp = [](const vvec3<W>& a, const vvec3<W>& b, F t) { return a * (1.0f - t) + b * t; };
  const auto put = [&](int field, const vvec3<W>& c) { row[field] = c.x, row[field + 1] = c.y, row[field + 2] = c.z; };
  for (F& f : row) f = zero;
  const vbool<W> emits = max_component(v.emissive_color) > zero;
  // A Lambert surface that may be present only in part: a preview surface without specular reflection, F0 = F90 = 0.
  const bool preview = !s.lambert || s.presence;
  put_flags((preview ? kPreview : 0) | (s.thin ? kThin : 0), emits, row);
  put(kEmission, v.emissive_color);
  const F there = s.opacity_threshold > 0 ? one : v.opacity;
  row[kPresence] = s.presence ? there : one;
  row[kIor] = v.ior;
  if (s.lambert) {
    put(kDiffuse, v.diffuse_color);
    row[kAlpha] = row[kRoughness] = one;
    return;
  }
  // UsdPreviewSurface specification, "Specular workflow", "Metallic workflow".
  const F r = (1.0f - v.ior) / (1.0f + v.ior), f0 = r * r;
  const F metallic = s.use_specular_workflow ? zero : v.metallic;
  const F opacity = s.presence ? one : there;
  put(kDiffuse, v.diffuse_color * ((1.0f - metallic) * opacity));
  if (s.use_specular_workflow) {
    put(kF0, v.specular_color);
    put(kF90, vvec3<W>(one));
  } else {
    const vvec3<W> c = lerp(vvec3<W>(one), v.diffuse_color, metallic);
    put(kF0, lerp(c * f0, c, metallic));
    put(kF90, c);
  }
  const F alpha = v.roughness * v.roughness, cc_alpha = v.clearcoat_roughness * v.clearcoat_roughness;
  row[kAlpha] = select(alpha < F(kMinAlpha), zero, alpha);
  row[kRoughness] = v.roughness;
  row[kTransmission] = 1.0f - opacity;
  row[kClearcoat] = v.clearcoat;
  // A delta clearcoat would need a second mirror lobe; kMinAlpha looks the same.
  row[kClearcoatAlpha] = max(cc_alpha, kMinAlpha);
  row[kClearcoatRoughness] = max(v.clearcoat_roughness, 0.01f);
  row[kClearcoatF0] = f0;
}

// Computes the columns of an OpenPBR surface with row number `at`, approximated in terms of the preview surface.
template <int W>
PRIMRAY_RARE void reduce_surface(const SurfaceInput& s, const SurfaceValues<W>& v, const OpenPbrValues<W>& o,
                                 const vfloat<W> (&open)[kOpenPbrFields], vint<W> at, vfloat<W> (&row)[kSurfaceFields]) {
  using F = vfloat<W>;
  reduce_surface(s, v, row);
  const F one(1.0f), zero(0.0f), passes = (one - o.base_metalness) * o.transmission_weight;
  const auto put = [&](int field, const vvec3<W>& c) { row[field] = c.x, row[field + 1] = c.y, row[field + 2] = c.z; };
  const auto get = [&](int field) { return vvec3<W>(open[field], open[field + 1], open[field + 2]); };
  put_flags(kPreview | kOpenPbr | (s.thin ? kThin : 0), max_component(v.emissive_color) > zero, row);
  put(kDiffuse, get(kOpenDiffuse) * (open[kOpenDiffuseWeight] * (one - o.base_metalness) * (one - o.transmission_weight)));
  const F e = (open[kOpenEta] - 1.0f) / (open[kOpenEta] + 1.0f);
  const vvec3<W> f0 = get(kOpenSpecularColor) * (e * e), metal = get(kOpenMetal) * open[kOpenMetalWeight];
  put(kF0, f0 + (metal - f0) * o.base_metalness), put(kF90, vvec3<W>(one));
  row[kAlpha] = select(open[kOpenAlphaT] > zero, sqrt(open[kOpenAlphaT] * open[kOpenAlphaB]), zero);
  row[kRoughness] = open[kOpenRoughness];
  row[kTransmission] = passes;
  row[kIor] = open[kOpenEta];
  const F coat = (o.coat_ior - 1.0f) / (o.coat_ior + 1.0f);
  row[kClearcoat] = o.coat_weight;
  row[kClearcoatAlpha] = sqrt(open[kOpenCoatAlphaT] * open[kOpenCoatAlphaB]);
  row[kClearcoatRoughness] = open[kOpenCoatRoughness], row[kClearcoatF0] = coat * coat;
  row[kOpenPbrRow] = bit_cast<F>(at);
}

// Computes the columns of hair with row number `at`: approximated by a diffuse surface with the colour of light after a mean
// distance through the fibre, pi / 2 radii.
template <int W>
PRIMRAY_RARE void reduce_surface(const SurfaceInput& s, const SurfaceValues<W>& v, const HairValues<W>& hair, vint<W> at,
                                 vfloat<W> (&row)[kSurfaceFields]) {
  using F = vfloat<W>;
  reduce_surface(s, v, row);
  for (int field = kDiffuse; field < kEmission; ++field) row[field] = F(0.0f);
  put_flags(kPreview | kHair | kThin, max_component(v.emissive_color) > F(0.0f), row);
  const auto transmittance = [](F absorption, F tint) {
    return tint * exp2_negative<W>(min(absorption, 80.0f) * -2.26618007f);
  };
  row[kDiffuse] = transmittance(hair.absorption.x, hair.tint_tt.x);
  row[kDiffuse + 1] = transmittance(hair.absorption.y, hair.tint_tt.y);
  row[kDiffuse + 2] = transmittance(hair.absorption.z, hair.tint_tt.z);
  row[kAlpha] = row[kRoughness] = F(1.0f);
  row[kTransmission] = row[kClearcoat] = F(0.0f);
  row[kOpenPbrRow] = bit_cast<F>(at);
}

struct SurfaceTable {
  std::vector<float> rows;      // kSurfaceFields per surface
  std::vector<float> open_pbr;  // kOpenPbrFields floats each
  std::vector<float> hair;      // kHairFields floats each
  int32_t add(const SurfaceInput& s) {
    vfloat<1> row[kSurfaceFields];
    if (s.open_pbr) {
      const OpenPbrValues<1> values(*s.open_pbr);
      vfloat<1> open[kOpenPbrFields];
      reduce_open_pbr<1>(values, s.thin, open);
      reduce_surface<1>(s, SurfaceValues<1>(s), values, open, vint<1>(int32_t(open_pbr.size() / kOpenPbrFields)), row);
      for (const vfloat<1>& f : open) open_pbr.push_back(f[0]);
    } else if (s.hair) {
      const HairValues<1> values(*s.hair);
      vfloat<1> fibre[kHairFields];
      reduce_hair<1>(values, fibre);
      reduce_surface<1>(s, SurfaceValues<1>(s), values, vint<1>(int32_t(hair.size() / kHairFields)), row);
      for (const vfloat<1>& f : fibre) hair.push_back(f[0]);
    } else {
      reduce_surface<1>(s, SurfaceValues<1>(s), row);
    }
    for (const vfloat<1>& f : row) rows.push_back(f[0]);
    return int32_t(rows.size() / kSurfaceFields) - 1;
  }
};

// Rows of W lanes: in the table, or where evaluate_inputs() has written them.
template <int W>
class SurfaceRows : public LobeRows<W> {
 public:
  // Rows of one surface that is neither OpenPBR nor hair.
  PRIMRAY_INLINE explicit SurfaceRows(const float* row)
      : LobeRows<W>(row, vbool<W>(true), vint<W>(0), kSurfaceFields), open_pbr_(nullptr), hair_(nullptr) {}
  // Rows of surfaces in lanes `m`.
  PRIMRAY_INLINE SurfaceRows(const SurfaceTable& table, vint<W> surface, vbool<W> m = vbool<W>(true))
      : LobeRows<W>(table.rows.data(), m, surface, kSurfaceFields), open_pbr_(table.open_pbr.data()), hair_(table.hair.data()) {
    PRIMRAY_ASSERT(are_rows(surface, table.rows.size() / kSurfaceFields));
  }
  // Columns of all three tables.
  PRIMRAY_INLINE static SurfaceRows by_column(const float* columns, const float* open_pbr, const float* hair) {
    return SurfaceRows(LobeRows<W>::by_column(columns), open_pbr, hair);
  }

  PRIMRAY_INLINE vint<W> flags() const { return bit_cast<vint<W>>((*this)(kFlags)); }
  // Row of an OpenPBR surface, or of hair, in its own table.
  PRIMRAY_INLINE vint<W> lobe_row() const { return bit_cast<vint<W>>((*this)(kOpenPbrRow)); }
  // Returns the rows of lanes `m`, which are OpenPBR surfaces, in the table of such.
  PRIMRAY_INLINE LobeRows<W> open_pbr_rows(vbool<W> m) const { return lobe_rows(open_pbr_, m, kOpenPbrFields); }
  // Returns the rows of lanes `m`, which are hair, in the table of hair.
  PRIMRAY_INLINE LobeRows<W> hair_rows(vbool<W> m) const { return lobe_rows(hair_, m, kHairFields); }

 private:
  const float* open_pbr_;
  const float* hair_;

  PRIMRAY_INLINE SurfaceRows(const LobeRows<W>& rows, const float* open_pbr, const float* hair)
      : LobeRows<W>(rows), open_pbr_(open_pbr), hair_(hair) {}
  PRIMRAY_INLINE LobeRows<W> lobe_rows(const float* table, vbool<W> m, int fields) const {
    if (this->is_by_column()) return LobeRows<W>::by_column(table);
    return {table, m, select(m, lobe_row(), vint<W>(0)), fields};
  }
};

}  // namespace primray
