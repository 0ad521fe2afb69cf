// IES photometric profiles: luminous intensity over two angles, interpolated bilinearly; 0 outside its angles.
//
// Directions are given in the profile's frame: z up, so that the first vertical angle (nadir) of types C and B is along -z, and
// the plane of horizontal angle 0 along +x; ANSI/IESNA LM-63-2002, section 3. Types A and C share the vertical axis of their
// planes and are one here (translation shifts type A's angles); type B's planes share the horizontal axis y instead.
#pragma once

#include <cstdint>
#include <vector>

#include "math/transcendental.hpp"

namespace primray {

struct IesTable {
  std::vector<float> data;  // by profile: vertical angles, horizontal angles, intensities by horizontal angle; radians
  // Offsets and sizes, by profile.
  std::vector<int32_t> first, verticals, horizontals, about_y;
  int longest = 2;  // largest number of angles of one kind
  bool any_about_y = false;
};

// Returns the last i in [0, count - 2] with data[base + i] <= x, or 0.
template <int W>
PRIMRAY_INLINE vint<W> find_angle(const IesTable& table, vint<W> base, vint<W> count, vfloat<W> x) {
  vint<W> lo(0);
  for (int step = 1 << (31 - __builtin_clz(unsigned(table.longest))); step > 0; step >>= 1) {
    const vint<W> mid = lo + vint<W>(step);
    const vbool<W> inside = mid < count - vint<W>(1);
    const vfloat<W> angle = gather<W>(table.data.data(), base + select(inside, mid, vint<W>(0)));
    lo = select(inside & (angle <= x), mid, lo);
  }
  return lo;
}

// Position of x among the angles at `base`: cell, fraction of it, and whether x is within the angles.
template <int W>
struct IesCell {
  vint<W> i;
  vfloat<W> part;
  vbool<W> inside;

  PRIMRAY_INLINE IesCell(const IesTable& table, vint<W> base, vint<W> count, vfloat<W> x)
      : i(find_angle(table, base, count, x)) {
    const vfloat<W> low = gather<W>(table.data.data(), base + i), high = gather<W>(table.data.data() + 1, base + i);
    part = clamp((x - low) / max(high - low, 1e-20f), 0.0f, 1.0f);
    inside = (x >= low) & (x <= high);
  }
};

// Intensity of `profile` along `w` (any length); theta, the angle from -z, is remapped to min((theta - origin) scale + origin,
// pi).
template <int W>
PRIMRAY_INLINE vfloat<W> ies_intensity(const IesTable& table, vint<W> profile, const vvec3<W>& w, vfloat<W> scale,
                                       vfloat<W> origin) {
  const vfloat<W> across = sqrt(w.x * w.x + w.y * w.y);
  const vfloat<W> light_theta = atan2(across, -w.z);
  vfloat<W> vertical = min((light_theta - origin) * scale + origin, kPi);
  vfloat<W> horizontal = atan2(w.y, w.x);
  const vbool<W> before = vertical < vfloat<W>(0.0f);
  if (table.any_about_y) {
    const vbool<W> about_y = gather<W>(table.about_y.data(), profile) != vint<W>(0);
    const SinCos<W> t = sincos_turns(vertical * (0.5f * kInvPi));
    const vfloat<W> flat = t.sin / max(across, 1e-30f), x = w.x * flat, y = w.y * flat;
    // In type B, v turns about y from -z towards x, and h tilts from there, clockwise seen from above: towards -y.
    vertical = select(about_y, atan2(x, t.cos), vertical);
    horizontal = select(about_y, atan2(-y, sqrt(x * x + t.cos * t.cos)), horizontal);
    horizontal = select((!about_y) & (horizontal < vfloat<W>(0.0f)), horizontal + 2.0f * kPi, horizontal);
  } else {
    horizontal = select(horizontal < vfloat<W>(0.0f), horizontal + 2.0f * kPi, horizontal);
  }
  const vint<W> base = gather<W>(table.first.data(), profile);
  const vint<W> verticals = gather<W>(table.verticals.data(), profile);
  const vint<W> horizontals = gather<W>(table.horizontals.data(), profile);
  const IesCell<W> v(table, base, verticals, vertical), h(table, base + verticals, horizontals, horizontal);
  const vint<W> at = base + verticals + horizontals + h.i * verticals + v.i;
  const float* d = table.data.data();
  const vint<W> next = at + verticals;
  const vfloat<W> a = gather<W>(d, at), b = gather<W>(d + 1, at), c = gather<W>(d, next), e = gather<W>(d + 1, next);
  const vfloat<W> low = a + (b - a) * v.part, high = c + (e - c) * v.part;
  return select(v.inside & h.inside & !before, low + (high - low) * h.part, vfloat<W>(0.0f));
}

}  // namespace primray
