// OpenPBR surface (OpenPBR 1.1.1) as a mixture of lobes in lanes: fuzz over coat over a base of metal, glass and opaque parts,
// following the specification's "Reduction to a mixture of lobes", with albedos that depend on the view direction alone.
//
// Directions are in a local frame whose +z is the shading normal on the side of wo, +x the tangent. f_cos = f |cos theta_i|;
// radiance along refracted paths is kept as L / n^2. Closed objects that let light in are seen from within as well: coat and
// fuzz only absorb there. Choices that the specification leaves open are in docs/decisions/surfaces/open-pbr.md.
#pragma once

#include "bsdf/basics/scattering.hpp"
#include "bsdf/open_pbr/albedos.hpp"
#include "bsdf/open_pbr/eon.hpp"
#include "bsdf/open_pbr/fresnel.hpp"
#include "bsdf/open_pbr/fuzz.hpp"
#include "bsdf/open_pbr/row.hpp"
#include "bsdf/open_pbr/thin_film.hpp"

namespace primray {

template <int W>
struct OpenPbr {
  using F = vfloat<W>;
  using B = vbool<W>;
  using V = vvec3<W>;

  B thin, within;  // within: seen from inside a closed object that lets light in
  // Parts of the base, each multiplied by the transmittance of the layers above and its own weights along wo.
  V diffuse, behind, metal_gain, specular_color, tint;
  F diffuse_part, opaque_part, glass_part, metal_part, glass_gain, eta, dispersion;
  Eon<W> eon;
  Facets<W> facets;
  MetalFresnel<W> metal;
  V metal_edge;
  B mirror, clear;  // clear: refraction is not blurred
  F film, film_thickness, film_ior, above;
  // Layers.
  F fuzz_left, coat, coat_left, coat_eta, coat_inverse;  // coat_inverse: 1 / cosine of the view direction within the coat
  V fuzz_color, coat_log, darkening;
  Fuzz<W> fuzz;
  Facets<W> coat_facets;
  // Probabilities of the lobes, and which lobes exist in some lane.
  F p_diffuse, p_behind, p_fuzz, p_specular, p_coat, p_transmit, p_enter;
  V enters;   // share of the light that enters below an opaque surface (interior.hpp)
  B matched;  // boundaries of interiors that do not reflect: light continues straight
  bool any_enters, any_rough_diffuse, any_behind, any_fuzz, any_rough, any_coat, any_glass, any_metal, any_film, any_dispersion,
      any_thin;

