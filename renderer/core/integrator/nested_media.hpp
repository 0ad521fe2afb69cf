// Shading of surfaces in scenes with media: boundaries of nested dielectrics (medium/medium_stack.hpp), and opaque surfaces
// below which light walks (subsurface scattering).
#pragma once

#include <algorithm>

#include "integrator/shade_surface.hpp"
#include "surface/hit_group.hpp"

namespace primray {

// Mean free paths below a surface shorter than kLeastOffsets of its ray offsets are treated as zero: light leaves where it
// entered. Channels with a shorter one than kLeastSteps offsets are raised to that.
constexpr float kLeastOffsets = 64, kLeastSteps = 8;

// Walks that no pixel resolves: light leaves where it entered, with the walk's albedo, where
// - walks end so near to where they entered that a pixel does not tell: a mean distance along one axis of 1 / kPixelOfWalks of
//   the pixel's width. Of a step of light along the border between two pixels, half that share gets to the other one;
// - the body is thicker than kThickPaths (reduced) mean free paths: one of radius R is brighter than a half-space by a share of
//   1.5 mean free paths over R;
// - and thicker than kThickLengths diffusion lengths, so that no light gets through.
constexpr float kPixelOfWalks = 32, kThickPaths = 1000, kThickLengths = 20;
// Mean distance along one axis between where light enters a half-space of colour c and where it leaves, in reduced mean free
// paths: a bound to walks by a scalar program, kNearWalk - kFarWalk ln(1 - c).
constexpr float kNearWalk = 0.5f, kFarWalk = 0.74f;

// White Lambert lobes through which light leaves a subsurface medium.
template <int W>
struct WhiteLobes : Bsdf<W> {
  static constexpr bool kFollowsMedia = true, kEndsWalk = true;
  using Bsdf<W>::Bsdf;
};

// Exit of a subsurface random walk: lights are sampled and paths continue as from a white Lambert surface.
template <int W>
PRIMRAY_RARE void exit_subsurface(Round& round, vbool<W> lanes, const PathLanes<W>& p, SurfaceHit<W> surface,
                                  const MediumState<W>& state) {
  static const std::vector<float> white = [] {
    SurfaceTable table;
    SurfaceInput lambert;
    lambert.diffuse_color = vec3(1.0f);
    table.add(lambert);
    return table.rows;
  }();
  const MediumInterface<W> media{{state.stack, {}, {}, state.volumes}, Boundary<W>(state.stack), {}};
  // Treat the path as if it had arrived from outside, along the normal.
  const vvec3<W> n = surface.it.ns;
  surface.rows = SurfaceRows<W>(white.data());
  surface.it.color = vvec3<W>(vfloat<W>(1.0f));
  surface.front = vbool<W>(true), surface.ng = surface.it.ng, surface.frame = Frame<vfloat<W>>(n);
  PathLanes<W> outside = p;
  outside.ray.d = -n;
  shade_surface<WhiteLobes<W>>(round, lanes, outside, surface, &media);
}

// Medium below opaque surfaces of lanes `deep`, which OpenPBR's rows describe. `enterable`: lanes that light may enter.
template <int W>
struct SubsurfaceMedium {
  Medium<W> medium;
  vbool<W> enterable;

