// Inputs of a surface that may vary over it: one list, for constants, for lanes and for Python.
#pragma once

#include <cstdint>

#include "math/vec3.hpp"

namespace primray {

// Rows of W lanes in a table of lobe parameters.
template <int W>
struct LobeRows {
  const float* rows;
  vint<W> base;
  PRIMRAY_INLINE vfloat<W> operator()(int field) const { return gather<W>(rows + field, base); }
  // Reads three columns at once; no colour is the last of a row.
  PRIMRAY_INLINE vvec3<W> color(int field) const {
    const FourLanes<float, W> c = gather_four<W>(rows + field, base);
    return {c.x, c.y, c.z};
  }
};

enum class InputField : int32_t {
  kDiffuseColor,
  kEmissiveColor,
  kSpecularColor,
  kMetallic,
  kRoughness,
  kClearcoat,
  kClearcoatRoughness,
  kOpacity,
  kIor,
  kNormal,   // has no value: it bends the shading normal
  kOpenPbr,  // the first of an OpenPBR surface's own inputs (open_pbr/inputs.hpp)
};

// Range to which an input is clamped, where the model is defined.
struct InputRange {
  float low = 0, high = 1;
};
constexpr InputRange kNotNegative{0, 1e30f}, kIors{0.01f, 100.0f};

// Names as in UsdPreviewSurface.
template <class Color, class Number>
struct VaryingInputs {
  Color diffuse_color, emissive_color, specular_color;
  Number metallic, roughness, clearcoat, clearcoat_roughness, opacity, ior;
};

// Calls f(field, name, range, member), where member(inputs) is that input of a VaryingInputs.
template <class F>
PRIMRAY_INLINE void for_each_input(const F& f) {
  constexpr InputRange unit;
  f(InputField::kDiffuseColor, "diffuse_color", unit, [](auto& v) -> auto& { return v.diffuse_color; });
  f(InputField::kEmissiveColor, "emissive_color", kNotNegative, [](auto& v) -> auto& { return v.emissive_color; });
  f(InputField::kSpecularColor, "specular_color", unit, [](auto& v) -> auto& { return v.specular_color; });
  f(InputField::kMetallic, "metallic", unit, [](auto& v) -> auto& { return v.metallic; });
  f(InputField::kRoughness, "roughness", unit, [](auto& v) -> auto& { return v.roughness; });
  f(InputField::kClearcoat, "clearcoat", unit, [](auto& v) -> auto& { return v.clearcoat; });
  f(InputField::kClearcoatRoughness, "clearcoat_roughness", unit, [](auto& v) -> auto& { return v.clearcoat_roughness; });
  f(InputField::kOpacity, "opacity", unit, [](auto& v) -> auto& { return v.opacity; });
  f(InputField::kIor, "ior", kIors, [](auto& v) -> auto& { return v.ior; });
}

}  // namespace primray