  // Surfaces in rows `row`, seen along wo (local) from the geometry's front or back, in lanes `m`. `beside`: index of
  // refraction outside of them; `deep`: lanes in which an opaque surface may be entered.
  OpenPbr(const OpenPbrRows<W>& row, B m, B thin_walls, const V& wo, B front, F beside = F(1.0f), B deep = B(false))
      : thin(thin_walls) {
    const F one(1.0f), zero(0.0f);
    const V white(one);
    const F metalness = row(kOpenMetalness), passes = row(kOpenTransmission);
    within = m & !front & !thin & (passes > zero);
    const auto has = [&](F weight) { return any(m & (weight > zero)); };
    any_glass = has(passes * (one - metalness)), any_metal = has(metalness), any_thin = any(m & thin);
    const F own = row(kOpenEta), roughness = row(kOpenRoughness), anisotropy = row(kOpenAnisotropy);
    const F ratio = own / (one + (beside - one) * (one - row(kOpenCoat)));
    const F outer = select(beside == one, own, select((ratio < one) & !(passes > zero), 1.0f / ratio, ratio));
    eta = select(within, 1.0f / outer, outer);
    const F alpha_t = row(kOpenAlphaT), alpha_b = row(kOpenAlphaB);
    mirror = m & (alpha_t == zero);
    any_rough = any(m & !mirror);
    clear = mirror | (m & !thin & (max(alpha_t, alpha_b) * abs(outer - one) < F(2 * kMinAlpha)));
    facets = Facets<W>(max(alpha_t, kMinAlpha), max(alpha_b, kMinAlpha), wo);
    matched = m & !thin & (passes > zero) & (outer == one) & clear;
    if (any(matched)) matched &= max_component(row.color(kOpenExtinction)) > zero;
    film = row(kOpenFilm);
    any_film = has(film);
    above = row(kOpenAbove);
    if (any_film) film_thickness = row(kOpenFilmThickness), film_ior = row(kOpenFilmIor);
    set_layers(row, m, wo);

    // Albedos of the base's reflection. From below the surface an opaque part looks as from above.
    denser = select(outer < one, 1.0f / outer, outer);
    F whole(one), cosine = wo.z, brushed(one), along = roughness;
    if (any_rough) {
      whole = select(mirror, one, whole_albedo(wo.z, roughness));
      if (has(anisotropy)) {
        along = roughness_along(facets, anisotropy, roughness);
        brushed = select(mirror | (anisotropy == zero), one, brushed_ratio(wo, roughness, anisotropy));
        whole = whole * brushed;
      }
      whole = min(whole, one);
      cosine = select(mirror, wo.z, brushed_cosine(facets, anisotropy, along, denser));
    }
    specular_color = select(within, white, row.color(kOpenSpecularColor));
    V reflected = V(dielectric_fresnel(cosine, denser)) * whole;
    if (any_film) reflected = select(film > zero, reflected * film_ratio(wo), reflected);
    const F dielectric_part = one - metalness;
    two_sided = any(within & (passes < one));
    opaque_part = dielectric_part * (one - passes), glass_part = dielectric_part * passes,
    metal_part = metalness * row(kOpenMetalWeight);
    V glass_reflects(zero);
    glass_gain = one, tint = white;
    if (any_glass) {
      tint = row.color(kOpenTint), dispersion = row(kOpenDispersion);
      any_dispersion = has(dispersion);
      if (any_rough) {
        // Anisotropic facets are approximated by isotropic ones with their roughness along the view direction.
        F lost = one - passing_albedo(wo.z, along, eta);
        if (has(anisotropy)) lost *= select(brushed == one, one, (one - whole) / max(one - whole_albedo(wo.z, along), 1e-4f));
        const F passed = one - lost;
        glass_gain = select(mirror | clear, one, 1.0f / max(select(thin, whole, passed), 0.05f));
      }
      F from_within = dielectric_fresnel(wo.z, eta);
      if (any_rough && any(within)) from_within = select(mirror, from_within, mean_reflectance(wo, eta));
      const V f = select(within, V(from_within), reflected);
      glass_reflects = select(thin, pane_reflects(f, tint), f);
    } else {
      dispersion = zero, any_dispersion = false;
    }
    V metal_albedo(zero);
    if (any_metal) {
      const V f0 = row.color(kOpenMetal);
      metal_edge = row.color(kOpenSpecularColor);
      metal = MetalFresnel<W>(f0, metal_edge);
      // Turquin 2019, "Practical Multiple Scattering Compensation for Microfacet Models", eq. 16.
      metal_gain = white + f0 * ((one - whole) / max(whole, 0.05f));
      metal_albedo = metal_reflects(cosine) * metal_part;
    }
    F below_weight = select(m & deep & front, row(kOpenSubsurface), zero);
    any_enters = has(below_weight * opaque_part);
    diffuse_part = opaque_part * row(kOpenDiffuseWeight);
    diffuse_left = white - V(min(reflected.x, one), min(reflected.y, one), min(reflected.z, one));
    diffuse = row.color(kOpenDiffuse), behind = row.color(kOpenBehind);
    if (any_enters) {
      const B aside = below_weight > zero;
      diffuse = select(aside, row.color(kOpenAside), diffuse);
      diffuse_part = select(aside, opaque_part * row(kOpenAsideWeight), diffuse_part);
    }
    const F diffuse_roughness = row(kOpenDiffuseRoughness);
    any_rough_diffuse = has(diffuse_roughness);
    if (any_rough_diffuse) eon = Eon<W>(diffuse_roughness, wo.z);
    any_behind = has(max_component(behind) * opaque_part);

    const V below = any_coat ? layers(2.0f * coat_inverse) : V(fuzz_left);
    const F w_diffuse = luminance(diffuse * diffuse_left * below) * diffuse_part,
            w_behind = luminance(behind * diffuse_left * below) * opaque_part;
    const V shiny = specular_color * (reflected * opaque_part + glass_reflects * glass_part) + metal_albedo;
    const F w_specular = luminance(shiny * select(within, white, below));
    const V through = select(thin, pane_transmits(dielectric(cosine, outer, above), tint), (white - glass_reflects) * tint);
    F w_transmit = any_glass ? luminance(through * below) * glass_part : zero;
    // Rough glass: albedos are approximate, and each lobe must be sampled.
    w_transmit = max(w_transmit, select(mirror, zero, 0.05f * luminance(tint * below) * glass_part));
    const F w_coat = any_coat ? coat_weight_ : zero, w_fuzz = any_fuzz ? luminance(fuzz_color) : zero;
    F w_enter(zero);
    enters = V(zero);
    if (any_enters) {
      // Light that enters crosses the coat here, and again where it leaves, approximated by a cosine of 2/3.
      const V across = any_coat ? layers(coat_inverse + inverse_within(F(2.0f / 3))) : below;
      enters = diffuse_left * across * (below_weight * opaque_part);
      w_enter = luminance(row.color(kOpenSubsurfaceColor) * enters);
    }
    const F total = w_diffuse + w_behind + w_specular + w_transmit + w_coat + w_fuzz + w_enter,
            scale = 1.0f / max(total, 1e-20f);
    p_diffuse = w_diffuse * scale, p_behind = w_behind * scale, p_fuzz = w_fuzz * scale;
    p_specular = w_specular * scale, p_coat = w_coat * scale, p_transmit = w_transmit * scale;
    p_enter = w_enter * scale;
  }