  PRIMRAY_INLINE SubsurfaceMedium(const Scene& scene, vbool<W> deep, const OpenPbrRows<W>& row, vfloat<W> offset)
      : enterable(deep) {
    using F = vfloat<W>;
    using V = vvec3<W>;
    if (!any(deep)) return;
    // Shorter steps would be lost in the rounding of their start.
    const F most = 1.0f / (kLeastSteps * max(offset, 1e-30f));
    const V extinction = row.color(kOpenSubsurfaceExtinction) * scene.interiors.per_length;
    const V capped{min(extinction.x, most), min(extinction.y, most), min(extinction.z, most)};
    medium.extinction = select(deep, capped, V(F(0.0f)));
    medium.scattering = medium.extinction * row.color(kOpenSubsurfaceAlbedo);
    medium.phase = row(kOpenSubsurfacePhase);
    enterable &= min(min(extinction.x, extinction.y), extinction.z) * offset * kLeastOffsets < F(1.0f);
  }
};

// Width of a pixel where paths hit a surface; 0 where it is not known: a mirror or a lens may magnify what it shows. After a
// rough lobe the ray cone is a sixteenth as wide as the lobe, and never narrower than a pixel.
template <int W>
PRIMRAY_INLINE vfloat<W> pixel_width(const PathLanes<W>& p, vfloat<W> t) {
  const vbool<W> known = (p.depth == vint<W>(0)) | (p.bsdf_pdf > vfloat<W>(0.0f));
  return select(known, (p.cone_width + p.cone_spread * t) * (1.0f / kConePixels), vfloat<W>(0.0f));
}

// Returns the lanes of `m` whose walk below the surface no pixel resolves.
template <int W>
PRIMRAY_RARE vbool<W> is_walk_unseen(Round& round, vbool<W> m, const PathLanes<W>& p, const SurfaceHit<W>& surface,
                                     const OpenPbrRows<W>& row, const Medium<W>& below) {
  using F = vfloat<W>;
  using V = vvec3<W>;
  const F g = below.phase, width = pixel_width(p, surface.hits.t);
  // Walks leave as a Lambert surface below no coat.
  m &= (g >= F(0.0f)) & (g <= F(kMostFittedPhase)) & (row(kOpenDiffuseRoughness) <= F(0.0f)) & (row(kOpenCoat) <= F(0.0f));
  const V color = row.color(kOpenSubsurfaceColor);
  F walked(0.0f), thickness(0.0f);
  const auto channel = [&](F extinction, F scattering, F c) {
    const F reduced = max(extinction - g * scattering, 1e-30f), absorbed = max(extinction - scattering, 1e-30f);
    walked = max(walked, (kNearWalk - kFarWalk * 0.693147181f * log2<W>(max(1.0f - c, 1e-6f))) / reduced);
    thickness = max(thickness, max(kThickPaths / reduced, kThickLengths / sqrt(3.0f * absorbed * reduced)));
  };
  channel(below.extinction.x, below.scattering.x, color.x);
  channel(below.extinction.y, below.scattering.y, color.y);
  channel(below.extinction.z, below.scattering.z, color.z);
  m &= walked * kPixelOfWalks <= width;
  if (!any(m)) return m;

  // Measure the body's thickness along the normal
  const Rays<W> inwards{surface.it.p - surface.ng * surface.it.offset, -surface.ng, F(0.0f), thickness, p.ray.time};
  if (round.recorder) round.recorder->record(false, false, m, inwards);
  round.worker.scattered_rays += __builtin_popcount(bits(m));
  m &= intersect(round.scene, false, m, inwards).geom == vint<W>(-1);
  if (const vbool<W> seen = m & (p.depth == vint<W>(0)); any(seen)) {
    const vbool<W> on_mesh = HitGroup<W>(round.scene, seen, surface.hits).is_triangle(round.scene, seen);
    const vint<W> shape = select(on_mesh, surface.it.mesh, vint<W>(-2) - surface.it.curved);
    for (uint32_t b = bits(seen); b; b &= b - 1) {
      const int i = __builtin_ctz(b);
      float& longest = round.worker.unseen_walks[shape[i]];
      longest = std::max(longest, walked[i] / width[i]);
    }
  }
  return m;
}

// Shades hits in scenes with media, for the paths from `at` on in the pool; `hit` are the lanes that hit a surface.
template <int W>
PRIMRAY_RARE void shade_in_media(Round& round, int at, vbool<W> hit, vbool<W> scatters, PathLanes<W> p,
                                 SurfaceHit<W>& surface) {
  using F = vfloat<W>;
  const Scene& scene = round.scene;
  const SurfaceRows<W>& rows = surface.rows;
  const Interaction<W>& it = surface.it;
  MediumState<W> state = round.worker.medium_states->pool->template at<W>(at);

  // Find the surfaces that bound a subsurface medium, and the paths that leave it
  const vbool<W> is_open = hit & ((rows.flags() & vint<W>(kOpenPbr)) != vint<W>(0));
  const OpenPbrRows<W> row = rows.open_pbr_rows(is_open);
  const vbool<W> deep = is_open & (row(kOpenSubsurface) > F(0.0f)), in_subsurface = state.in_subsurface();
  const vbool<W> leaves = deep & in_subsurface & !surface.front & (p.depth < vint<W>(round.settings.max_depth));
  // A random walk that hits a front face has left unnoticed.
  scatters &= !(in_subsurface & deep);

  // Find the media on both sides of the boundary
  SubsurfaceMedium<W> below(scene, deep, row, it.offset);
  if (const vbool<W> m = scatters & below.enterable & surface.front & !in_subsurface; any(m))
    below.enterable &= !is_walk_unseen(round, m, p, surface, row, below.medium);
  const MediumInterface<W> media{state, Boundary<W>(scene, scatters, state.stack, it.surface, surface.front), below.medium};
  const Boundary<W>& b = media.boundary;
  if (const vbool<W> m = b.missed & !in_subsurface & (state.stack.top() < vint<W>(0)); any(m))
    p.beta = select(m, p.beta * medium_of(scene, b.here).transmittance(surface.hits.t + state.origin_distance), p.beta);

  // Shade by kind of boundary
  align_tangent(rows, scatters, surface.frame);
  const bool hairy = !scene.surfaces.hair.empty();
  if (hairy) align_fibre(rows, scatters & it.on_curve, it.tangent, surface.frame);
  const vbool<W> kinds[3] = {leaves, b.overridden, scatters & !b.overridden};
  for_kinds(round.has_parts(), kinds, [&](int kind, vbool<W> lanes) {
    if (kind == 0) return exit_subsurface(round, lanes, p, surface, state);
    if (kind == 1) {
      if (PathLog* const log = path_log<W>(round))
        log->add("pass", p).why = "a medium of higher priority overrides the boundary";
      const MediumState<W> beyond{b.beyond, state.subsurface, origin_distance_of(it.offset, surface.ng, p.ray.d),
                                  state.volumes};
      return continue_straight(round, lanes, p, surface, &beyond);
    }
    if (hairy) return shade_surface<BsdfWithHair<W>>(round, lanes, p, surface, &media, b.ior_outside, below.enterable);
    shade_surface<BsdfWithOpenPbr<W>>(round, lanes, p, surface, &media, b.ior_outside, below.enterable);
  });
}

}  // namespace primray
