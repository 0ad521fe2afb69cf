// Decomposition of matrices for pose_segment.hpp.
#include "motion/pose_segment.hpp"

#include <algorithm>

namespace primray {
namespace {

dvec3 column(const daffine& m, int k) { return k == 0 ? m.x : k == 1 ? m.y : m.z; }

// Nearest rotation to a matrix of positive determinant, by Newton's iteration: Higham 1986, "Computing the Polar
// Decomposition". Scaled by the determinant, so that large and small ones take as few steps.
daffine nearest_rotation(daffine m) {
  m.o = dvec3(0.0);
  const double size = std::cbrt(m.determinant());
  m.x = m.x * (1 / size), m.y = m.y * (1 / size), m.z = m.z * (1 / size);
  for (int step = 0; step < 60; ++step) {
    const daffine i = inverse(m);
    // The inverse's transpose has the inverse's rows as columns.
    const dvec3 t[3] = {{i.x.x, i.y.x, i.z.x}, {i.x.y, i.y.y, i.z.y}, {i.x.z, i.y.z, i.z.z}};
    const daffine n{(m.x + t[0]) * 0.5, (m.y + t[1]) * 0.5, (m.z + t[2]) * 0.5, dvec3(0.0)};
    const double moved = length(n.x - m.x) + length(n.y - m.y) + length(n.z - m.z);
    m = n;
    if (moved < 1e-14) break;
  }
  return m;
}

// Shepperd 1978: divides by the largest of four, which is never nearly 0.
Quaternion quaternion_of(const daffine& r) {
  const double xx = r.x.x, yy = r.y.y, zz = r.z.z, trace = xx + yy + zz;
  Quaternion q;
  if (trace >= std::max({xx, yy, zz})) {
    q = {r.y.z - r.z.y, r.z.x - r.x.z, r.x.y - r.y.x, 1 + trace};
  } else if (xx >= yy && xx >= zz) {
    q = {1 + xx - yy - zz, r.x.y + r.y.x, r.z.x + r.x.z, r.y.z - r.z.y};
  } else if (yy >= zz) {
    q = {r.x.y + r.y.x, 1 + yy - xx - zz, r.y.z + r.z.y, r.z.x - r.x.z};
  } else {
    q = {r.z.x + r.x.z, r.y.z + r.z.y, 1 + zz - xx - yy, r.x.y - r.y.x};
  }
  const double unit = 1 / std::sqrt(q.dot(q));
  return {q.x * unit, q.y * unit, q.z * unit, q.w * unit};
}

PoseSegment turning_of(daffine m) {
  PoseSegment t;
  t.translation = m.o;
  const double sign = m.determinant() < 0 ? -1 : 1;  // mirrored matrices: the rotation is that of the matrix without the
                                                     // reflection
  const daffine r = nearest_rotation({m.x * sign, m.y * sign, m.z * sign, dvec3(0.0)});
  t.rotation = quaternion_of(r);
  for (int k = 0; k < 3; ++k) {
    const dvec3 c = column(m, k);
    t.stretch[k] = {dot(r.x, c), dot(r.y, c), dot(r.z, c)};
  }
  return t;
}

}  // namespace

void make_pose_segments(const daffine* matrices, size_t count, PoseSegment* out) {
  for (size_t k = 0; k < count; ++k) {
    out[k] = turning_of(matrices[k]);
    if (k == 0) continue;
    Quaternion& q = out[k].rotation;
    if (out[k - 1].rotation.dot(q) < 0) q = {-q.x, -q.y, -q.z, -q.w};
    const Quaternion& p = out[k - 1].rotation;
    // atan2 of the lengths of the difference and the sum is precise for small angles.
    const Quaternion d{q.x - p.x, q.y - p.y, q.z - p.z, q.w - p.w}, s{q.x + p.x, q.y + p.y, q.z + p.z, q.w + p.w};
    const double half = 2 * std::atan2(std::sqrt(d.dot(d)), std::sqrt(s.dot(s)));
    out[k - 1].half_angle = half;
    out[k - 1].per_sine = half > 1e-5 ? 1 / sine_series(std::min(half, 1.5707963267948966)) : 0;
  }
}

}  // namespace primray
