// Directional emission by UsdLux's ShapingAPI: focusTerm * coneTerm * iesTerm.
//
// Angles are taken in world space, between the direction of emission and the light's transformed -Z axis; profiles are
// evaluated in the light's own space, with its scale and shear, as ShapingAPI's inputs:shaping:ies:file requires.
#pragma once

#include <algorithm>
#include <cmath>

#include "light/shaping/ies.hpp"
#include "math/matrix.hpp"

namespace primray {

// Frame in which a light's shaping is evaluated, from the light's transform.

// World axes of the light; axes that a degenerate matrix lacks are replaced by perpendicular ones.
inline daffine whole_axes(const daffine& m) {
  if (m.determinant() != 0) return m;
  const double x = length(m.x), y = length(m.y), z = length(m.z);
  dvec3 n = z > 0 ? m.z * (1 / z) : cross(m.x, m.y);
  if (!(length(n) > 0)) n = x > 0 ? Frame<double>(normalize(m.x)).s : y > 0 ? Frame<double>(normalize(m.y)).s : dvec3{0, 0, 1};
  n = normalize(n);
  dvec3 s = m.x - n * dot(n, m.x);
  if (!(length(s) > 1e-9 * x)) s = Frame<double>(n).s;
  s = normalize(s);
  return {s, cross(n, s), n, m.o};
}

// Frame fields of a row of the ShapingTable: the light's -z axis (unit, world space), and the columns of profile_from_world.
struct ShapedFrame {
  dvec3 axis, x, y, z;
};

inline ShapedFrame shaped_frame(const daffine& world_from_light) {
  const daffine m = whole_axes(world_from_light), inv = inverse(m);
  // The profile's horizontal angles begin at the light's -X: see textures/ies.py.
  double largest = 0;
  for (const dvec3& c : {inv.x, inv.y, inv.z})
    largest = std::max(largest, max_component(dvec3{std::fabs(c.x), std::fabs(c.y), std::fabs(c.z)}));
  const dvec3 turned{-1 / largest, -1 / largest, 1 / largest};
  return {normalize(m.z) * -1.0, inv.x * turned, inv.y * turned, inv.z * turned};
}

enum ShapingField : int {
  kShapedAxis,  // unit, world space
  kFocus = kShapedAxis + 3,
  kFocusTint,
  kConeCutoff = kFocusTint + 3,  // radians
  kConeSteepness,                // 1 / angle over which a soft cone fades; 0: hard
  kIesProfile,                   // 1 + index in IesTable; 0: none
  kIesFrame,                     // columns of profile_from_world
  kIesScale = kIesFrame + 9,     // scale of theta
  kIesOrigin,
  kIesFactor,    // reciprocal of the profile's normalization
  kReach,        // no light beyond this angle from the axis
  kReachRadius,  // radius of the light's bounding sphere
  kPeak,         // upper bound of the factor's luminance
  kMean,         // approximate mean of it over all directions
  kShapingFields
};

struct ShapingTable {
  std::vector<float> rows;
  IesTable profiles;

  const float* row(int number) const { return rows.data() + (number - 1) * kShapingFields; }
};

// Current kShapedAxis and kIesFrame of lights that move.
template <int W>
struct ShapedLanes {
  vvec3<W> axis, x, y, z;
};

// Shaping factor of rows `number` (from 1) for emission along unit `e`. `now`: frames that replace those of the rows, or null.
template <int W>
PRIMRAY_RARE vvec3<W> shaping_factor(const ShapingTable& table, vint<W> number, const vvec3<W>& e,
                                     const ShapedLanes<W>* now = nullptr) {
  using F = vfloat<W>;
  const bool uniform = all(number == vint<W>(number[0]));
  const float* rows = table.rows.data();
  const vint<W> offset = (number - vint<W>(1)) * vint<W>(kShapingFields);
  const auto get = [&](int field) { return uniform ? F(rows[offset[0] + field]) : gather<W>(rows + field, offset); };
  const auto vector = [&](int field) { return vvec3<W>(get(field), get(field + 1), get(field + 2)); };
  const F one(1.0f), none(0.0f);

  const vvec3<W> axis = now ? now->axis : vector(kShapedAxis), across = cross(axis, e);
  const F cosine = dot(axis, e), sin2 = dot(across, across);
  const F theta = atan2(sqrt(sin2), cosine);
  const F left = get(kConeCutoff) - theta, steepness = get(kConeSteepness), fading = clamp(left * steepness, 0.0f, 1.0f);
  // 1 - smoothstep(theta) is smoothstep of the complement.
  const F soft = fading * fading * (3.0f - 2.0f * fading);
  const F cone = select(steepness > none, soft, select(left >= none, one, none));
  vvec3<W> factor(cone);
  const F focus = get(kFocus);
  if (any(focus > none)) {
    const F focused = select(focus > none, exp2(focus * log2_cosine(cosine, min(sin2, 1.0f))), one);
    const vvec3<W> tint = vector(kFocusTint);
    factor *= tint + (vvec3<W>(one) - tint) * focused;
  }
  const vint<W> profile = bit_cast<vint<W>>(get(kIesProfile));
  const vbool<W> has_profile = profile > vint<W>(0);
  if (any(has_profile)) {
    const vvec3<W> w = now ? now->x * e.x + now->y * e.y + now->z * e.z
                           : vector(kIesFrame) * e.x + vector(kIesFrame + 3) * e.y + vector(kIesFrame + 6) * e.z;
    const vint<W> valid = max(profile - vint<W>(1), 0);
    const F intensity = ies_intensity(table.profiles, valid, w, get(kIesScale), get(kIesOrigin)) * get(kIesFactor);
    factor *= select(has_profile, intensity, one);
  }
  return factor;
}

// Weight of a light's shaping in light selection, for a light whose centre is at `to` from the point: 0 only if nothing is
// emitted there, however large the light is.
template <int W>
PRIMRAY_RARE vfloat<W> shaping_importance(const ShapingTable& table, int number, const vvec3<W>& to) {
  using F = vfloat<W>;
  const float* row = table.row(number);
  const F d2 = max(dot(to, to), 1e-30f), beyond = d2 - row[kReachRadius] * row[kReachRadius];
  const vvec3<W> e = to * (1.0f / sqrt(d2));
  const vvec3<W> axis{F(row[kShapedAxis]), F(row[kShapedAxis + 1]), F(row[kShapedAxis + 2])}, across = cross(axis, e);
  const F theta = atan2(length(across), dot(axis, e)), spread = atan2(F(row[kReachRadius]), safe_sqrt(beyond));
  const vbool<W> reached = (beyond <= F(0.0f)) | (theta - spread <= row[kReach] + 1e-3f);
  const F estimate = max(luminance(shaping_factor(table, vint<W>(number), e)), 0.05f * row[kPeak]);
  return select(reached, estimate, F(0.0f));
}

}  // namespace primray