  // Evaluates all but the delta lobes.
  BsdfEval<W> eval(const V& wo, const V& wi) const {
    const F one(1.0f), zero(0.0f);
    const B seen = wo.z > zero, up = seen & (wi.z > zero), down = seen & (wi.z < zero);
    const F cosine = abs(wi.z);
    BsdfEval<W> r{V(zero), V(zero), zero};
    const V base = above_base(cosine);
    const F lambert = cosine * kInvPi, cos_up = select(up, cosine, zero), cos_down = select(down, cosine, zero);
    const V flipped{wi.x, wi.y, cosine};
    r.diffuse = diffuse_value(diffuse, wo, flipped) * diffuse_left * (diffuse_part * cos_up);
    r.pdf = p_diffuse * cos_up * kInvPi;
    if (any_behind) {
      r.diffuse += diffuse_value(behind, wo, flipped) * diffuse_left * (opaque_part * cos_down);
      r.pdf += p_behind * select(down, lambert, zero);
    }
    const V h = normalize(wo + flipped);
    const F facing = dot(wo, h);
    if (any_rough) {
      const B glossy = up & !mirror;
      const V f = reflects(facing) * (0.25f * facets.seen_both_ways(h, flipped));
      r.specular = select(glossy, f, r.specular);
      r.pdf += select(glossy, p_specular * facets.reflection_density(h), zero);
    }
    r.diffuse = r.diffuse * base, r.specular = r.specular * select(within, V(one), base);
    if (any_glass && any_rough && any(down)) add_transmission(wo, wi, down & !mirror & !clear, h, r);
    if (any_coat) {
      const B coated = up & !within & (coat > zero);
      const F f = coat * fuzz_left * dielectric_fresnel(facing, coat_eta) * 0.25f * coat_facets.seen_both_ways(h, flipped);
      r.specular += V(select(coated, f, zero));
      r.pdf += select(coated, p_coat * coat_facets.reflection_density(h), zero);
    }
    if (any_fuzz) {
      const F d = select(up, fuzz.density(wi), zero);
      r.diffuse += fuzz_color * d;
      r.pdf += p_fuzz * d;
    }
    return r;
  }

