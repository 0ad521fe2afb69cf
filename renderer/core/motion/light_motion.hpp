// Lights that move without changing their size. Their rows hold the pose at the frame time; points and directions are
// transformed to the row's pose and back.
#pragma once

#include <vector>

#include "base/features.hpp"
#include "math/vec3.hpp"
#include "motion/clock.hpp"
#include "motion/pose_segment.hpp"

namespace primray {

// Path of one light: rotations from the row's frame, and origins.
struct LightPath {
  MotionClock clock;
  std::vector<PoseSegment> places;
  dvec3 origin;  // of the row
  // Bounding sphere of the path; without a radius: a light without a position.
  vec3 center{0.0f};
  float radius = 0;
  float spread = 1;  // factor from its power to the irradiance at a point, times the squared distance
};

// World from the row's pose: p -> R (p - origin) + place.
struct LightPose {
  daffine rotation;
  dvec3 place, origin;
};

inline LightPose stance_of(const LightPath& path, float time) {
  const Moment now = path.clock.at(time);
  const daffine m = between(path.places[size_t(now.segment)], path.places[size_t(now.segment) + 1], now.within);
  return {{m.x, m.y, m.z, dvec3(0.0)}, m.o, path.origin};
}

// Poses of W lanes' lights; static lights have the identity.
template <int W>
struct LightPoses {
  vvec3<W> x{vfloat<W>(1.0f), vfloat<W>(0.0f), vfloat<W>(0.0f)}, y{vfloat<W>(0.0f), vfloat<W>(1.0f), vfloat<W>(0.0f)},
      z{vfloat<W>(0.0f), vfloat<W>(0.0f), vfloat<W>(1.0f)}, place{vfloat<W>(0.0f)}, origin{vfloat<W>(0.0f)};

  PRIMRAY_INLINE void put(int lane, const LightPose& s) {
    const auto set = [&](vvec3<W>& to, const dvec3& v) {
      to.x.set(lane, float(v.x)), to.y.set(lane, float(v.y)), to.z.set(lane, float(v.z));
    };
    set(x, s.rotation.x), set(y, s.rotation.y), set(z, s.rotation.z), set(place, s.place), set(origin, s.origin);
  }
  PRIMRAY_INLINE vvec3<W> vector_to_row(const vvec3<W>& v) const { return {dot(x, v), dot(y, v), dot(z, v)}; }
  PRIMRAY_INLINE vvec3<W> point_to_row(const vvec3<W>& p) const { return vector_to_row(p - place) + origin; }
  PRIMRAY_INLINE vvec3<W> vector_to_world(const vvec3<W>& v) const { return x * v.x + y * v.y + z * v.z; }
};

// Path index by light row and by dome, or -1; empty if no light moves.
struct LightMotion {
  std::vector<LightPath> paths;
  std::vector<int32_t> of_row, of_dome;

  bool any() const { return built::kMotion && !paths.empty(); }
  int32_t row(int i) const { return size_t(i) < of_row.size() ? of_row[size_t(i)] : -1; }
  int32_t dome(size_t k) const { return k < of_dome.size() ? of_dome[k] : -1; }
};

// Poses in lanes `m`, each of its own light.
template <int W>
PRIMRAY_RARE LightPoses<W> poses_of(const LightMotion& motion, vbool<W> m, vint<W> light, vfloat<W> time) {
  LightPoses<W> r;
  for (uint32_t b = bits(m); b; b &= b - 1) {
    const int i = __builtin_ctz(b);
    if (const int32_t path = motion.row(light[i]); path >= 0) r.put(i, stance_of(motion.paths[size_t(path)], time[i]));
  }
  return r;
}
// Poses of one path in all lanes.
template <int W>
PRIMRAY_RARE LightPoses<W> poses_of(const LightPath& path, vfloat<W> time) {
  LightPoses<W> r;
  for (int i = 0; i < W; ++i) r.put(i, stance_of(path, time[i]));
  return r;
}

}  // namespace primray
