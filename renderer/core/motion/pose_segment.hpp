// Interpolation of matrices in double: rotations turn at constant speed, the rest is linear.
//
// A matrix M is R S, a rotation and a symmetric stretch (the polar decomposition: Shoemake and Duff 1992, "Matrix Animation and
// Polar Decomposition"). Rotations are unit quaternions, between which the path takes the shorter arc (Shoemake 1985,
// "Animating Rotation with Quaternion Curves"). Nothing here calls the mathematical library, so that bits do not depend on it.
#pragma once

#include <cmath>
#include <cstddef>

#include "math/matrix.hpp"

namespace primray {

struct Quaternion {
  double x, y, z, w;
  double dot(const Quaternion& q) const { return x * q.x + y * q.y + z * q.z + w * q.w; }
};

// Pose at the beginning of a segment, and its rotation until the end.
struct PoseSegment {
  dvec3 translation;
  Quaternion rotation;
  dvec3 stretch[3];                     // columns
  double half_angle = 0, per_sine = 0;  // of the rotation to the next; 1 / sin half_angle; 0: so small that it is linear
};

// sin x for |x| <= pi / 2, to 1e-13.
inline double sine_series(double x) {
  const double x2 = x * x;
  double sum = 1.0;
  for (int k = 18; k >= 2; k -= 2) sum = 1.0 - x2 / double(k * (k + 1)) * sum;
  return x * sum;
}

inline daffine turned(const Quaternion& q, const dvec3 (&stretch)[3], const dvec3& translation) {
  const double s = 2.0 / q.dot(q), xs = q.x * s, ys = q.y * s, zs = q.z * s;
  const daffine r{{1 - (q.y * ys + q.z * zs), q.x * ys + q.w * zs, q.x * zs - q.w * ys},
                  {q.x * ys - q.w * zs, 1 - (q.x * xs + q.z * zs), q.y * zs + q.w * xs},
                  {q.x * zs + q.w * ys, q.y * zs - q.w * xs, 1 - (q.x * xs + q.y * ys)},
                  dvec3(0.0)};
  return {r.vector(stretch[0]), r.vector(stretch[1]), r.vector(stretch[2]), translation};
}

// Interpolates between two consecutive poses, t in [0, 1].
inline daffine between(const PoseSegment& a, const PoseSegment& b, double t) {
  const double s = 1 - t;
  double wa = s, wb = t;
  if (a.per_sine > 0) wa = sine_series(s * a.half_angle) * a.per_sine, wb = sine_series(t * a.half_angle) * a.per_sine;
  const Quaternion &p = a.rotation, &q = b.rotation;
  const Quaternion r{wa * p.x + wb * q.x, wa * p.y + wb * q.y, wa * p.z + wb * q.z, wa * p.w + wb * q.w};
  dvec3 stretch[3];
  for (int k = 0; k < 3; ++k) stretch[k] = a.stretch[k] * s + b.stretch[k] * t;
  return turned(r, stretch, a.translation * s + b.translation * t);
}

// Decomposes the matrices; each quaternion has the sign that is nearer to the previous one.
void make_pose_segments(const daffine* matrices, size_t count, PoseSegment* out);

}  // namespace primray