  BsdfSample<W> sample(const V& wo, F lobe, F u, F v) const {
    const F one(1.0f), zero(0.0f);
    const F at_behind = p_diffuse, at_fuzz = at_behind + p_behind, at_specular = at_fuzz + p_fuzz;
    const F at_coat = at_specular + p_specular, at_transmit = at_coat + p_coat;
    const B is_behind = (lobe >= at_behind) & (lobe < at_fuzz), is_fuzz = (lobe >= at_fuzz) & (lobe < at_specular);
    const B is_specular = (lobe >= at_specular) & (lobe < at_coat), is_coat = (lobe >= at_coat) & (lobe < at_transmit);
    B passes = lobe >= at_transmit, is_enter(false);
    if (any_enters) {
      is_enter = (lobe < at_transmit + p_enter) & passes & (p_enter > zero);
      passes &= !is_enter;
    }
    const F r = sqrt(u);
    const SinCos<W> phi = sincos_turns(v);
    V wi{r * phi.cos, r * phi.sin, sqrt(one - u)};
    wi.z = select(is_behind | is_enter, -wi.z, wi.z);
    if (any_fuzz) wi = select(is_fuzz, fuzz.sample(u, v), wi);
    const B pane = passes & thin, about = (is_specular | pane) & !mirror;
    if (any_rough && any(about)) {
      const V h = facets.sample(facets.cap(), u, v);
      const V w = h * (2.0f * dot(wo, h)) - wo;
      wi = select(about, V(w.x, w.y, select(pane, -w.z, w.z)), wi);
    }
    if (any_coat && any(is_coat)) {
      const V h = coat_facets.sample(coat_facets.cap(), u, v);
      wi = select(is_coat, h * (2.0f * dot(wo, h)) - wo, wi);
    }
    const B is_mirror = is_specular & mirror, is_clear = passes & clear;
    V channels(one);  // share of each channel that is refracted along wi
    if (any_glass && any(passes)) {
      F index = eta;
      if (any_dispersion) {
        const F third = clamp((lobe - at_transmit - p_enter) * (3.0f / max(p_transmit, 1e-12f)), 0.0f, 2.999f);
        const vint<W> k = truncate(third);
        const B disperses = dispersion > zero;
        index = select(disperses, index_of(channel_of(k)), eta);
        const auto only = [&](int c) { return select(disperses, select(k == vint<W>(c), F(3.0f), zero), one); };
        channels = {only(0), only(1), only(2)};
      }
      V h{zero, zero, one};
      if (any_rough) h = select(is_clear, h, facets.sample(one, u, v));
      const F cosine = dot(wo, h), ratio = 1.0f / index, cos2 = one - ratio * ratio * (one - cosine * cosine);
      const V w = h * (cosine * ratio - safe_sqrt(cos2)) - wo * ratio;
      const B gone = cos2 <= zero;  // total reflection: towards the horizon, from where no light comes
      wi = select(passes & !thin, select(gone, V(one, zero, zero), w), wi);
      channels = select(gone & !thin, V(zero), channels);
      wi = select(is_clear & thin, -wo, wi);
    }
    wi = select(is_mirror, V(-wo.x, -wo.y, wo.z), wi);
    BsdfEval<W> e = eval(wo, wi);
    // At a steep facet light may leave on the side where its lobe has no density: it is lost.
    const B down = passes | is_behind | is_enter, lost = (down & (wi.z >= zero)) | ((!down) & (wi.z <= zero));
    e.pdf = select(lost, zero, e.pdf);
    const V sum = e.diffuse + e.specular, tiny(F(1e-30f));
    V weight = select(e.pdf > zero, sum * (1.0f / max(e.pdf, 1e-30f)), V(zero));
    const B is_delta = is_mirror | is_clear | is_enter;
    if (any(is_delta)) {
      const V base = select(within, V(one), above_base(wo.z));
      weight = select(is_mirror, reflects(wo.z) * base * (1.0f / max(p_specular, 1e-20f)), weight);
      if (any(is_clear))
        weight = select(is_clear, clear_transmission(wo, wi) * channels * (1.0f / max(p_transmit, 1e-20f)), weight);
    }
    if (any_enters) weight = select(is_enter, enters * (1.0f / max(p_enter, 1e-20f)), weight);
    const V share{e.diffuse.x / max(sum.x, tiny.x), e.diffuse.y / max(sum.y, tiny.y), e.diffuse.z / max(sum.z, tiny.z)};
    BsdfSample<W> made{wi,
                       weight,
                       select(is_delta, zero, e.pdf),
                       is_delta,
                       down,
                       is_clear & (thin | matched),
                       select(is_delta, V(zero), share)};
    made.enters = is_enter;
    return made;
  }

  // Straight transmittance of thin walls without roughness, and of boundaries without reflection.
  PRIMRAY_INLINE V straight_transmittance(const V& wo) const {
    const V zero(F(0.0f));
    if (!any_glass || !(any_thin || any(matched))) return zero;
    return select((thin & mirror) | matched, clear_transmission(wo, -wo), zero);
  }

