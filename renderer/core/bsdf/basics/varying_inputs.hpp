// Inputs of a surface that may vary over it: one list, for constants, for lanes and for Python.
#pragma once

#include <cstdint>

#include "math/vec3.hpp"

namespace primray {

// Rows of W lanes in a table of lobe parameters. Hits are sorted by surface, so most packets have one row, whose values are
// broadcast: gathers would cost many times as much. What evaluate_inputs() writes is stored by column.
template <int W>
class LobeRows {
 public:
  // Rows that begin at `base`, in all lanes.
  PRIMRAY_INLINE LobeRows(const float* table, vint<W> base) : rows_(table), base_(base), layout_(kRows) {}
  // Rows number `row` of a table with so many fields. Lanes other than those of `m` may have any row of these.
  PRIMRAY_INLINE LobeRows(const float* table, vbool<W> m, vint<W> row, int fields)
      : rows_(table), base_(row * vint<W>(fields)), layout_(kRows) {
    const uint32_t lanes = bits(m);
    const int first = lanes ? row[__builtin_ctz(lanes)] : 0;
    if (any(m & (row != vint<W>(first)))) return;
    rows_ = table + first * fields, layout_ = kOneRow;
  }
  // W values of each field, one after the other.
  PRIMRAY_INLINE static LobeRows by_column(const float* columns) {
    LobeRows r(columns, vint<W>(0));
    r.layout_ = kColumns;
    return r;
  }

  PRIMRAY_INLINE vfloat<W> operator()(int field) const {
    if (layout_ == kOneRow) return vfloat<W>(rows_[field]);
    if (layout_ == kColumns) return load<W>(rows_ + field * W);
    return gather<W>(rows_ + field, base_);
  }
  // Reads three columns at once; no colour is the last of a row.
  PRIMRAY_INLINE vvec3<W> color(int field) const {
    if (layout_ != kRows) return {(*this)(field), (*this)(field + 1), (*this)(field + 2)};
    const FourLanes<float, W> c = gather_four<W>(rows_ + field, base_);
    return {c.x, c.y, c.z};
  }
  PRIMRAY_INLINE bool is_by_column() const { return layout_ == kColumns; }

 private:
  enum Layout { kRows, kOneRow, kColumns };
  const float* rows_;
  vint<W> base_;
  Layout layout_;
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
