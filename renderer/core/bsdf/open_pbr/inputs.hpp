// Inputs of an OpenPBR surface, with the names of its specification (OpenPBR 1.1.1): one list, for constants, for lanes and for
// Python.
//
// Lengths are in world units. A surface also has its emission (below coat and fuzz), its opacity, its normal and whether it is
// thin-walled, like all surfaces. `coat_roughening` is an extension: the share of the coat's roughness that the base takes on
// (specification: all of it).
#pragma once

#include <string>
#include <string_view>
#include <type_traits>

#include "bsdf/basics/varying_inputs.hpp"

namespace primray {

template <class Color, class Number>
struct OpenPbrInputs {
  Number base_weight;
  Color base_color;
  Number base_diffuse_roughness, base_metalness;
  Number specular_weight;
  Color specular_color;
  Number specular_roughness, specular_roughness_anisotropy, specular_ior;
  Number transmission_weight;
  Color transmission_color;  // of one pass, or over the distance transmission_depth through the interior
  Number transmission_depth;
  Color transmission_scatter;
  Number transmission_scatter_anisotropy;
  Number transmission_dispersion_scale, transmission_dispersion_abbe_number;
  Number subsurface_weight;
  Color subsurface_color;
  Number subsurface_radius;
  Color subsurface_radius_scale;
  Number subsurface_scatter_anisotropy;
  Number fuzz_weight;
  Color fuzz_color;
  Number fuzz_roughness;
  Number coat_weight;
  Color coat_color;
  Number coat_roughness, coat_roughness_anisotropy, coat_ior, coat_darkening, coat_roughening;
  Number thin_film_weight, thin_film_thickness, thin_film_ior;  // thickness in micrometres
  Color tangent;                                                // in world space; 0: any
};

// Defaults of the specification.
struct OpenPbrInput : OpenPbrInputs<vec3, float> {
  OpenPbrInput()
      : OpenPbrInputs{.base_weight = 1,
                      .base_color{0.8f, 0.8f, 0.8f},
                      .base_diffuse_roughness = 0,
                      .base_metalness = 0,
                      .specular_weight = 1,
                      .specular_color{1, 1, 1},
                      .specular_roughness = 0.3f,
                      .specular_roughness_anisotropy = 0,
                      .specular_ior = 1.5f,
                      .transmission_weight = 0,
                      .transmission_color{1, 1, 1},
                      .transmission_depth = 0,
                      .transmission_scatter{0, 0, 0},
                      .transmission_scatter_anisotropy = 0,
                      .transmission_dispersion_scale = 0,
                      .transmission_dispersion_abbe_number = 20,
                      .subsurface_weight = 0,
                      .subsurface_color{0.8f, 0.8f, 0.8f},
                      .subsurface_radius = 1,
                      .subsurface_radius_scale{1, 0.5f, 0.25f},
                      .subsurface_scatter_anisotropy = 0,
                      .fuzz_weight = 0,
                      .fuzz_color{1, 1, 1},
                      .fuzz_roughness = 0.5f,
                      .coat_weight = 0,
                      .coat_color{1, 1, 1},
                      .coat_roughness = 0,
                      .coat_roughness_anisotropy = 0,
                      .coat_ior = 1.6f,
                      .coat_darkening = 1,
                      .coat_roughening = 1,
                      .thin_film_weight = 0,
                      .thin_film_thickness = 0.5f,
                      .thin_film_ior = 1.4f,
                      .tangent{0, 0, 0}} {}
};

// Calls f(name, range, member), where member(inputs) is that input of an OpenPbrInputs.
template <class F>
PRIMRAY_INLINE void for_each_open_pbr_input(const F& f) {
  constexpr InputRange unit, any{-1e30f, 1e30f}, weights{0, 100}, signed_unit{-1, 1}, films{0, 1000};
#define PRIMRAY_INPUT(name, range) f(#name, range, [](auto& v) -> auto& { return v.name; })
  PRIMRAY_INPUT(base_weight, unit);
  PRIMRAY_INPUT(base_color, unit);
  PRIMRAY_INPUT(base_diffuse_roughness, unit);
  PRIMRAY_INPUT(base_metalness, unit);
  PRIMRAY_INPUT(specular_weight, weights);
  PRIMRAY_INPUT(specular_color, unit);
  PRIMRAY_INPUT(specular_roughness, unit);
  PRIMRAY_INPUT(specular_roughness_anisotropy, unit);
  PRIMRAY_INPUT(specular_ior, kIors);
  PRIMRAY_INPUT(transmission_weight, unit);
  PRIMRAY_INPUT(transmission_color, unit);
  PRIMRAY_INPUT(transmission_depth, kNotNegative);
  PRIMRAY_INPUT(transmission_scatter, kNotNegative);
  PRIMRAY_INPUT(transmission_scatter_anisotropy, signed_unit);
  PRIMRAY_INPUT(transmission_dispersion_scale, unit);
  PRIMRAY_INPUT(transmission_dispersion_abbe_number, kNotNegative);
  PRIMRAY_INPUT(subsurface_weight, unit);
  PRIMRAY_INPUT(subsurface_color, unit);
  PRIMRAY_INPUT(subsurface_radius, kNotNegative);
  PRIMRAY_INPUT(subsurface_radius_scale, kNotNegative);
  PRIMRAY_INPUT(subsurface_scatter_anisotropy, signed_unit);
  PRIMRAY_INPUT(fuzz_weight, unit);
  PRIMRAY_INPUT(fuzz_color, unit);
  PRIMRAY_INPUT(fuzz_roughness, unit);
  PRIMRAY_INPUT(coat_weight, unit);
  PRIMRAY_INPUT(coat_color, unit);
  PRIMRAY_INPUT(coat_roughness, unit);
  PRIMRAY_INPUT(coat_roughness_anisotropy, unit);
  PRIMRAY_INPUT(coat_ior, kIors);
  PRIMRAY_INPUT(coat_darkening, unit);
  PRIMRAY_INPUT(coat_roughening, unit);
  PRIMRAY_INPUT(thin_film_weight, unit);
  PRIMRAY_INPUT(thin_film_thickness, films);
  PRIMRAY_INPUT(thin_film_ior, kIors);
  PRIMRAY_INPUT(tangent, any);
#undef PRIMRAY_INPUT
}

// Python's name for an input of that list: the tangent is a field beside the normal.
inline std::string open_pbr_name(std::string_view name) {
  return name == "tangent" ? std::string(name) : "open_pbr_" + std::string(name);
}
// Field of the k-th input of that list, by which varying inputs name their target.
constexpr InputField open_pbr_field(int k) { return InputField(int32_t(InputField::kOpenPbr) + k); }

// Inputs in lanes, all of one surface.
template <int W>
struct OpenPbrValues : OpenPbrInputs<vvec3<W>, vfloat<W>> {
  PRIMRAY_INLINE explicit OpenPbrValues(const OpenPbrInput& s) {
    for_each_open_pbr_input([&](const char*, InputRange range, auto member) {
      auto& value = member(*this);
      value = std::remove_reference_t<decltype(value)>(member(s));
      set(range, value, value);
    });
  }
  // Sets a value that varies: the first component of `x`, or all three; NaN becomes the lower bound.
  PRIMRAY_INLINE void set(InputField field, const vvec3<W>& x) {
    int k = 0;
    for_each_open_pbr_input([&](const char*, InputRange range, auto member) {
      if (open_pbr_field(k++) != field) return;
      auto& value = member(*this);
      if constexpr (std::is_same_v<decltype(value), vvec3<W>&>)
        set(range, x, value);
      else
        set(range, x.x, value);
    });
  }

 private:
  PRIMRAY_INLINE static void set(InputRange range, vfloat<W> x, vfloat<W>& value) { value = clamp(x, range.low, range.high); }
  PRIMRAY_INLINE static void set(InputRange range, const vvec3<W>& x, vvec3<W>& value) {
    value = {clamp(x.x, range.low, range.high), clamp(x.y, range.low, range.high), clamp(x.z, range.low, range.high)};
  }
};

}  // namespace primray
