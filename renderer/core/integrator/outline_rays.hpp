// Extra camera rays for lights whose outline crosses a pixel (build/lights/lights.hpp): they test visibility of the
// light as a body and do not scatter. The paths of such a pixel then contribute nothing of that light's body.
#pragma once

#include <algorithm>

#include "integrator/emission.hpp"
#include "integrator/place_in_depth.hpp"
#include "integrator/round.hpp"
#include "integrator/trace.hpp"

namespace primray {

// Outline rays per sample of the pixel, for each light whose outline crosses it.
constexpr int kOutlineRays = 4;

// Looks up the light outlines in each pixel that the worker has listed; returns whether there are any.
inline bool look_up_outlines(Round& round) {
  bool some = false;
  for (int i = 0; i < round.pixels; ++i) {
    round.worker.outlines[i] = round.scene.outlines.at(round.pixel_x(i), round.pixel_y(i));
    some |= !round.worker.outlines[i].empty();
  }
  return some;
}

// Stores the light path states of outline rays that are about to be queued.
template <int W>
PRIMRAY_RARE void put_outline_lpe_states(Round& round, vbool<W> m, int32_t light) {
  Worker& w = round.worker;
  const LpeLight seen{0, 0, same_ends(round.scene.lights.end_of(light)), {}};
  for (int k = 0; k < __builtin_popcount(bits(m)); ++k) w.lpe->shadows.put(w.shadows.count + k, seen);
}

template <int W>
PRIMRAY_INLINE void clear_shadows(Round& round) {
  round.worker.shadows.count = 0;
  if (PathLog* const log = path_log<W>(round)) log->clear_queues();
}

// Appends the outline rays towards one light in pixel number `pixel` of the worker to the shadow queue, which is traced when
// full.
template <int W>
PRIMRAY_RARE void trace_outline(Round& round, int pixel, const LightOutlines::Part& part) {
  using F = vfloat<W>;
  using I = vint<W>;
  Worker& w = round.worker;
  const int samples = round.samples, rays = samples * kOutlineRays;
  const I x(round.pixel_x(pixel)), y(round.pixel_y(pixel));
  const float share = part.width * part.height * (1.0f / kOutlineRays);
  for (int at = 0; at < rays; at += W) {
    alignas(64) int32_t slot[W];
    alignas(64) uint32_t index[W], number[W], replicate[W];
    for (int i = 0; i < W; ++i) {
      const int ray = std::min(at + i, rays - 1), k = ray / kOutlineRays;
      slot[i] = pixel * samples + k, index[i] = round.index(k), replicate[i] = uint32_t(round.replicate(k));
      number[i] = index[i] * kOutlineRays + uint32_t(ray % kOutlineRays);
    }
    const vuint<W> of_pixel = Sampler<W>::pixel_seed(round.settings.seed, x, y, load<W>(replicate));
    const Sampler<W> own{reverse_bits(load<W>(number)), of_pixel};
    const Pair<W> film = own.pair(I(part.light), Purpose::kFilm);
    const F u = part.u + film.u * part.width, v = part.v + film.v * part.height;
    const CameraRay<W> ray = round.scene.camera.ray<W>(x, y, u, v, F(0.5f), F(0.5f), F(0.0f));
    PathLanes<W> p;
    p.ray = {ray.o, ray.d, ray.tnear, ray.tfar};
    if (round.needs.time)
      p.ray.time = time_of(round, Sampler<W>{reverse_bits(load<W>(index)), of_pixel}.single(I(0), kShutterTime), x, y);
    p.bsdf_pdf = p.travelled = F(0.0f), p.depth = I(0), p.link = I(kUnlinkedRow);
    p.normal = p.diffuse_share = vvec3<W>(F(0.0f));
    const vbool<W> active = lane_numbers<W>() < I(rays - at);
    vvec3<W> L(F(0.0f));
    const LightHits<W> light_hits = intersect_lights(round.scene.lights, active, vbool<W>(true), p, F(kInfinity), L);
    const vbool<W> seen = light_hits.covered & (light_hits.light == I(part.light));
    if (!any(seen)) continue;
    if (w.shadows.count > ShadowQueue::kSize - 2 * W) trace_shadows<W>(round), clear_shadows<W>(round);
    if (round.needs.lpe) put_outline_lpe_states(round, seen, part.light);
    if (PathLog* const log = path_log<W>(round))
      log->add("outline ray", slot[0], number[0], 0, 0).put("light", double(part.light)).put("radiance", L), log->queue();
    if (round.has_volumes()) {
      p.sampler = own, p.vertex = I(0);
      put_shadow_seeds(seen, w.shadows, p);
    }
    if (round.deep)
      for (uint32_t b = bits(seen); b; b &= b - 1) {
        const int i = __builtin_ctz(b);
        slot[i] = round.deep->lit(slot[i], depth_at(round.scene, p.ray, light_hits.nearest[i], i), false);
      }
    // Starts at the camera's near plane.
    w.shadows.append(seen, ray.o + ray.d * ray.tnear, ray.d, max(light_hits.nearest * kNearlyOne - ray.tnear, 0.0f), L * share,
                     load<W>(slot), p.ray.time, round.needs);
  }
}

template <int W>
PRIMRAY_RARE void trace_outlines(Round& round) {
  Worker& w = round.worker;
  clear_shadows<W>(round);
  if (w.special_shadows) w.special_shadows->rays.count = 0;
  for (int i = 0; i < round.pixels; ++i)
    for (const LightOutlines::Part& part : w.outlines[i]) trace_outline<W>(round, i, part);
  trace_shadows<W>(round), clear_shadows<W>(round);
}

// Returns the camera rays of `m` that hit a light which has outline rays in their pixel.
template <int W>
PRIMRAY_RARE vbool<W> is_outlined(const Round& round, vbool<W> m, vint<W> slot, vint<W> light) {
  vint<W> found(0);
  for (uint32_t b = bits(m); b; b &= b - 1) {
    const int i = __builtin_ctz(b);
    for (const LightOutlines::Part& part : round.worker.outlines[(slot[i] & kSumMask) / round.samples])
      found.set(i, found[i] | (part.light == light[i]));
  }
  return found != vint<W>(0);
}

}  // namespace primray
