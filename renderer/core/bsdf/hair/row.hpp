// Inputs of the hair BSDF (hair.hpp), one list for constants, for lanes and for Python, and the row of lobe parameters computed
// from them.
#pragma once

#include <string>
#include <string_view>
#include <type_traits>

#include "bsdf/basics/varying_inputs.hpp"
#include "bsdf/open_pbr/inputs.hpp"
#include "math/transcendental.hpp"

namespace primray {

// Tints and widths of the lobes of light that is reflected (r), transmitted (tt), and internally reflected once (trt), as in
// MaterialX's chiang_hair_bsdf. Variances are those of longitudinal angles, scales those of the azimuthal logistic.
template <class Color, class Number>
struct HairInputs {
  Color absorption;  // over the distance of the fibre's radius
  Color tint_r, tint_tt, tint_trt;
  Number variance_r, variance_tt, variance_trt;
  Number scale_r, scale_tt, scale_trt;
  Number ior;
  Number cuticle_tilt;  // radians
};

// Defaults: a colourless fibre of Chiang et al. 2016 with both roughnesses 0.3 and cuticle scales tilted by 2 degrees.
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
  // Lobes narrower than these are below the precision of float unit vectors; wider ones are uniform.
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
// Hair's fields come after those of OpenPBR's inputs.
constexpr int kMostOpenPbrFields = 64;
constexpr int32_t kFirstHairField = int32_t(InputField::kOpenPbr) + kMostOpenPbrFields;
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

constexpr int kHairLobes = 4;  // R, TT, TRT, and light internally reflected more than once

// Columns of a row; a colour has three, and none comes last.
enum HairField : int {
  kHairAbsorption,
  kHairTint = kHairAbsorption + 3,  // of three lobes; the last uses the third's
  kHairVariance = kHairTint + 9,    // of three lobes, as are scales
  kHairScale = kHairVariance + 3,
  kHairIor = kHairScale + 3,
  kHairTilt,  // sine and cosine for each lobe but the last
  kHairFields = kHairTilt + 2 * 3
};

// Computes the columns of W rows of one surface with inputs `v`. Cuticle scales tilt reflected light by 2 alpha towards the
// root (-x), transmitted light by alpha and internally reflected light by 4 alpha towards the tip (Marschner et al. 2003,
// Chiang et al. 2016).
template <int W>
PRIMRAY_INLINE void reduce_hair(const HairValues<W>& v, vfloat<W> (&row)[kHairFields]) {
  const auto put = [&](int field, const vvec3<W>& c) { row[field] = c.x, row[field + 1] = c.y, row[field + 2] = c.z; };
  put(kHairAbsorption, v.absorption);
  put(kHairTint, v.tint_r), put(kHairTint + 3, v.tint_tt), put(kHairTint + 6, v.tint_trt);
  put(kHairVariance, {v.variance_r, v.variance_tt, v.variance_trt});
  put(kHairScale, {v.scale_r, v.scale_tt, v.scale_trt});
  row[kHairIor] = v.ior;
  const float times[3] = {2, -1, -4};
  for (int k = 0; k < 3; ++k) {
    const SinCos<W> t = sincos_turns(v.cuticle_tilt * (times[k] * 0.5f * kInvPi));
    row[kHairTilt + 2 * k] = t.sin, row[kHairTilt + 2 * k + 1] = t.cos;
  }
}

template <int W>
using HairRows = LobeRows<W>;

}  // namespace primray
