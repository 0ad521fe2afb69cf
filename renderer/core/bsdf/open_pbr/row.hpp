// Row of lobe parameters of an OpenPBR surface.
#pragma once

#include "bsdf/basics/varying_inputs.hpp"
#include "bsdf/open_pbr/fresnel.hpp"
#include "bsdf/open_pbr/inputs.hpp"
#include "bsdf/open_pbr/interior.hpp"
#include "bsdf/open_pbr/microfacets.hpp"
#include "bsdf/open_pbr/tables.hpp"

namespace primray {

// Smallest width that is not a mirror: below it the float half vector is too coarse for the lobe's peak (alpha 1e-4 is
// roughness 0.01).
constexpr float kMinAlpha = 1e-4f;

// Columns of a row; colours have three.
enum OpenPbrField : int {
  kOpenDiffuse,                         // albedo of the diffuse reflection, before its weight
  kOpenBehind = kOpenDiffuse + 3,       // of the diffuse transmission of thin walls
  kOpenMetal = kOpenBehind + 3,         // F0 of the metal
  kOpenSpecularColor = kOpenMetal + 3,  // of the dielectric's reflection, and edge tint of the metal's
  kOpenTint = kOpenSpecularColor + 3,   // transmittance of one pass through a translucent base
  kOpenFuzzColor = kOpenTint + 3,       //
  kOpenCoatLog = kOpenFuzzColor + 3,    // log2 of the transmittance of one pass through the coat at normal incidence
  kOpenBaseAlbedo = kOpenCoatLog + 3,   // albedo below the coat at normal incidence
  kOpenTangent = kOpenBaseAlbedo + 3,   // 0: any
  // Interior of a closed object, per world unit of length (interior.hpp): of transmission, and of subsurface scattering below
  // an opaque surface.
  kOpenExtinction = kOpenTangent + 3,
  kOpenScattering = kOpenExtinction + 3,
  kOpenSubsurfaceExtinction = kOpenScattering + 3,
  kOpenSubsurfaceAlbedo = kOpenSubsurfaceExtinction + 3,  // single-scattering albedo
  kOpenSubsurfaceColor = kOpenSubsurfaceAlbedo + 3,       // of all that leaves
  kOpenAside = kOpenSubsurfaceColor + 3,                  // albedo of the diffuse reflection beside that
  kOpenDiffuseWeight = kOpenAside + 3,                    // with kOpenDiffuse
  kOpenDiffuseRoughness,                                  //
  kOpenMetalness,
  kOpenMetalWeight,   //
  kOpenTransmission,  //
  kOpenEta,           // of the base, relative to what is above it
  kOpenDispersion,    // n_F - n_C over n_d - 1, the inverse of Abbe's number
  kOpenAlphaT,
  kOpenAlphaB,  // 0: a mirror
  kOpenRoughness,
  kOpenAnisotropy,  //
  kOpenFuzz,
  kOpenFuzzRoughness,  //
  kOpenCoat,
  kOpenCoatEta,  //
  kOpenCoatAlphaT,
  kOpenCoatAlphaB,  //
  kOpenCoatRoughness,
  kOpenCoatAnisotropy,  //
  kOpenCoatDarkening,   // weight of it
  kOpenCoatInside,      // K_r
  kOpenBaseRoughness,   // r_b of the specification
  kOpenFilm,
  kOpenFilmThickness,
  kOpenFilmIor,     //
  kOpenAbove,       // index of what is above the base
  kOpenPhase,       // phase function in the interior (medium/phase_function.hpp)
  kOpenSubsurface,  // weight of subsurface scattering; 0 if the surface is thin-walled or has no depth
  kOpenSubsurfacePhase,
  kOpenAsideWeight,
  kOpenPbrFields
};

// Computes the columns of W rows of one surface with inputs `v`.
template <int W>
PRIMRAY_INLINE void reduce_open_pbr(const OpenPbrValues<W>& v, bool thin, vfloat<W> (&row)[kOpenPbrFields]) {
  using F = vfloat<W>;
  using V = vvec3<W>;
  const F one(1.0f), zero(0.0f);
  const auto lerp = [](auto a, auto b, F t) { return a + (b - a) * t; };
  const auto put = [&](int field, const V& c) { row[field] = c.x, row[field + 1] = c.y, row[field + 2] = c.z; };
  const F s = v.subsurface_weight, g = v.subsurface_scatter_anisotropy;
  const Interior<W> under = subsurface_interior(v);
  // The weight is separate, as in the specification, where only that part is diffuse.
  const vbool<W> mixed = s > zero, walks = mixed & under.exists() & !vbool<W>(thin);
  // Where light does not enter (interior.hpp), subsurface light leaves where it entered, with its colour.
  const V base = v.base_color;
  V below = v.subsurface_color * (thin ? 0.5f * (1.0f - g) : one);
  if (any(walks)) below = select(walks, walk_albedo(v), below);
  put(kOpenDiffuse, select(mixed, lerp(base * v.base_weight, below, s), base));
  row[kOpenDiffuseWeight] = select(mixed, one, v.base_weight);
  put(kOpenBehind, thin ? v.subsurface_color * (0.5f * (1.0f + g) * s) : V(zero));
  row[kOpenDiffuseRoughness] = v.base_diffuse_roughness;
  const V metal = base * v.base_weight;
  put(kOpenMetal, metal), put(kOpenSpecularColor, v.specular_color);
  row[kOpenMetalness] = v.base_metalness, row[kOpenMetalWeight] = min(v.specular_weight, one);
  const Interior<W> inside = thin ? Interior<W>{} : transmission_interior(v);
  put(kOpenExtinction, inside.extinction), put(kOpenScattering, inside.scattering), row[kOpenPhase] = inside.phase;
  row[kOpenTransmission] = v.transmission_weight;
  put(kOpenTint, select((v.transmission_depth > zero) & !vbool<W>(thin), V(one), v.transmission_color));
  row[kOpenSubsurface] = select(walks, s, zero), row[kOpenSubsurfacePhase] = under.phase;
  put(kOpenSubsurfaceExtinction, under.extinction), put(kOpenSubsurfaceAlbedo, under.scattering),
      put(kOpenSubsurfaceColor, v.subsurface_color);
  put(kOpenAside, base), row[kOpenAsideWeight] = v.base_weight * (one - s);
  const F abbe = max(v.transmission_dispersion_abbe_number, 1.0f);
  row[kOpenDispersion] = thin ? zero : v.transmission_dispersion_scale / abbe;

  // "Coat": index of the base relative to it, inverted where all light would be reflected; "Dielectric base": its weight.
  const F c = v.coat_weight, beside = v.specular_ior / v.coat_ior;
  const F ratio = lerp(v.specular_ior, select(beside < one, 1.0f / beside, beside), c);
  const F f = (ratio - 1.0f) / (ratio + 1.0f), f0 = min(v.specular_weight * f * f, 0.98f);
  const F e = copysign(sqrt(f0), f);
  const F eta = (1.0f + e) / (1.0f - e);
  // An opaque dielectric reflects as if it were the denser side, without total reflection.
  row[kOpenEta] = select((eta < one) & !(v.transmission_weight > zero), 1.0f / eta, eta);
  row[kOpenAbove] = lerp(one, v.coat_ior, c);

  const F coat4 = v.coat_roughness * v.coat_roughness * v.coat_roughness * v.coat_roughness;
  const F r2 = v.specular_roughness * v.specular_roughness;
  const F rougher = sqrt(sqrt(min(r2 * r2 + 2.0f * coat4, 1.0f)));
  const F r = select(coat4 > zero, lerp(v.specular_roughness, rougher, c * v.coat_roughening), v.specular_roughness);
  const F alpha = r * r, anisotropy = min(v.specular_roughness_anisotropy, kMostAnisotropy);
  const Widths<W> widths = widths_of(alpha, anisotropy);
  const vbool<W> mirror = alpha < F(kMinAlpha);
  row[kOpenAlphaT] = select(mirror, zero, max(widths.t, kMinAlpha));
  row[kOpenAlphaB] = select(mirror, zero, max(widths.b, kMinAlpha));
  row[kOpenRoughness] = r, row[kOpenAnisotropy] = anisotropy;
  put(kOpenTangent, v.tangent);

  row[kOpenFuzz] = v.fuzz_weight, put(kOpenFuzzColor, v.fuzz_color), row[kOpenFuzzRoughness] = v.fuzz_roughness;

  row[kOpenCoat] = c, row[kOpenCoatEta] = v.coat_ior;
  const F coat_anisotropy = min(v.coat_roughness_anisotropy, kMostAnisotropy);
  // A delta coat would need a second mirror lobe; kMinAlpha looks the same.
  const Widths<W> coat = widths_of(max(v.coat_roughness * v.coat_roughness, kMinAlpha), coat_anisotropy);
  row[kOpenCoatAlphaT] = max(coat.t, kMinAlpha), row[kOpenCoatAlphaB] = max(coat.b, kMinAlpha);
  row[kOpenCoatRoughness] = max(v.coat_roughness, 0.01f), row[kOpenCoatAnisotropy] = coat_anisotropy;
  const auto log_of = [&](F x) { return 0.5f * log2_cosine(max(x, 1e-6f), (1.0f - x) * (1.0f + x)); };
  put(kOpenCoatLog, {log_of(v.coat_color.x), log_of(v.coat_color.y), log_of(v.coat_color.z)});
  row[kOpenCoatDarkening] = c * v.coat_darkening;
  row[kOpenCoatInside] = internal_reflection(v.coat_ior);
  const F rough_dielectric = lerp(one, v.specular_roughness, f0);
  row[kOpenBaseRoughness] = lerp(rough_dielectric, v.specular_roughness, v.base_metalness);
  const V diffuse = lerp(base * v.base_weight, v.subsurface_color, s);
  const V dielectric = v.specular_color * f0 + lerp(diffuse, v.transmission_color, v.transmission_weight) * (1.0f - f0);
  put(kOpenBaseAlbedo, lerp(dielectric, metal * row[kOpenMetalWeight], v.base_metalness));

  row[kOpenFilm] = select(v.thin_film_thickness > zero, v.thin_film_weight, zero);
  row[kOpenFilmThickness] = v.thin_film_thickness, row[kOpenFilmIor] = v.thin_film_ior;
}

template <int W>
using OpenPbrRows = LobeRows<W>;

}  // namespace primray