  // Returns the lanes in which directions below the surface receive light by non-delta lobes.
  PRIMRAY_INLINE B lets_through() const {
    B r(false);
    if (any_behind) r |= p_behind > F(0.0f);
    if (any_glass) r |= (glass_part > F(0.0f)) & !clear & !mirror;
    return r;
  }

 private:
  V diffuse_left;
  F coat_weight_, denser;
  bool two_sided;  // opaque parts are seen from within

  PRIMRAY_INLINE V diffuse_value(const V& albedo, const V& wo, const V& wi) const {
    const V lambert = albedo * F(kInvPi);
    return any_rough_diffuse ? select(eon.roughness > F(0.0f), eon(albedo, wo, wi), lambert) : lambert;
  }
  // Roughness along the view direction, in which facets lean towards the viewer.
  PRIMRAY_INLINE static F roughness_along(const Facets<W>& f, F anisotropy, F roughness) {
    const F side2 = f.wo.x * f.wo.x + f.wo.y * f.wo.y, x = f.alpha_t * f.wo.x, y = f.alpha_b * f.wo.y;
    const F along = sqrt(sqrt((x * x + y * y) / max(side2, 1e-12f)));
    return select((anisotropy > F(0.0f)) & (side2 > F(1e-12f)), along, roughness);
  }
  // fresnel_cosine() for facets that lean sideways by more or less than along the view direction. The factor is a fit:
  // reflectance is exact to 0.01 up to an anisotropy of 0.8, without it to 0.04.
  PRIMRAY_INLINE static F brushed_cosine(const Facets<W>& f, F anisotropy, F along, F index) {
    const F found = fresnel_cosine(f.wo.z, along, index), along2 = along * along * along * along;
    const F aside2 = f.alpha_t * f.alpha_t + f.alpha_b * f.alpha_b - along2;
    const F factor = sqrt((1.0f + 0.7f * along2) / (1.0f + 0.7f * max(aside2, 0.0f)));
    return select(anisotropy > F(0.0f), min(found * factor, 1.0f), found);
  }
  // Number of normals that represent all visible ones.
  static constexpr int kProbes = 8;
  PRIMRAY_INLINE F probe(const V& wo, int k) const {
    constexpr float kOther[kProbes] = {0.0625f, 0.5625f, 0.3125f, 0.8125f, 0.1875f, 0.6875f, 0.4375f, 0.9375f};
    return select(mirror, wo.z, dot(wo, facets.sample(F(1.0f), F((float(k) + 0.5f) / kProbes), F(kOther[k]))));
  }
  __attribute__((noinline)) F mean_reflectance(const V& wo, F index) const {
    F sum(0.0f);
    for (int k = 0; k < kProbes; ++k) sum += dielectric_fresnel(probe(wo, k), index);
    return sum * (1.0f / kProbes);
  }
  // Reflectance of the dielectric with its film, relative to that without.
  __attribute__((noinline)) V film_ratio(const V& wo) const {
    V with(F(0.0f));
    F without(0.0f);
    for (int k = 0; k < kProbes; ++k) {
      const F cosine = probe(wo, k);
      with += dielectric(cosine, denser, above), without += dielectric_fresnel(cosine, denser);
    }
    return with * (1.0f / max(without, 1e-9f));
  }

