// Sampling of a rectangle that is near but seen nearly edge-on, whose solid angle is too small for the precision of the
// spherical rectangle: chooses a strip along its longer side uniformly, and a point on the strip by its solid angle.
//
// Seen from height h over the plane and distance c from the strip's line, a piece dx of it has solid angle proportional to dx h
// / (c^2 + x^2)^(3/2), so s = x / sqrt(c^2 + x^2) is uniform, with x counted from the foot point on the line. The code stores q
// = 1 - |s|, which is precise if both ends are far away on one side. The density per solid angle is then that of the strip
// alone, c^2 / (2 half h (s1 - s0)).
#pragma once

#include "light/shape/local_shape.hpp"

namespace primray {

// Smallest q: x = c / sqrt(2 q) stays finite.
constexpr float kFarAlong = 1e-30f;

template <int W>
class Sliver {
 public:
  // Rectangle |x| <= hx, |y| <= hy in the plane z = 0, seen from p.
  PRIMRAY_INLINE Sliver(const vvec3<W>& p, vfloat<W> hx, vfloat<W> hy)
      : turned_(hy > hx),
        across_(select(turned_, p.x, p.y)),
        half_(min(hx, hy)),
        x0_(-max(hx, hy) - select(turned_, p.y, p.x)),
        x1_(max(hx, hy) - select(turned_, p.y, p.x)),
        height_(-p.z) {}

  // Samples the vector from the point to a point of the rectangle.
  PRIMRAY_INLINE vvec3<W> sample(vfloat<W> u, vfloat<W> v) const {
    const vfloat<W> side = (2.0f * v - 1.0f) * half_ - across_;
    const vfloat<W> c = sqrt(side * side + height_ * height_);
    const vfloat<W> q0 = rest(x0_, c), q1 = rest(x1_, c), one(1.0f);
    // Both ends are on one side of the foot point: interpolate q between q0 and q1. Otherwise interpolate s, from -(1 - q0) to
    // 1 - q1.
    const vbool<W> beside = x0_ * x1_ > vfloat<W>(0.0f);
    const vfloat<W> s = q0 - one + u * (one - q0 + one - q1);
    const vfloat<W> q = max(select(beside, q0 + u * (q1 - q0), one - abs(s)), kFarAlong);
    const vfloat<W> x = c * (one - q) / sqrt(q * (2.0f - q));
    const vfloat<W> along = min(max(copysign(x, select(beside, x0_, s)), x0_), x1_);
    return {select(turned_, side, along), select(turned_, along, side), height_};
  }

  // Density per solid angle with which sample() chooses the point at `to`.
  PRIMRAY_INLINE vfloat<W> pdf(const vvec3<W>& to) const {
    const vfloat<W> side = select(turned_, to.x, to.y), c2 = side * side + height_ * height_, c = sqrt(c2);
    const vfloat<W> q0 = rest(x0_, c), q1 = rest(x1_, c);
    const vfloat<W> width = select(x0_ * x1_ > vfloat<W>(0.0f), abs(q0 - q1), (1.0f - q0) + (1.0f - q1));
    return c2 / (2.0f * half_ * height_ * width);
  }

 private:
  // 1 - |x| / sqrt(c^2 + x^2)
  static PRIMRAY_INLINE vfloat<W> rest(vfloat<W> x, vfloat<W> c) {
    const vfloat<W> far = sqrt(x * x + c * c);
    return c / far * (c / (far + abs(x)));
  }

  vbool<W> turned_;  // the longer side is y
  vfloat<W> across_, half_, x0_, x1_, height_;
};

}  // namespace primray
