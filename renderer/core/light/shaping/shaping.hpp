// What UsdLux's ShapingAPI makes of a light's emission by its direction: focusTerm * coneTerm * iesTerm.
//
// Angles are taken in world space, between the direction of emission and the light's -Z axis as its matrix carries it; profiles
// are asked in the light's own space, with its scale and shear, as ShapingAPI's inputs:shaping:ies:file has it.
#pragma once

#include "light/shaping/ies.hpp"

namespace primray {

enum ShapingField : int {
  kShapedAxis,  // unit, world
  kFocus = kShapedAxis + 3,
  kFocusTint,
  kConeCutoff = kFocusTint + 3,  // radians
  kConeSteepness,                // 1 / angle over which a soft cone fades; 0: hard
  kIesProfile,                   // 1 + number in IesTable; 0: none
  kIesFrame,                     // columns: the profile's frame from world
  kIesScale = kIesFrame + 9,     // of theta
  kIesOrigin,
  kIesFactor,    // one over what the profile is divided by
  kReach,        // no light beyond this angle from the axis
  kReachRadius,  // of a ball about the light's centre that holds it
  kPeak,         // the factor's luminance is at most so much
  kMean,         // and about so much on average over all directions
  kShapingFields
};

struct ShapingTable {
  std::vector<float> rows;
  IesTable profiles;

  const float* row(int number) const { return rows.data() + (number - 1) * kShapingFields; }
};

// How lights stand that are not as their rows have them: kShapedAxis and kIesFrame.
template <int W>
struct ShapedLanes {
  vvec3<W> axis, x, y, z;
};

// The factor of rows `number` (from 1) for emission along unit `e`. `now`: null, or in place of the rows' frames.
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
  // 1 - smoothstep(theta) is smoothstep of what is left.
  const F soft = fading * fading * (3.0f - 2.0f * fading);
  const F cone = select(steepness > none, soft, select(left >= none, one, none));
  vvec3<W> factor(cone);
  const F focus = get(kFocus);
  if (any(focus > none)) {
    const F focused = select(focus > none, exp2(focus * log2_cosine(cosine, min(sin2, 1.0f))), one);
    const vvec3<W> tint = vector(kFocusTint);
    factor *= tint + (vvec3<W>(one) - tint) * focused;
  }
  const vint<W> profile = truncate(get(kIesProfile));
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

// What is weighed of a light for its shaping, where its centre is `to` away: 0 only where nothing of it comes, however large
// the light is.
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