  PRIMRAY_INLINE void set_layers(const OpenPbrRows<W>& row, B m, const V& wo) {
    const F one(1.0f), zero(0.0f);
    const F fuzzy = select(within, zero, row(kOpenFuzz));
    any_fuzz = any(m & (fuzzy > zero));
    fuzz_left = one, fuzz_color = V(zero);
    if (any_fuzz) {
      fuzz = Fuzz<W>(wo, row(kOpenFuzzRoughness));
      fuzz_left = one - fuzzy * fuzz.reflected;
      fuzz_color = row.color(kOpenFuzzColor) * (fuzzy * fuzz.reflected);
    }
    const F weight = row(kOpenCoat);
    any_coat = any(m & (weight > zero));
    coat = zero, coat_left = one, coat_inverse = zero, coat_weight_ = zero;
    coat_log = V(zero), darkening = V(one);
    if (!any_coat) return;
    coat_eta = row(kOpenCoatEta), coat_log = row.color(kOpenCoatLog);
    const F roughness = row(kOpenCoatRoughness), anisotropy = row(kOpenCoatAnisotropy);
    coat_facets = Facets<W>(row(kOpenCoatAlphaT), row(kOpenCoatAlphaB), wo);
    const F index = select(coat_eta < one, 1.0f / coat_eta, coat_eta);
    const F along = roughness_along(coat_facets, anisotropy, roughness);
    F albedo = dielectric_fresnel(brushed_cosine(coat_facets, anisotropy, along, index), index) * whole_albedo(wo.z, roughness);
    if (any(m & (anisotropy > zero))) albedo *= select(anisotropy > zero, brushed_ratio(wo, roughness, anisotropy), one);
    albedo = min(albedo, one);
    coat = weight, coat_left = select(within, one, one - albedo);
    coat_inverse = inverse_within(wo.z);
    const F k_smooth = dielectric_fresnel(wo.z, index),
            k = k_smooth + (row(kOpenCoatInside) - k_smooth) * row(kOpenBaseRoughness);
    const V base = row.color(kOpenBaseAlbedo);
    const F amount = select(within, zero, row(kOpenCoatDarkening));
    const auto dark = [&](F b) { return one + ((one - k) / max(one - min(b, one) * k, 1e-6f) - one) * amount; };
    darkening = {dark(base.x), dark(base.y), dark(base.z)};
    coat_weight_ = select(within, zero, weight * fuzz_left * albedo);
  }
  // 1 / cosine, refracted into the coat.
  PRIMRAY_INLINE F inverse_within(F cosine) const {
    return 1.0f / sqrt(max(1.0f - (1.0f - cosine * cosine) / (coat_eta * coat_eta), 2.5e-3f));
  }
  // Transmittance of fuzz and coat for light of the base along a direction with that cosine.
  PRIMRAY_INLINE V above_base(F cosine) const {
    return any_coat ? layers(coat_inverse + inverse_within(cosine)) : V(fuzz_left);
  }
  // Transmittance of a path through the coat, `inverse` times its thickness long.
  PRIMRAY_INLINE V layers(F inverse) const {
    const F one(1.0f);
    const auto left = [&](F log, F dark) { return fuzz_left * dark * (one + (exp2(log * inverse) * coat_left - one) * coat); };
    return {left(coat_log.x, darkening.x), left(coat_log.y, darkening.y), left(coat_log.z, darkening.z)};
  }
  // Light that passes through the base crosses the coat once, on its outer side.
  PRIMRAY_INLINE V above_passing(F cosine) const {
    if (!any_coat) return V(fuzz_left);
    return layers(select(within, inverse_within(cosine), coat_inverse));
  }

  // Fresnel reflectance of the dielectric from a medium of index `before`, with its film.
  PRIMRAY_INLINE V dielectric(F cosine, F index, F before) const {
    V f(dielectric_fresnel(cosine, index));
    if (!any_film) return f;
    const ThinFilm<W> layer{before, film_ior, film_thickness};
    const V with = layer.reflectance(cosine, Complex<W>{before * index, F(0.0f)});
    return f + (with - f) * film;
  }
  // Fresnel reflectance of the visible base, each channel with its own index.
  PRIMRAY_INLINE V of_channels(F cosine) const {
    const V f = dielectric(cosine, eta, select(within, above / eta, above));
    if (!any_dispersion) return f;
    const auto channel = [&](int k) { return dielectric_fresnel(cosine, index_of(F(kCauchyCoordinate[k]))); };
    return select((dispersion > F(0.0f)) & !(film > F(0.0f)), V(channel(0), channel(1), channel(2)), f);
  }
  PRIMRAY_INLINE V metal_reflects(F cosine) const {
    const V f = metal(cosine);
    if (!any_film) return f;
    const ThinFilm<W> layer{above, film_ior, film_thickness};
    const auto channel = [&](F f0, F edge) { return layer.reflectance(cosine, metal_index(f0, edge) * above); };
    const V with{channel(metal.f0.x, metal_edge.x).x, channel(metal.f0.y, metal_edge.y).y, channel(metal.f0.z, metal_edge.z).z};
    return f + (with - f) * film;
  }
  // Reflectance of a pane of two interfaces that each reflect f, with transmittance t between them.
  PRIMRAY_INLINE static V pane_reflects(const V& f, const V& t) {
    const auto channel = [](F r, F a) { return r + (1.0f - r) * (1.0f - r) * a * a * r / max(1.0f - a * a * r * r, 1e-6f); };
    return {channel(f.x, t.x), channel(f.y, t.y), channel(f.z, t.z)};
  }
  PRIMRAY_INLINE static V pane_transmits(const V& f, const V& t) {
    const auto channel = [](F r, F a) { return (1.0f - r) * (1.0f - r) * a / max(1.0f - a * a * r * r, 1e-6f); };
    return {channel(f.x, t.x), channel(f.y, t.y), channel(f.z, t.z)};
  }

