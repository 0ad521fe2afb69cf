// Image formats of domes (UsdLux DomeLight inputs:texture:format): maps directions to image coordinates.
//
// The UsdLux text defines lat-long only. The others are assumed to show +z at their centre, as lat-long does, with +y up:
// - kMirroredBall: a mirroring sphere photographed from far away on its +z side, so +x is on the right; radius r of the disc
// shows the direction at angle 2 asin r from the centre.
// - kAngular: "similar", but the angle is pi r (also Debevec's angular maps, which have +x on the right and +z at the center).
// - kVerticalCross: six views from the inside, 90 degrees each, in three columns and four rows, folded out around the middle
// one, +z: +y above it, +x to its left and -x to its right as in lat-long, -y below, and under that -z, attached to -y.
#pragma once

#include "math/transcendental.hpp"

namespace primray {

// Values of DOME_FORMATS in scene_upload.
enum class DomeFormat : int32_t { kLatLong, kMirroredBall, kAngular, kVerticalCross };

// Point of the image in texels, y from the top.
template <int W>
struct ImagePoint {
  vfloat<W> x, y;
};

template <int W>
PRIMRAY_INLINE ImagePoint<W> on_disc(const vvec3<W>& w, vfloat<W> radius_by_sine, int width, int height) {
  return {(0.5f + 0.5f * radius_by_sine * w.x) * float(width), (0.5f - 0.5f * radius_by_sine * w.y) * float(height)};
}

template <int W>
PRIMRAY_INLINE ImagePoint<W> mirrored_ball_point(const vvec3<W>& w, int width, int height) {
  const vfloat<W> sine = max(sqrt(w.x * w.x + w.y * w.y), 1e-20f);
  // sin(theta / 2) / sin(theta), from the half-angle's cosine or sine, whichever is precise.
  const vfloat<W> ratio =
      select(w.z > vfloat<W>(0.0f), 1.0f / sqrt(max(2.0f * (1.0f + w.z), 1e-20f)), sqrt(max(0.5f * (1.0f - w.z), 0.0f)) / sine);
  return on_disc(w, ratio, width, height);
}

template <int W>
PRIMRAY_INLINE ImagePoint<W> angular_point(const vvec3<W>& w, int width, int height) {
  const vfloat<W> sine = max(sqrt(w.x * w.x + w.y * w.y), 1e-20f);
  return on_disc(w, atan2(sine, w.z) * kInvPi / sine, width, height);
}

// Point on the cube face that w hits, no nearer to its edge than the centres of its outer texels: faces adjacent in the image
// are not neighbours on the cube.
template <int W>
PRIMRAY_INLINE ImagePoint<W> vertical_cross_point(const vvec3<W>& w, int width, int height) {
  const vfloat<W> ax = abs(w.x), ay = abs(w.y), az = abs(w.z);
  const vbool<W> on_x = (ax > ay) & (ax > az), on_y = (!on_x) & (ay > az), on_z = (!on_x) & (!on_y);
  const vfloat<W> half = 0.5f / max(max(ax, ay), az);
  const vbool<W> back = on_z & (w.z < vfloat<W>(0.0f));
  const vfloat<W> turned = copysign(vfloat<W>(1.0f), w.x);  // +x: z grows to the right; -x: to the left
  const vfloat<W> across = select(on_x, w.z * turned, -w.x);
  const vfloat<W> down = select(on_y, w.z * copysign(vfloat<W>(1.0f), w.y), select(back, w.y, -w.y));
  const vfloat<W> zero(0.0f), one(1.0f), two(2.0f);
  const vfloat<W> column = select(on_x, select(w.x > zero, zero, two), one);
  const vfloat<W> row = select(on_y, select(w.y > zero, zero, two), select(back, vfloat<W>(3.0f), one));
  const float face_w = float(width) / 3, face_h = float(height) / 4;
  const float edge_x = std::min(0.5f / face_w, 0.5f), edge_y = std::min(0.5f / face_h, 0.5f);
  return {(column + clamp(0.5f + across * half, edge_x, 1 - edge_x)) * face_w,
          (row + clamp(0.5f + down * half, edge_y, 1 - edge_y)) * face_h};
}

template <int W>
PRIMRAY_INLINE ImagePoint<W> image_point(DomeFormat format, const vvec3<W>& w, int width, int height) {
  if (format == DomeFormat::kMirroredBall) return mirrored_ball_point(w, width, height);
  if (format == DomeFormat::kAngular) return angular_point(w, width, height);
  return vertical_cross_point(w, width, height);
}

}  // namespace primray
