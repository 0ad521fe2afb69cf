// Tracing of W rays in Embree: as a packet or one by one, whichever was measured faster. The bits are the same.
#pragma once

#include "bvh/pairs.hpp"
#include "embree/embree.hpp"
#include "ray/ray.hpp"

namespace primray {

template <int W>
PRIMRAY_INLINE void fill(rtc::Ray<W>& r, const Rays<W>& rays) {
  store(r.org_x, rays.o.x), store(r.org_y, rays.o.y), store(r.org_z, rays.o.z), store(r.tnear, rays.tnear);
  store(r.dir_x, rays.d.x), store(r.dir_y, rays.d.y), store(r.dir_z, rays.d.z), store(r.tfar, rays.tfar);
  store(r.time, rays.time), store(r.mask, vuint<W>(0xffffffffu)), store(r.flags, vuint<W>(0u)), store(r.id, vuint<W>(0u));
}

template <int W>
PRIMRAY_INLINE void read(const rtc::RayHit<W>& r, Hits<W>& h) {
  h.t = load<W>(r.ray.tfar);
  h.ng = {load<W>(r.hit.ng_x), load<W>(r.hit.ng_y), load<W>(r.hit.ng_z)};
  h.u = load<W>(r.hit.u), h.v = load<W>(r.hit.v);
  h.prim = bit_cast<vint<W>>(load<W>(r.hit.prim_id)), h.geom = bit_cast<vint<W>>(load<W>(r.hit.geom_id));
  to_triangles(h.geom, h.prim, h.u, h.v);
  h.inst = bit_cast<vint<W>>(load<W>(r.hit.inst_id)), h.inst_prim = bit_cast<vint<W>>(load<W>(r.hit.inst_prim_id));
}

// Nearest hits of the `active` rays with all W as one packet.
template <int W>
PRIMRAY_INLINE Hits<W> intersect_packet(rtc::Scene scene, vbool<W> active, const Rays<W>& rays) {
  rtc::RayHit<W> r;
  fill(r.ray, rays);
  store(r.hit.geom_id, vuint<W>(rtc::kInvalidId)), store(r.hit.inst_id, vuint<W>(rtc::kInvalidId));
  store(r.hit.inst_prim_id, vuint<W>(rtc::kInvalidId));
  alignas(64) int32_t valid[W];
  store(valid, minus_one_where(active));
  rtc::QueryArguments args;
  if constexpr (W == 16) embree().rtcIntersect16(valid, scene, &r, &args);
  if constexpr (W == 8) embree().rtcIntersect8(valid, scene, &r, &args);
  if constexpr (W == 4) embree().rtcIntersect4(valid, scene, &r, &args);
  if constexpr (W == 1) {
    if (valid[0]) embree().rtcIntersect1(scene, &r, &args);
  }
  Hits<W> h;
  read(r, h);
  return h;
}

// Nearest hits of the `active` rays, one ray at a time.
template <int W>
PRIMRAY_INLINE Hits<W> intersect_single(rtc::Scene scene, vbool<W> active, const Rays<W>& rays) {
  rtc::RayHit<W> all;
  rtc::QueryArguments args;
  fill(all.ray, rays);
  store(all.hit.geom_id, vuint<W>(rtc::kInvalidId));
  for (uint32_t m = bits(active); m; m &= m - 1) {
    const int i = __builtin_ctz(m);
    rtc::RayHit<1> r;
    r.ray = {{all.ray.org_x[i]},
             {all.ray.org_y[i]},
             {all.ray.org_z[i]},
             {all.ray.tnear[i]},
             {all.ray.dir_x[i]},
             {all.ray.dir_y[i]},
             {all.ray.dir_z[i]},
             {all.ray.time[i]},
             {all.ray.tfar[i]},
             {0xffffffffu},
             {0u},
             {0u}};
    r.hit.geom_id[0] = r.hit.inst_id[0] = r.hit.inst_prim_id[0] = rtc::kInvalidId;
    embree().rtcIntersect1(scene, &r, &args);
    all.ray.tfar[i] = r.ray.tfar[0];
    all.hit.ng_x[i] = r.hit.ng_x[0], all.hit.ng_y[i] = r.hit.ng_y[0], all.hit.ng_z[i] = r.hit.ng_z[0];
    all.hit.u[i] = r.hit.u[0], all.hit.v[i] = r.hit.v[0];
    all.hit.prim_id[i] = r.hit.prim_id[0], all.hit.geom_id[i] = r.hit.geom_id[0];
    all.hit.inst_id[i] = r.hit.inst_id[0], all.hit.inst_prim_id[i] = r.hit.inst_prim_id[0];
  }
  Hits<W> h;
  read(all, h);
  return h;
}

// Returns the lanes of `active` whose rays are blocked.
template <int W>
PRIMRAY_INLINE vbool<W> occluded_packet(rtc::Scene scene, vbool<W> active, const Rays<W>& rays) {
  rtc::Ray<W> r;
  fill(r, rays);
  alignas(64) int32_t valid[W];
  store(valid, minus_one_where(active));
  rtc::QueryArguments args;
  if constexpr (W == 16) embree().rtcOccluded16(valid, scene, &r, &args);
  if constexpr (W == 8) embree().rtcOccluded8(valid, scene, &r, &args);
  if constexpr (W == 4) embree().rtcOccluded4(valid, scene, &r, &args);
  if constexpr (W == 1) {
    if (valid[0]) embree().rtcOccluded1(scene, &r, &args);
  }
  return active & (load<W>(r.tfar) < vfloat<W>(0.0f));  // Embree sets tfar to -inf
}

template <int W>
PRIMRAY_INLINE vbool<W> occluded_single(rtc::Scene scene, vbool<W> active, const Rays<W>& rays) {
  rtc::Ray<W> all;
  rtc::QueryArguments args;
  fill(all, rays);
  for (uint32_t m = bits(active); m; m &= m - 1) {
    const int i = __builtin_ctz(m);
    rtc::Ray<1> r = {{all.org_x[i]}, {all.org_y[i]}, {all.org_z[i]}, {all.tnear[i]}, {all.dir_x[i]}, {all.dir_y[i]},
                     {all.dir_z[i]}, {all.time[i]},  {all.tfar[i]},  {0xffffffffu},  {0u},           {0u}};
    embree().rtcOccluded1(scene, &r, &args);
    all.tfar[i] = r.tfar[0];
  }
  return active & (load<W>(all.tfar) < vfloat<W>(0.0f));
}

}  // namespace primray
