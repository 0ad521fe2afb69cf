// Inputs of a hair fibre: one list, for constants, for lanes and for Python.
#pragma once

#include <string>
#include <string_view>
#include <type_traits>

#include "bsdf/open_pbr/inputs.hpp"

namespace primray {

// Tints and widths of light that is reflected (r), transmitted (tt), and internally reflected once (trt), as in MaterialX's
// chiang_hair_bsdf. Variances are of longitudinal angles, scales of the azimuthal logistic.
template <class Color, class Number>
struct HairInputs {
  Color absorption;  // over the distance of the fibre's radius
  Color tint_r, tint_tt, tint_trt;
  Number variance_r, variance_tt, variance_trt;
  Number scale_r, scale_tt, scale_trt;
  Number ior;
  Number cuticle_tilt;  // radians
};

// Defaults: a black fibre of Chiang et al. 2016 with both roughnesses 0.3 and scales tilted by 2 degrees.
struct HairInput : HairInputs<vec3, float> {
  HairInput()
      : HairInputs{.absorption{0, 0, 0},
                   .tint_r{1, 1, 1},
                   .tint_tt{1, 1, 1},
                   .tint_trt{1, 1, 1},
                   .variance_r = 0.0846f,
                   .variance_tt = 0.0212f,
                   .variance_trt = 0.338f,
                   .scale_r = 0.117f,
                   .scale_tt = 0.117f,
                   .scale_trt = 0.117f,
                   .ior = 1.55f,
                   .cuticle_tilt = 0.0349f} {}
};

// Calls f(name, range, member), where member(inputs) is that input of a HairInputs.
template <class F>
PRIMRAY_INLINE void for_each_hair_input(const F& f) {
  // Narrower lobes are below the precision of unit vectors in float; wider ones are uniform.
  constexpr InputRange unit, variances{1e-6f, 100}, scales{1e-3f, 100}, tilts{-1.5f, 1.5f}, iors{1, 100};
#define PRIMRAY_INPUT(name, range) f(#name, range, [](auto& v) -> auto& { return v.name; })
  PRIMRAY_INPUT(absorption, kNotNegative);
  PRIMRAY_INPUT(tint_r, unit);
  PRIMRAY_INPUT(tint_tt, unit);
  PRIMRAY_INPUT(tint_trt, unit);
  PRIMRAY_INPUT(variance_r, variances);
  PRIMRAY_INPUT(variance_tt, variances);
  PRIMRAY_INPUT(variance_trt, variances);
  PRIMRAY_INPUT(scale_r, scales);
  PRIMRAY_INPUT(scale_tt, scales);
  PRIMRAY_INPUT(scale_trt, scales);
  PRIMRAY_INPUT(ior, iors);
  PRIMRAY_INPUT(cuticle_tilt, tilts);
#undef PRIMRAY_INPUT
}

inline std::string hair_name(std::string_view name) { return "hair_" + std::string(name); }
// Fields of OpenPBR's inputs end before those of hair.
constexpr int32_t kFirstHairField = int32_t(InputField::kOpenPbr) + 64;
constexpr InputField hair_field(int k) { return InputField(kFirstHairField + k); }

// Inputs in lanes, all of one surface.
template <int W>
struct HairValues : HairInputs<vvec3<W>, vfloat<W>> {
  PRIMRAY_INLINE explicit HairValues(const HairInput& s) {
    for_each_hair_input([&](const char*, InputRange range, auto member) {
      auto& value = member(*this);
      value = std::remove_reference_t<decltype(value)>(member(s));
      keep(range, value);
    });
  }
  // Sets a value that varies: the first component of `x`, or all three; NaN becomes the lower bound.
  PRIMRAY_INLINE void set(InputField field, const vvec3<W>& x) {
    int k = 0;
    for_each_hair_input([&](const char*, InputRange range, auto member) {
      if (hair_field(k++) != field) return;
      auto& value = member(*this);
      if constexpr (std::is_same_v<decltype(value), vvec3<W>&>)
        value = x;
      else
        value = x.x;
      keep(range, value);
    });
  }

 private:
  PRIMRAY_INLINE static void keep(InputRange range, vfloat<W>& value) { value = clamp(value, range.low, range.high); }
  PRIMRAY_INLINE static void keep(InputRange range, vvec3<W>& value) {
    keep(range, value.x), keep(range, value.y), keep(range, value.z);
  }
};

}  // namespace primray