  // Reflectance of the whole base about a microfacet, over D G2 / (4 wo.z).
  PRIMRAY_INLINE V reflects(F cosine) const {
    const V f = of_channels(cosine);
    V r = (two_sided ? select(within, dielectric(cosine, denser, above), f) : f) * opaque_part;
    if (any_glass) r += (any_thin ? select(thin, pane_reflects(f, tint), f) : f) * (glass_part * glass_gain);
    r = r * specular_color;
    if (any_metal) r += metal_reflects(cosine) * metal_gain * metal_part;
    return r;
  }
  // Refraction about the shading normal itself, or transmission through thin walls, towards wi.
  PRIMRAY_INLINE V clear_transmission(const V& wo, const V& wi) const {
    const V white(F(1.0f)), f = of_channels(wo.z);
    const V through = any_thin ? select(thin, pane_transmits(f, tint), (white - f) * tint) : (white - f) * tint;
    return through * above_passing(abs(wi.z)) * glass_part;
  }

  // Index of refraction for a channel's wavelength.
  PRIMRAY_INLINE F index_of(F square) const {
    const F n = dispersed_index(select(within, 1.0f / eta, eta), dispersion, square);
    return select(within, 1.0f / n, n);
  }

  // Adds rough transmission towards wi below the surface in lanes `m`; `h`: half vector of wi's mirror image above it.
  __attribute__((noinline)) void add_transmission(const V& wo, const V& wi, B m, const V& h, BsdfEval<W>& r) const {
    const F zero(0.0f);
    m &= glass_part > zero;
    if (!any(m)) return;
    V f(zero);
    F pdf(zero);
    if (any_thin && any(m & thin)) {
      const V flipped{wi.x, wi.y, -wi.z};
      const V through = pane_transmits(dielectric(dot(wo, h), eta, above), tint);
      f = select(thin, through * (0.25f * facets.seen_both_ways(h, flipped)), f);
      pdf = select(thin, facets.reflection_density(h), pdf);
    }
    if (any(m & !thin)) {
      F density;
      V all = refracted(wo, wi, eta, density);
      if (any_dispersion) {
        const B disperses = dispersion > zero;
        V each(zero);
        F sum(zero);
        for (int k = 0; k < 3; ++k) {
          F one_pdf;
          const V of = refracted(wo, wi, index_of(F(kCauchyCoordinate[k])), one_pdf);
          (k == 0 ? each.x : k == 1 ? each.y : each.z) = k == 0 ? of.x : k == 1 ? of.y : of.z;
          sum += one_pdf * (1.0f / 3);
        }
        all = select(disperses, each, all), density = select(disperses, sum, density);
      }
      f = select(thin, f, all), pdf = select(thin, pdf, density);
    }
    const V over = above_passing(abs(wi.z));
    r.specular = select(m, f * over * (glass_part * glass_gain), r.specular);
    r.pdf += select(m, p_transmit * pdf, zero);
  }
  // f_cos of refraction by microfacets (Walter et al. 2007, eq. 21, for L / n^2), and its density.
  PRIMRAY_INLINE V refracted(const V& wo, const V& wi, F index, F& pdf) const {
    const F zero(0.0f);
    V h = wo + wi * index;
    const F size2 = dot(h, h);
    h = h * (copysign(F(1.0f), h.z) / sqrt(max(size2, 1e-20f)));
    const F out = dot(wo, h), in = dot(wi, h), sum = out + index * in;
    const B possible = (out > zero) & (in < zero) & (size2 > F(1e-12f));
    const F jacobian = index * index * abs(in) / max(sum * sum, 1e-12f);
    const V f = (V(F(1.0f)) - dielectric(out, index, select(within, above / index, above))) * tint;
    pdf = select(possible, facets.normal_density(h) * jacobian, zero);
    return select(possible, f * (facets.seen_both_ways(h, wi) * out * jacobian), V(zero));
  }
};

}  // namespace primray
