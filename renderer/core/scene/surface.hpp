// Surfaces as a table of floats, one row each, reduced from UsdPreviewSurface's inputs to what the BSDF evaluates.
#pragma once

#include <cstdint>
#include <vector>

#include "math/vec3.hpp"

namespace primray {

// Inputs, as UsdPreviewSurface names them (scene description, not lanes).
struct SurfaceInput {
  bool lambert = true;
  vec3 diffuse_color{0.18f, 0.18f, 0.18f}, emissive_color{0.0f, 0.0f, 0.0f};
  bool use_specular_workflow = false;
  vec3 specular_color{0.0f, 0.0f, 0.0f};
  float metallic = 0, roughness = 0.5f, clearcoat = 0, clearcoat_roughness = 0.01f, opacity = 1, ior = 1.5f;
  bool presence = false, thin = false;
};

// Columns of a row.
enum SurfaceField : int {
  kFlags,
  kDiffuse,                // albedo of the diffuse lobe
  kF0 = kDiffuse + 3,      // reflectance at normal incidence
  kF90 = kF0 + 3,          // reflectance at grazing incidence
  kEmission = kF90 + 3,    // radiance
  kAlpha = kEmission + 3,  // GGX width; 0: mirror
  kRoughness,              // sqrt(alpha), the albedo table's axis
  kTransmission,           // fraction of what is not reflected that passes through
  kPresence,               // probability that the surface is there at all
  kIor,
  kClearcoat,
  kClearcoatAlpha,
  kClearcoatRoughness,
  kClearcoatF0,
  kSurfaceFields
};
enum SurfaceFlag : int32_t { kPreview = 1, kEmits = 2, kThin = 4 };

struct SurfaceTable {
  std::vector<float> rows;  // kSurfaceFields floats a surface; kFlags holds the flags as a float (exact)
  int32_t add(const SurfaceInput& s);
};

// Below this width the float half vector is too coarse for the lobe's peak (alpha 1e-4 is roughness 0.01): a mirror.
constexpr float kMinAlpha = 1e-4f;

inline int32_t SurfaceTable::add(const SurfaceInput& s) {
  const auto lerp = [](vec3 a, vec3 b, float t) { return a * (1 - t) + b * t; };
  float row[kSurfaceFields] = {};
  const auto put = [&](int field, vec3 c) { row[field] = c.x, row[field + 1] = c.y, row[field + 2] = c.z; };
  const bool emits = max_component(s.emissive_color) > 0;
  // A Lambert surface that may be there in part only: a preview surface that reflects nothing specularly, F0 = F90 = 0.
  const bool preview = !s.lambert || s.presence;
  row[kFlags] = float((preview ? kPreview : 0) | (emits ? kEmits : 0) | (s.thin ? kThin : 0));
  put(kEmission, s.emissive_color);
  row[kPresence] = s.presence ? s.opacity : 1.0f;
  row[kIor] = s.ior;
  if (s.lambert) {
    put(kDiffuse, s.diffuse_color);
    row[kAlpha] = row[kRoughness] = 1.0f;
  } else {
    // UsdPreviewSurface specification, "Specular workflow", "Metallic workflow" (usd-facts, section 5).
    const float r = (1 - s.ior) / (1 + s.ior), f0 = r * r;
    const float metallic = s.use_specular_workflow ? 0.0f : s.metallic;
    const float opacity = s.presence ? 1.0f : s.opacity;
    put(kDiffuse, s.diffuse_color * ((1 - metallic) * opacity));
    if (s.use_specular_workflow) {
      put(kF0, s.specular_color);
      put(kF90, vec3(1.0f));
    } else {
      const vec3 c = lerp(vec3(1.0f), s.diffuse_color, metallic);
      put(kF0, lerp(c * f0, c, metallic));
      put(kF90, c);
    }
    const float alpha = s.roughness * s.roughness, cc_alpha = s.clearcoat_roughness * s.clearcoat_roughness;
    row[kAlpha] = alpha < kMinAlpha ? 0.0f : alpha;
    row[kRoughness] = s.roughness;
    row[kTransmission] = 1 - opacity;
    row[kClearcoat] = s.clearcoat;
    // A delta clearcoat would need a second mirror lobe; kMinAlpha looks the same.
    row[kClearcoatAlpha] = cc_alpha < kMinAlpha ? kMinAlpha : cc_alpha;
    row[kClearcoatRoughness] = s.clearcoat_roughness < 0.01f ? 0.01f : s.clearcoat_roughness;
    row[kClearcoatF0] = f0;
  }
  rows.insert(rows.end(), row, row + kSurfaceFields);
  return int32_t(rows.size() / kSurfaceFields) - 1;
}

}  // namespace primray
