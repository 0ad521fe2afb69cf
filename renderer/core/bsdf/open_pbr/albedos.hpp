// Directional albedos of OpenPBR's GGX lobes, interpolated in tables (tables.hpp) for W lanes.
#pragma once

#include "bsdf/basics/albedo.hpp"
#include "bsdf/open_pbr/tables.hpp"

namespace primray {

// Position x, in nodes, on a table's axis of `count` nodes: the node before it, and the fraction of the way to the next.
template <int W>
struct NodePlace {
  vint<W> first;
  vfloat<W> part;
  PRIMRAY_INLINE NodePlace(vfloat<W> x, int count) {
    const vfloat<W> clamped = clamp(x, 0.0f, float(count - 1));
    first = min(truncate(clamped), count - 2), part = clamped - to_float(first);
  }
};

template <int W>
PRIMRAY_INLINE vfloat<W> between(vfloat<W> a, vfloat<W> b, vfloat<W> part) {
  return a + (b - a) * part;
}

// Coordinates on the axes that make_tables.py defines.
template <int W>
struct AlbedoAxes {
  vfloat<W> mu, roughness, alpha, x;  // x: 0 at grazing angles, 1 at normal incidence
  PRIMRAY_INLINE AlbedoAxes(vfloat<W> cosine, vfloat<W> r)
      : mu(clamp(cosine, 0.0f, 1.0f)), roughness(clamp(r, kAlbedoSmoothest, 1.0f)), alpha(roughness * roughness) {
    x = sqrt(min(mu * (1.0f + 3.0f * alpha) / (mu + 3.0f * alpha), 1.0f));
  }
  PRIMRAY_INLINE NodePlace<W> row(int count) const {
    return {(roughness - kAlbedoSmoothest) * (float(count - 1) / (1.0f - kAlbedoSmoothest)), count};
  }
  PRIMRAY_INLINE NodePlace<W> column(int count) const { return {x * float(count - 1), count}; }
};

// Interpolates a table by (outer, roughness, cosine).
template <int W>
PRIMRAY_INLINE vfloat<W> read_albedo(const float* table, const NodePlace<W>& outer, const NodePlace<W>& row,
                                     const NodePlace<W>& column, int rows, int columns) {
  const auto plane = [&](const vint<W>& of) {
    const vint<W> at = (of * vint<W>(rows) + row.first) * vint<W>(columns) + column.first;
    const TwoLanes<float, W> a = gather_two<W>(table, at), b = gather_two<W>(table + columns, at);
    return between(between(a.x, a.y, column.part), between(b.x, b.y, column.part), row.part);
  };
  return between(plane(outer.first), plane(outer.first + vint<W>(1)), outer.part);
}

// Albedo of an isotropic reflection lobe with F = 1.
template <int W>
PRIMRAY_INLINE vfloat<W> whole_albedo(vfloat<W> cosine, vfloat<W> roughness) {
  const LobeAlbedo<W> a = ggx_albedo(cosine, roughness);
  return a.f0 + a.f90;
}

// Cosine at which the Fresnel reflectance of a smooth interface equals the rough one's albedo over whole_albedo(); `eta` is at
// least 1.
template <int W>
PRIMRAY_INLINE vfloat<W> fresnel_cosine(vfloat<W> cosine, vfloat<W> roughness, vfloat<W> eta) {
  const AlbedoAxes<W> axes(cosine, roughness);
  const NodePlace<W> outer(safe_sqrt((eta - 1.0f) / (eta + 1.0f) * (1 / 0.6f)) * float(kReflectionEtas - 1), kReflectionEtas);
  const vfloat<W> steps = read_albedo(kReflectionTable, outer, axes.row(kReflectionRoughnesses),
                                      axes.column(kReflectionCosines), kReflectionRoughnesses, kReflectionCosines);
  const vfloat<W> excess = steps * (kPerStep * (kReflectionHigh - kReflectionLow)) + kReflectionLow;
  return clamp(axes.mu + excess * axes.alpha / (axes.roughness + 0.05f), 0.0f, 1.0f);
}

// Albedo of an isotropic rough dielectric's single scattering, reflection and transmission together.
template <int W>
PRIMRAY_INLINE vfloat<W> passing_albedo(vfloat<W> cosine, vfloat<W> roughness, vfloat<W> eta) {
  const AlbedoAxes<W> axes(cosine, roughness);
  const NodePlace<W> outer(((eta - 1.0f) / (eta + 1.0f) + 0.6f) * (float(kPassingEtas - 1) / 1.2f), kPassingEtas);
  return kPerStep * read_albedo(kPassingTable, outer, axes.row(kPassingRoughnesses), axes.column(kPassingCosines),
                                kPassingRoughnesses, kPassingCosines);
}

// Albedo of an anisotropic reflection lobe with F = 1, over that of the isotropic one.
template <int W>
PRIMRAY_INLINE vfloat<W> brushed_ratio(const vvec3<W>& wo, vfloat<W> roughness, vfloat<W> anisotropy) {
  const AlbedoAxes<W> axes(wo.z, roughness);
  const vfloat<W> side2 = wo.x * wo.x + wo.y * wo.y, cos2 = wo.x * wo.x / max(side2, 1e-12f);
  constexpr float kLeastRoot = 0.141421356f;  // of 1 - kMostAnisotropy
  const vfloat<W> root = safe_sqrt(1.0f - anisotropy);
  const NodePlace<W> outer((1.0f - root) * (float(kBrushedAnisotropies - 1) / (1 - kLeastRoot)), kBrushedAnisotropies);
  const NodePlace<W> row = axes.row(kBrushedRoughnesses), column = axes.column(kBrushedCosines);
  const NodePlace<W> azimuth(cos2 * float(kBrushedAzimuths - 1), kBrushedAzimuths);
  // Azimuths are a further axis within that of the cosines.
  const auto at_cosine = [&](vint<W> of, vint<W> r, vint<W> c) {
    const vint<W> at =
        ((of * vint<W>(kBrushedRoughnesses) + r) * vint<W>(kBrushedCosines) + c) * vint<W>(kBrushedAzimuths) + azimuth.first;
    const TwoLanes<float, W> a = gather_two<W>(kBrushedTable, at);
    return between(a.x, a.y, azimuth.part);
  };
  const vint<W> one(1);
  const auto plane = [&](vint<W> of) {
    const auto line = [&](vint<W> r) {
      return between(at_cosine(of, r, column.first), at_cosine(of, r, column.first + one), column.part);
    };
    return between(line(row.first), line(row.first + one), row.part);
  };
  return (kPerStep * kBrushedHigh) * between(plane(outer.first), plane(outer.first + one), outer.part);
}

}  // namespace primray
