// A moving scene as one would build and query it with Embree alone, for comparison: time steps of vertices, Embree's own moving
// instances, and plain queries of recorded rays.
#pragma once

#include <cstring>
#include <deque>
#include <vector>

#include "scene/scene.hpp"

namespace primray {

class BareWorld {
 public:
  // Builds from a scene of triangles and their instances, whose motion samples are evenly spaced. Throws Error("internal", ...)
  // for any other.
  explicit BareWorld(const Scene& scene);
  rtc::Scene get() const { return world_.get(); }

 private:
  OwnedScene make(const Scene& scene, const Group& group);
  OwnedGeometry instances(const Scene& scene, const Group& group, uint32_t placement);
  void set_steps(rtc::Geometry geometry, const MotionTable& table, const MovingInstances& moving);

  std::deque<OwnedScene> prototypes_;
  std::deque<std::vector<float>> turning_;  // as Embree reads quaternions, one for each time of a placement
  OwnedScene world_;
};

// Queries of recorded rays by plain Embree calls, as in the benchmark of moving rays.

// Forces the result into memory, as in a render; nothing may be optimized away.
template <class T>
void keep(const T& found) {
  asm volatile("" : : "r"(&found) : "memory");
}

namespace bare {

// Recorded rays hold origin, direction, tnear, tfar, time; Embree has these in another order.
template <int N>
void lay_out(rtc::Ray<N>& r, const float* p, int stride) {
  float* const fields[] = {r.org_x, r.org_y, r.org_z, r.dir_x, r.dir_y, r.dir_z, r.tnear, r.tfar, r.time};
  for (int f = 0; f < 9; ++f) std::memcpy(fields[f], p + f * stride, sizeof(float) * N);
  std::memset(r.mask, 0xff, sizeof r.mask), std::memset(r.id, 0, sizeof r.id), std::memset(r.flags, 0, sizeof r.flags);
}

template <int N>
void lay_out(rtc::RayHit<N>& r, const float* p, int stride) {
  lay_out(r.ray, p, stride);
  std::memset(r.hit.geom_id, 0xff, sizeof r.hit.geom_id), std::memset(r.hit.inst_id, 0xff, sizeof r.hit.inst_id);
}

template <int N>
void call_embree([[maybe_unused]] const int32_t* valid, rtc::Scene world, rtc::RayHit<N>& r) {
  rtc::QueryArguments args;
  if constexpr (N == 16) embree().rtcIntersect16(valid, world, &r, &args);
  if constexpr (N == 8) embree().rtcIntersect8(valid, world, &r, &args);
  if constexpr (N == 4) embree().rtcIntersect4(valid, world, &r, &args);
  if constexpr (N == 1) embree().rtcIntersect1(world, &r, &args);
}

template <int N>
void call_embree([[maybe_unused]] const int32_t* valid, rtc::Scene world, rtc::Ray<N>& r) {
  rtc::QueryArguments args;
  if constexpr (N == 16) embree().rtcOccluded16(valid, world, &r, &args);
  if constexpr (N == 8) embree().rtcOccluded8(valid, world, &r, &args);
  if constexpr (N == 4) embree().rtcOccluded4(valid, world, &r, &args);
  if constexpr (N == 1) embree().rtcOccluded1(world, &r, &args);
}

inline float distance(const rtc::Ray<1>& r) { return r.tfar[0]; }
inline float distance(const rtc::RayHit<1>& r) { return r.ray.tfar[0]; }

// `Query` is Ray or RayHit; W at once, or one by one.
template <template <int> class Query, int W>
void ask(rtc::Scene world, uint32_t active, const float* p, bool packet) {
  if (packet) {
    alignas(64) int32_t valid[W];
    for (int i = 0; i < W; ++i) valid[i] = -int32_t(active >> i & 1);
    Query<W> r;
    lay_out(r, p, W);
    call_embree(valid, world, r);
    return keep(r);
  }
  for (uint32_t m = active; m; m &= m - 1) {
    Query<1> r;
    lay_out(r, p + __builtin_ctz(m), W);
    call_embree(nullptr, world, r);
    keep(r);
  }
}

}  // namespace bare

// Traces W rays, 9 W floats from `p` on; shadow rays or nearest hits, as a packet or one by one.
template <int W>
void ask_bare(const BareWorld& world, bool shadow, uint32_t active, const float* p, bool packet) {
  shadow ? bare::ask<rtc::Ray, W>(world.get(), active, p, packet) : bare::ask<rtc::RayHit, W>(world.get(), active, p, packet);
}

// Distance of the hit in one lane; below 0: a shadow ray that is blocked.
template <int W>
float bare_distance(const BareWorld& world, bool shadow, const float* p, int lane) {
  const auto of = [&]<class Query>(Query r) {
    bare::lay_out(r, p + lane, W), bare::call_embree(nullptr, world.get(), r);
    return bare::distance(r);
  };
  return shadow ? of(rtc::Ray<1>()) : of(rtc::RayHit<1>());
}

}  // namespace primray
