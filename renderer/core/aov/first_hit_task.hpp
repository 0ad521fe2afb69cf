// First hits of one tile of pixels, W rays at a time: see first_hit.hpp.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>

#include "accel/query.hpp"
#include "aov/first_hit.hpp"
#include "aov/first_hit_volumes.hpp"
#include "bsdf/bsdf.hpp"
#include "integrator/emission.hpp"
#include "light/mesh/emitter.hpp"
#include "light/types/disk.hpp"
#include "sampler/sampler.hpp"
#include "surface/evaluate_inputs.hpp"
#include "surface/interaction.hpp"

namespace primray {

// Denoiser guides behind smooth surfaces: guides look past mirrors and clear glass to the first surface that scatters widely.
// What is seen in them has edges that their own albedo and normals do not show.

// Share of the light below which a branch is never taken: guides should be free of noise where possible.
constexpr float kSmallShare = 0.1f;
// Maximum number of smooth surfaces that a ray follows; the surface hit after that counts as what it is.
constexpr int kMostSmooth = 8;

// Continuation of rays at a surface, unless straight.
template <int W>
struct Bend {
  vbool<W> lanes;
  vvec3<W> d;     // incoming direction; in those lanes, the outgoing one
  vvec3<W> tint;  // throughput of that branch, divided by its probability
};

// Finds the lanes of `hit` on a surface that mostly reflects as a mirror or transmits without scattering; each takes the branch
// that carries more, or where both carry much, one of them by the random number `u`. The Fresnel factor is Schlick's, as in
// Bsdf.
template <int W>
PRIMRAY_INLINE void bend_at_smooth(vbool<W> hit, const Interaction<W>& it, const SurfaceRows<W>& rows, vfloat<W> u,
                                   Bend<W>& bend) {
  using F = vfloat<W>;
  using B = vbool<W>;
  using V = vvec3<W>;
  const F zero(0.0f), one(1.0f);
  const vint<W> flags = rows.flags();
  const auto has = [&](SurfaceFlag flag) { return (flags & vint<W>(flag)) != vint<W>(0); };
  const F pass = rows(kTransmission);
  const B is_mirror = rows(kAlpha) == zero, is_clear = (pass > zero) & (is_mirror | !has(kOpenPbr));
  B smooth = hit & has(kPreview) & (is_mirror | is_clear) & (rows(kPresence) >= one);
  if (!any(smooth)) return;
  const B front = dot(it.ng, bend.d) < zero;
  const F side = select(front, one, F(-1.0f));
  const V ng = it.ng * side, shaded = it.ns * side;
  const V n = select(dot(shaded, bend.d) < zero, shaded, ng);
  const F cosine = min(-dot(n, bend.d), one), eta = select(front, rows(kIor), one / rows(kIor));
  // Like Bsdf: from the denser side Schlick's term takes the angle on the other side, and all light is reflected beyond the
  // critical angle.
  const B to_rarer = !has(kThin) & (pass > zero) & (eta < one);
  const F sin2 = (one - cosine * cosine) / (eta * eta), rarer = safe_sqrt(one - sin2);
  const B reflects_all = to_rarer & (sin2 >= one);
  V fresnel = lerp(rows.color(kF0), rows.color(kF90), pow5(one - select(to_rarer, rarer, cosine)));
  fresnel = select(reflects_all, V(one), fresnel);
  const V passed = select(reflects_all, V(zero), (V(one) - min(fresnel, 1.0f)) * pass);
  const V diffuse = (V(one) - min(fresnel, 1.0f)) * rows.color(kDiffuse) * it.color;
  const F reflects = select(is_mirror, luminance(fresnel), zero), lets = select(is_clear, luminance(passed), zero);
  const F scatters = luminance(diffuse) + select(is_mirror, zero, luminance(fresnel));
  smooth &= reflects + lets > scatters;
  const F share = reflects / max(reflects + lets, 1e-20f);
  const B back = u < (share - kSmallShare) * (1.0f / (1.0f - 2.0f * kSmallShare));
  const F ratio = one / eta, inside = safe_sqrt(one - ratio * ratio * (one - cosine * cosine));
  const V refracted = select(has(kThin), bend.d, bend.d * ratio + n * (ratio * cosine - inside));
  const V d = select(back, bend.d + n * (2.0f * cosine), refracted);
  // The true surface decides on which side a direction is.
  const F out = dot(d, ng);
  smooth &= (back & (out > zero)) | ((!back) & (out < zero));
  bend.tint = select(back, fresnel * (one / max(share, 1e-6f)), passed * (one / max(one - share, 1e-6f)));
  bend.d = select(smooth, d, bend.d);
  bend.lanes = smooth;
}

// Maximum number of half-present surfaces that a ray looks through; what is beyond counts as background.
constexpr int kMostLayers = 256;
// Presence below which point samples look through a surface.
constexpr float kThere = 0.5f;
// Seed of the filtered samples, whatever the render's seed.
constexpr uint32_t kFirstHitSeed = 0x2545f491u;

// Albedo: reflectance (and transmittance) at normal incidence, which a denoiser divides by. It does not depend on the view and
// never exceeds 1: F0 + (1 - F0) (diffuse + transmission), under the clearcoat's share.
template <int W>
PRIMRAY_INLINE vvec3<W> normal_albedo(const SurfaceRows<W>& rows, const vvec3<W>& color) {
  const vvec3<W> one(vfloat<W>(1.0f)), f0 = rows.color(kF0);
  const vvec3<W> base = f0 + (one - f0) * (rows.color(kDiffuse) * color + vvec3<W>(rows(kTransmission)));
  const vfloat<W> coat = rows(kClearcoat) * rows(kClearcoatF0);
  return base * (1.0f - coat) + vvec3<W>(coat);
}

struct PixelRect {
  int x0, y0, x1, y1;
};

template <int W>
class FirstHitTask {
 public:
  FirstHitTask(const Scene& scene, FirstHitPlanes& planes)
      : scene_(scene),
        planes_(planes),
        at_frame_(scene.camera.moves ? scene.camera.at(scene.motion.frame) : scene.camera),
        beginning_(scene.camera.moves ? scene.camera.at(0.0f) : scene.camera),
        end_(scene.camera.moves ? scene.camera.at(1.0f) : scene.camera),
        center_(at_frame_),
        time_(scene.motion.frame),
        unit_(1.0 / scene.scale),
        volumes_(scene) {
    center_.lens_radius = 0;
    center_.filter.box_width = 0;
    center_.filter.inverse_cdf.clear();
  }

  void points(const PixelRect& r) {
    reads_inputs_ = !planes_.normal.empty() || planes_.presence_varies;
    const int width = r.x1 - r.x0, count = width * (r.y1 - r.y0);
    for (int at = 0; at < count; at += W) {
      const I n = I(at) + lane_numbers<W>();
      alignas(64) int32_t x[W], y[W];
      for (int i = 0; i < W; ++i) {
        const int k = n[i] < count ? n[i] : count - 1;
        x[i] = r.x0 + k % width, y[i] = r.y0 + k / width;
      }
      const F half(0.5f), zero(0.0f);
      const CameraRay<W> ray = center_.template ray<W>(frame_x(x), frame_y(y), half, half, zero, zero, time_);
      B active = n < I(count);
      clear(active, x, y);
      const auto seen = [&](B hit, const Hits<W>& hits, const Interaction<W>& it, const SurfaceRows<W>& rows, Bend<W>&) {
        const B there = hit & (rows(kPresence) >= F(kThere));
        if (any(there)) write(there, x, y, ray, hits, it);
        return hit & !there;
      };
      follow(active & ray.exists(), ray, time_, nullptr, nullptr, std::ref(seen));
    }
    reads_inputs_ = true;
  }

  // Emission of a surface that the camera sees along unit `d`, times its presence.
  vvec3<W> shown(vbool<W> hit, const Hits<W>& hits, const Interaction<W>& it, const SurfaceRows<W>& rows,
                 const vvec3<W>& d) const {
    const F presence = rows(kPresence);
    const V glow = rows.color(kEmission) * presence;
    if (!scene_.geometry_lights.any()) return glow;
    PathLanes<W> p;
    p.ray.d = d, p.bsdf_pdf = F(0.0f), p.diffuse_share = V(F(0.0f)), p.depth = I(0), p.link = I(kUnlinkedRow);
    return shown_emission(scene_, hit, hits, it, p, glow, presence);
  }

  void filtered(const PixelRect& r) { means(r, false, planes_.albedo, planes_.emission); }

  void occlusion(const PixelRect& r) {
    const int slots = (r.x1 - r.x0) * (r.y1 - r.y0) * kFilteredSamples;
    double sum = 0;
    for (int at = 0; at < slots; at += W) {
      alignas(64) int32_t x[W], y[W];
      alignas(64) uint32_t index[W];
      place(r, at, slots, x, y, index);
      const I px = frame_x(x), py = frame_y(y);
      const auto seed = Sampler<W>::pixel_seed(kFirstHitSeed, px, py, vuint<W>(planes_.replicate));
      const Sampler<W> sampler{reverse_bits(load<W>(index)), seed};
      const Pair<W> film = sampler.pair(I(0), Purpose::kFilm), lens = sampler.pair(I(0), Purpose::kLens);
      const CameraRay<W> ray = at_frame_.template ray<W>(px, py, film.u, film.v, lens.u, lens.v, time_);
      F open(0.0f), left(1.0f);
      const auto seen = [&](B hit, const Hits<W>&, const Interaction<W>& it, const SurfaceRows<W>& rows, Bend<W>&) {
        const F presence = rows(kPresence);
        open += select(hit, left * presence * open_share(hit, it, ray.d, sampler), F(0.0f));
        left = select(hit, left * (1.0f - presence), left);
        return hit & (left > F(0.0f));
      };
      follow((I(at) + lane_numbers<W>() < I(slots)) & ray.exists(), ray, time_, nullptr, nullptr, std::ref(seen));
      open += left;
      // Add in the order of the samples, so that the result does not depend on the lane count.
      for (int i = 0; i < W && at + i < slots; ++i) {
        sum += double(open[i]);
        if (index[i] != kFilteredSamples - 1) continue;
        planes_.occlusion[pixel_of(x[i], y[i])] = float(sum / kFilteredSamples);
        sum = 0;
      }
    }
  }

  // Coverage by every sample that the film's tile has taken, and no others.
  void coverage(const PixelRect& r) {
    const CoveragePlanes& planes = planes_.coverage;
    const size_t across = size_t(scene_.camera.pixels.width + kTile - 1) / kTile;
    const size_t tile = size_t(r.y0 / kTile) * across + size_t(r.x0 / kTile), tiles = planes.end.size() / kReplicates;
    const int pixels = (r.x1 - r.x0) * (r.y1 - r.y0);
    for (uint32_t replicate = 0; replicate < uint32_t(kReplicates); ++replicate) {
      const uint32_t first = planes.first[replicate * tiles + tile], end = planes.end[replicate * tiles + tile];
      const int64_t slots = int64_t(pixels) * (end - first);
      for (int64_t at = 0; at < slots; at += W) cover(r, replicate, first, end - first, at, slots);
    }
  }

  // Surfaces along the rays of one task's points.
  void layers(LayerPoints& points, size_t task) {
    const size_t begin = task * LayerPoints::kTask, end = std::min(begin + LayerPoints::kTask, points.x.size());
    std::vector<Layer> lane_layers[W];
    reads_inputs_ = points.presence_varies;
    Camera camera = scene_.motion.rolls ? scene_.camera : at_frame_;
    camera.lens_radius = 0, camera.filter.box_width = 1, camera.filter.inverse_cdf.clear();
    for (size_t at = begin; at < end; at += W) {
      alignas(64) int32_t x[W], y[W], lane[W];
      alignas(64) float u[W], v[W];
      for (int i = 0; i < W; ++i) {
        const size_t k = std::min(at + size_t(i), end - 1);
        const float px = std::floor(points.x[k]), py = std::floor(points.y[k]);
        x[i] = int32_t(px), y[i] = int32_t(py), u[i] = points.x[k] - px, v[i] = points.y[k] - py;
        lane[i] = at + size_t(i) < end ? 1 : 0;
        lane_layers[i].clear();
      }
      const I column = load<W>(x), row = load<W>(y);
      const F time = row_time(column, row), zero(0.0f);
      const CameraRay<W> ray = camera.template ray<W>(column, row, load<W>(u), load<W>(v), zero, zero, time);
      const auto seen = [&](B hit, const Hits<W>& hits, const Interaction<W>& it, const SurfaceRows<W>& rows, Bend<W>&) {
        const B there = hit & (rows(kPresence) >= F(kThere));
        if (any(there)) add_layers(there, ray, time, hits, it, lane_layers);
        return points.first_only ? hit & !there : hit;
      };
      follow((load<W>(lane) == I(1)) & ray.exists(), ray, time, nullptr, nullptr, std::ref(seen));
      for (int i = 0; i < W && at + size_t(i) < end; ++i) {
        points.count[at + size_t(i)] = uint32_t(lane_layers[i].size());
        points.by_task[task].insert(points.by_task[task].end(), lane_layers[i].begin(), lane_layers[i].end());
      }
    }
  }

  // Denoiser guides over the lens, the filter and the shutter interval, so that their edges are as soft as the image's.
  void guides(const PixelRect& r) { means(r, true, planes_.guide_albedo, planes_.guide_normal); }

 private:
  using F = vfloat<W>;
  using I = vint<W>;
  using B = vbool<W>;
  using V = vvec3<W>;

  // Pixels and sample indices of W slots from `at` on: kFilteredSamples for each pixel of the rectangle, one pixel after the
  // other. Surplus lanes repeat the last slot.
  static void place(const PixelRect& r, int at, int slots, int32_t (&x)[W], int32_t (&y)[W], uint32_t (&index)[W]) {
    const int width = r.x1 - r.x0;
    for (int i = 0; i < W; ++i) {
      const int slot = at + i < slots ? at + i : slots - 1, pixel = slot / kFilteredSamples;
      x[i] = r.x0 + pixel % width, y[i] = r.y0 + pixel / width, index[i] = uint32_t(slot % kFilteredSamples);
    }
  }

  // Share of kOcclusionRays rays, from a surface seen along `d`, that hit nothing.
  F open_share(B hit, const Interaction<W>& it, const V& d, const Sampler<W>& sampler) const {
    const F side = copysign(F(1.0f), -dot(it.ng, d));
    const V n = it.ng * side;
    const Frame<F> frame(n);
    F share(0.0f);
    for (int k = 0; k < kOcclusionRays; ++k) {
      const Pair<W> u = sampler.pair(I(k + 1), Purpose::kLobe);
      F x, y;
      concentric_disk<W>(u.u, u.v, x, y);  // Malley's method: cosine-weighted
      const F z = sqrt(max(1.0f - x * x - y * y, 0.0f));
      const Rays<W> rays{it.p + n * it.offset, frame.s * x + frame.t * y + n * z, F(0.0f),
                         F(float(double(planes_.occlusion_distance) * scene_.scale)), time_};
      share += select(hit & !occluded(scene_, false, hit, rays), F(1.0f / kOcclusionRays), F(0.0f));
    }
    return share;
  }

  // Adds coverage of the slots from `at` on, of `count` samples per pixel.
  void cover(const PixelRect& r, uint32_t replicate, uint32_t first, uint32_t count, int64_t at, int64_t slots) {
    const CoveragePlanes& planes = planes_.coverage;
    const int width = r.x1 - r.x0;
    alignas(64) int32_t x[W], y[W];
    alignas(64) uint32_t index[W];
    for (int i = 0; i < W; ++i) {
      const int64_t slot = std::min(at + i, slots - 1);
      const int pixel = int(slot / count);
      x[i] = r.x0 + pixel % width, y[i] = r.y0 + pixel / width, index[i] = first + uint32_t(slot % count);
    }
    const I px = frame_x(x), py = frame_y(y);
    const auto sampler = Sampler<W>::of(planes.seed, px, py, vuint<W>(replicate), load<W>(index), planes.screen_block);
    const Pair<W> film = sampler.link(I(planes.first_link));
    Pair<W> lens{F(0.5f), F(0.5f)};
    if (scene_.camera.has_lens()) lens = sampler.pair(I(0), Purpose::kLens);
    const F time = scene_.moves() ? shutter_time(sampler, px, py) : time_;
    V weight(F(1.0f));
    CameraRay<W> ray;
    if (scene_.camera.flawed) {
      const F channel = scene_.camera.flaws.is_chromatic ? sampler.single(I(0), kColorChannel) : F(0.0f);
      ray = scene_.camera.template flawed_ray<W>(px, py, film, lens, time, channel, weight);
    } else {
      ray = scene_.camera.template ray<W>(px, py, film.u, film.v, lens.u, lens.v, time);
    }
    F left(1.0f);
    V beta(F(1.0f));
    const auto add = [&](int i, Covering covering, float share) {
      covering.share = std::llround(double(share) * double(Film::kCovered));
      if (covering.share > 0) add_covering(planes_.coverage.by_pixel[pixel_of(x[i], y[i])], covering);
    };
    const auto collide = [&](B m, const WayToHit<W>& way, I vertex) {
      return volumes_.collide(m, way, sampler, vertex, beta, left,
                              [&](int i, const SeenVolume& volume, float share) { add(i, covering_of(volume), share); });
    };
    const auto seen = [&](B hit, const Hits<W>& hits, const Interaction<W>& it, const SurfaceRows<W>& rows, Bend<W>&) {
      const HitGroup<W> in(scene_, hit, hits);
      const SurfacePoint<W> point(scene_, hit, hits);
      const F presence = rows(kPresence), share = left * presence;
      for (uint32_t b = bits(hit); b; b &= b - 1) {
        const int i = __builtin_ctz(b);
        const int32_t instance = in.instanced[i] ? in.instance[i] : -1, outer = in.grouped[i] ? in.outer[i] : -1;
        const int32_t shape = point.is_triangle[i] ? it.mesh[i] : -2 - it.curved[i];
        add(i, {shape, it.surface[i], instance, outer, 0}, share[i]);
      }
      left = select(hit, left * (1.0f - presence), left);
      return hit & (left > F(0.0f));
    };
    alignas(64) int32_t lane[W];
    for (int i = 0; i < W; ++i) lane[i] = at + i < slots ? 1 : 0;
    follow((load<W>(lane) == I(1)) & ray.exists(), ray, time, nullptr, std::ref(collide), std::ref(seen));
  }

  // What covers pixels where they show a volume.
  Covering covering_of(const SeenVolume& volume) const {
    if (volume.kind == SeenVolume::kGrid) return {-1, 0, volume.medium, -1, 0};
    if (volume.kind == SeenVolume::kFog) return {-1, 1, -1, -1, 0};
    const auto find = [&](const std::vector<int32_t>& of, int32_t surface) {
      const auto at = std::find(of.begin(), of.end(), surface);
      return at == of.end() ? -1 : int32_t(at - of.begin());
    };
    const VolumeObject& object = volume.object;
    const int32_t surface = find(scene_.interiors.volume_of, object.volume), mesh = find(scene_.meshes.surface, surface);
    const int32_t shape = mesh >= 0 ? mesh : -2 - find(scene_.curved.surface, surface);
    return {shape, surface, object.instance, object.outer, 0};
  }

  // Adds what lanes `m` hit to their layers, unless it is there.
  void add_layers(B m, const CameraRay<W>& ray, F time, const Hits<W>& hits, const Interaction<W>& it,
                  std::vector<Layer> (&lane_layers)[W]) const {
    const HitGroup<W> in(scene_, m, hits);
    const SurfacePoint<W> point(scene_, m, hits);
    for (uint32_t b = bits(m); b; b &= b - 1) {
      const int i = __builtin_ctz(b);
      Layer layer{point.is_triangle[i] ? it.mesh[i] : -2 - it.curved[i], in.instanced[i] ? in.instance[i] : -1,
                  in.grouped[i] ? in.outer[i] : -1, 0, 0};
      const auto is_same = [&](const Layer& o) {
        return o.shape == layer.shape && o.instance == layer.instance && o.outer == layer.outer;
      };
      if (std::any_of(lane_layers[i].begin(), lane_layers[i].end(), is_same)) continue;
      const Affine<float> c = scene_.motion.rolls ? scene_.camera.pose_at(time[i]) : at_frame_.world_from_camera;
      const dvec3 at{it.p.x[i], it.p.y[i], it.p.z[i]}, from{ray.o.x[i], ray.o.y[i], ray.o.z[i]};
      layer.depth = float(-dot(at - dvec3(c.o), dvec3(c.z)) * unit_);
      layer.distance = float(dot(at - from, {ray.d.x[i], ray.d.y[i], ray.d.z[i]}) * unit_);
      lane_layers[i].push_back(layer);
    }
  }

  // The frame's time, or with a rolling shutter the middle of the exposure of a pixel's row and column.
  F row_time(I px, I py) const {
    const MotionTable& motion = scene_.motion;
    if (!motion.rolls) return time_;
    const I column = max(min(px, I(scene_.camera.width - 1)), I(0)), row = max(min(py, I(scene_.camera.height - 1)), I(0));
    const F time =
        F(motion.opens + 0.5f * motion.length) + to_float(column) * motion.per_column + to_float(row) * motion.per_row;
    return min(max(time, 0.0f), F(1.0f));
  }

  F shutter_time(const Sampler<W>& sampler, I px, I py) const {
    const MotionTable& motion = scene_.motion;
    const F time = motion.opens + sampler.single(I(0), kShutterTime) * motion.length;
    if (!motion.rolls) return time;
    return min(max(time + to_float(px) * motion.per_column + to_float(py) * motion.per_row, 0.0f), F(1.0f));
  }

  // Computes means over a pixel's samples: of albedo, and of emission or, for guides, of normals; of the opacity of volumes and
  // the depth of their collisions.
  void means(const PixelRect& r, bool guide, std::vector<float>& first, std::vector<float>& second) {
    const int slots = (r.x1 - r.x0) * (r.y1 - r.y0) * kFilteredSamples;
    const vuint<W> replicate(planes_.replicate);
    constexpr int kSums = 11;
    double sums[kSums] = {};
    for (int at = 0; at < slots; at += W) {
      alignas(64) int32_t x[W], y[W];
      alignas(64) uint32_t index[W];
      place(r, at, slots, x, y, index);
      const I px = frame_x(x), py = frame_y(y);
      const Sampler<W> sampler{reverse_bits(load<W>(index)), Sampler<W>::pixel_seed(kFirstHitSeed, px, py, replicate)};
      const Pair<W> film = sampler.pair(I(0), Purpose::kFilm), lens = sampler.pair(I(0), Purpose::kLens);
      const F time = guide && scene_.moves() ? shutter_time(sampler, px, py) : time_;
      const Camera& camera = guide ? scene_.camera : at_frame_;
      const CameraRay<W> ray = camera.template ray<W>(px, py, film.u, film.v, lens.u, lens.v, time);
      V albedo(F(0.0f)), emission(F(0.0f));
      V opacity(F(0.0f));
      F depth(0.0f), depth_weight(0.0f);
      F left(1.0f);  // share of the view that no layer has covered yet
      V tint(F(1.0f));
      const auto cross_volumes = [&](B m, const WayToHit<W>& way, I layer) {
        const auto in = volumes_.opacity(m, way, sampler, layer);
        const F share = (in.opacity.x + in.opacity.y + in.opacity.z) * (1.0f / 3);
        albedo += select(m, in.colored * left * tint, V(F(0.0f)));
        opacity += select(m, in.opacity * left, V(F(0.0f)));
        depth += select(m, along_axis(way.ray, in.weighted_distance, share) * left, F(0.0f));
        depth_weight += select(m, share * left, F(0.0f));
        left = select(m, left * max(1.0f - share, 0.0f), left);
        return m;
      };
      const auto passed_lights = [&](B m, const V& light) {
        if (!guide) emission += select(m, light * left, V(F(0.0f)));
      };
      I smooth(0);
      const auto seen = [&](B hit, const Hits<W>& hits, const Interaction<W>& it, const SurfaceRows<W>& rows, Bend<W>& bend) {
        const F presence = rows(kPresence);
        const F share = left * presence;
        B here = hit;
        if (guide) {
          const V d = bend.d;
          bend_at_smooth(hit & (smooth < I(kMostSmooth)), it, rows, sampler.single(smooth + I(1), Purpose::kLobe), bend);
          here &= !bend.lanes;
          emission += select(here, it.ns * copysign(share, -dot(it.ng, d)), V(F(0.0f)));
        } else if (scene_.has_emission) {
          emission += select(hit, shown(hit, hits, it, rows, ray.d) * left, V(F(0.0f)));
        }
        albedo += select(here, normal_albedo(rows, it.color) * share * tint, V(F(0.0f)));
        if (guide) {
          tint = select(bend.lanes, tint * bend.tint, tint);
          smooth = select(bend.lanes, smooth + I(1), smooth);
        }
        left = select(here, left * (1.0f - presence), left);
        return hit & (left > F(0.0f));
      };
      follow((I(at) + lane_numbers<W>() < I(slots)) & ray.exists(), ray, time, std::ref(passed_lights), std::ref(cross_volumes),
             std::ref(seen));
      // Add in the order of the samples, so that the result does not depend on the lane count.
      for (int i = 0; i < W && at + i < slots; ++i) {
        const float own[kSums] = {albedo.x[i],  albedo.y[i],  albedo.z[i],  emission.x[i], emission.y[i],  emission.z[i],
                                  opacity.x[i], opacity.y[i], opacity.z[i], depth[i],      depth_weight[i]};
        for (int c = 0; c < kSums; ++c) sums[c] += own[c];
        if (index[i] != kFilteredSamples - 1) continue;
        const size_t p = pixel_of(x[i], y[i]);
        for (int c = 0; c < 3; ++c) {
          if (!first.empty()) first[3 * p + c] = float(sums[c] / kFilteredSamples);
          if (!second.empty()) second[3 * p + c] = float(sums[3 + c] / kFilteredSamples);
          if (!guide && !planes_.volume_opacity.empty())
            planes_.volume_opacity[3 * p + c] = float(sums[6 + c] / kFilteredSamples);
        }
        if (!guide && !planes_.volume_depth.empty())
          planes_.volume_depth[p] = sums[10] > 0 ? float(sums[9] / sums[10]) : std::numeric_limits<float>::infinity();
        for (double& s : sums) s = 0;
      }
    }
  }

  // Depth of points of the rays, in scene units: `distance` and the result are multiplied by `weight`.
  F along_axis(const Rays<W>& ray, F distance, F weight) const {
    const Affine<float>& c = at_frame_.world_from_camera;
    const V z{F(c.z.x), F(c.z.y), F(c.z.z)};
    return -(dot(ray.o - V{F(c.o.x), F(c.o.y), F(c.o.z)}, z) * weight + dot(ray.d, z) * distance) * float(unit_);
  }

  // Pixels are counted on the film, but by the camera on the frame that contains it.
  size_t pixel_of(int x, int y) const { return size_t(y) * scene_.camera.pixels.width + x; }
  I frame_x(const int32_t* x) const { return load<W>(x) + I(scene_.camera.pixels.x); }
  I frame_y(const int32_t* y) const { return load<W>(y) + I(scene_.camera.pixels.y); }

  // Follows the rays from surface to surface. `light(lanes, L)`, if given: L comes from lights and domes hit before the next
  // surface; `cross(lanes, way, vertex)`, if there are volumes, returns the lanes that reach it; `surface(lanes, ...)` returns
  // the lanes that look through the surface, and may bend them. Compiled once for all kinds of samples, which halves a long
  // compilation.
  using Light = std::function<void(B, const V&)>;
  using Cross = std::function<B(B, const WayToHit<W>&, I)>;
  using Surface = std::function<B(B, const Hits<W>&, const Interaction<W>&, const SurfaceRows<W>&, Bend<W>&)>;
  [[gnu::noinline]] void follow(B active, const CameraRay<W>& from, F time, const Light& light, const Cross& cross,
                                const Surface& surface) {
    PathLanes<W> p;
    p.ray = {from.o, from.d, from.tnear, from.tfar, time};
    p.beta = V(F(1.0f)), p.diffuse_share = p.normal = V(F(0.0f));
    p.bsdf_pdf = p.travelled = F(0.0f), p.splits = F(1.0f);
    p.cone_width = F(at_frame_.cone_width()), p.cone_spread = F(at_frame_.cone_spread());
    p.slot = p.depth = p.vertex = I(0), p.link = I(kUnlinkedRow);
    B direct(true);
    const bool follows_volumes = cross && volumes_.any();
    WayToHit<W> way;
    if (follows_volumes) way.sets = volumes_.camera_sets(), way.origin_distance = F(0.0f);
    for (int layer = 0; layer < kMostLayers && any(active); ++layer) {
      const Hits<W> hits = intersect(scene_, true, active, p.ray);
      B hit = active & (hits.geom != I(-1));
      V gathered(F(0.0f));
      const LightHits<W> light_hits = intersect_lights(scene_.lights, active, hit, p, hits.t, gathered);
      const B covered = light_hits.covered;
      if (follows_volumes) active = cross_volumes(active, hit, hits, light_hits, p, way, cross);
      hit &= active & !covered;
      if (light) {
        const B escaped = active & !hit & !covered;
        if (!scene_.lights.domes.empty() && any(escaped))
          gathered += select(escaped, evaluate_domes(scene_.lights, escaped, p), V(F(0.0f)));
        light(active, gathered);
      }
      if (!any(hit)) return;
      Interaction<W> it = interact(scene_, hit, p.ray, hits);
      const B bounds = bounds_volume(scene_, hit, it.surface);  // light passes
      B hidden = bounds;
      hit &= !hidden;
      if (follows_volumes) volumes_.cross(bounds, hits, it, p.ray.d, way.sets);
      if (scene_.camera_visibility.any()) {
        hidden |= scene_.camera_visibility.lanes_with(CameraVisibility::kHidden, hit & direct, it.surface);
        hit &= !(hidden | scene_.camera_visibility.lanes_with(CameraVisibility::kMatte, hit & direct, it.surface));
      }
      SurfaceRows<W> rows(scene_.surfaces, it.surface);
      LaneRows<W> varying;
      if (reads_inputs_ && any_inputs(scene_, hit, it.surface)) {
        const F width = p.cone_width + p.cone_spread * hits.t, cosine = abs(dot(it.ng, p.ray.d));
        rows = evaluate_inputs(scene_, hit, hits, it.surface, width * width / max(cosine, 0.05f), it.p, it.ng, it.ns, varying);
      }
      Bend<W> bend{B(false), p.ray.d, V(F(1.0f))};
      active = surface(hit, hits, it, rows, bend) | hidden;
      if (!any(active)) return;
      // Continue beyond the surface, as paths pass straight through it, or reflected.
      const F side = copysign(F(1.0f), dot(it.ng, bend.d));
      const V o = select(bounds, p.ray.o, it.p + it.ng * (it.offset * side));
      const F gone = select(bounds, F(0.0f), dot(it.p - p.ray.o, p.ray.d));
      p.travelled += gone;
      p.cone_width += p.cone_spread * gone;
      p.ray.tfar = select(bend.lanes, F(kInfinity), p.ray.tfar - dot(o - p.ray.o, p.ray.d));
      // Boundaries of volumes are passed without an offset, as by paths (integrator/camera_visibility.hpp).
      p.ray.tnear = select(bounds, behind_boundary(hits.t, it.offset), F(0.0f));
      if (follows_volumes) way.origin_distance = select(bounds, -hits.t, F(0.0f));
      p.ray.o = o, p.ray.d = bend.d;
      p.vertex += I(1);
      direct &= !bend.lanes;
      active &= p.ray.tfar > F(0.0f);
    }
  }

  // Calls `cross` for the way of the rays up to what they hit; returns the lanes that get there.
  B cross_volumes(B active, B hit, const Hits<W>& hits, const LightHits<W>& lights, const PathLanes<W>& p, WayToHit<W>& way,
                  const Cross& cross) {
    way.ray = p.ray, way.closed = hit | (p.ray.tfar < F(kInfinity));
    way.end = select(hit, hits.t, p.ray.tfar), way.light = select(lights.covered, lights.nearest, F(kInfinity));
    if (scene_.interiors.has_bounded() && any(hit))
      volumes_.enter_missed_before(hit, hits, interact(scene_, hit, p.ray, hits), p.ray.d, way.sets);
    return active & cross(active, way, p.vertex);
  }

  static void put(std::vector<float>& plane, size_t p, const V& v, int i) {
    if (!plane.empty()) plane[3 * p] = v.x[i], plane[3 * p + 1] = v.y[i], plane[3 * p + 2] = v.z[i];
  }

  // Sets the point samples of pixels to their values where nothing is hit.
  void clear(B m, const int32_t* x, const int32_t* y) {
    planes_.for_each([&]<class T>(const char*, std::vector<T>& plane, size_t width, FirstHitSampling sampling, double nothing) {
      if (plane.empty() || sampling != FirstHitSampling::kPoint) return;
      for (uint32_t b = bits(m); b; b &= b - 1) {
        const int i = __builtin_ctz(b);
        std::fill_n(&plane[pixel_of(x[i], y[i]) * width], width, T(nothing));
      }
    });
  }

  void write(B m, const int32_t* x, const int32_t* y, const CameraRay<W>& ray, const Hits<W>& hits, const Interaction<W>& it) {
    const HitGroup<W> in(scene_, m, hits);
    const SurfacePoint<W> point(scene_, m, hits);
    const F side = copysign(F(1.0f), -dot(it.ng, ray.d));
    const V ng = it.ng * side, ns = it.ns * side;
    const Affine<float>& c = at_frame_.world_from_camera;
    for (uint32_t b = bits(m); b; b &= b - 1) {
      const int i = __builtin_ctz(b);
      const size_t p = pixel_of(x[i], y[i]);
      const dvec3 at{it.p.x[i], it.p.y[i], it.p.z[i]};
      const dvec3 from_camera = at - dvec3(c.o), along{ray.d.x[i], ray.d.y[i], ray.d.z[i]};
      const dvec3 from_start = at - dvec3(ray.o.x[i], ray.o.y[i], ray.o.z[i]);
      const dvec3 seen{dot(from_camera, dvec3(c.x)), dot(from_camera, dvec3(c.y)), dot(from_camera, dvec3(c.z))};
      if (!planes_.depth.empty()) planes_.depth[p] = float(-seen.z * unit_);
      if (!planes_.distance.empty()) planes_.distance[p] = float(dot(from_start, along) * unit_);
      if (!planes_.position.empty()) {
        const dvec3 world = scene_.origin + at * unit_;
        planes_.position[3 * p] = world.x, planes_.position[3 * p + 1] = world.y, planes_.position[3 * p + 2] = world.z;
      }
      if (!planes_.camera_position.empty()) {
        float* to = &planes_.camera_position[3 * p];
        to[0] = float(seen.x * unit_), to[1] = float(seen.y * unit_), to[2] = float(seen.z * unit_);
      }
      put(planes_.normal, p, ns, i), put(planes_.geometric, p, ng, i);
      if (!planes_.shape.empty()) planes_.shape[p] = point.is_triangle[i] ? it.mesh[i] : -2 - it.curved[i];
      if (!planes_.surface.empty()) planes_.surface[p] = it.surface[i];
      if (!planes_.instance.empty() && in.instanced[i]) planes_.instance[p] = in.instance[i];
      if (!planes_.outer.empty() && in.grouped[i]) planes_.outer[p] = in.outer[i];
    }
    for (PrimvarPlane& plane : planes_.primvars) write_primvar(plane, m, x, y, point);
    if (!scene_.moves()) return;
    if (!planes_.forward.empty()) write_motion(planes_.forward, end_, F(1.0f), m, x, y, hits);
    if (!planes_.backward.empty()) write_motion(planes_.backward, beginning_, F(0.0f), m, x, y, hits);
  }

  // Motion vector from the pixel where the camera sees a point at the frame time to where it does at another time; a point that
  // is then behind the camera has not moved.
  void write_motion(std::vector<float>& plane, const Camera& then, F time, B m, const int32_t* x, const int32_t* y,
                    const Hits<W>& hits) {
    const V from = place_of(m, hits, time_), to = place_of(m, hits, time);
    for (uint32_t b = bits(m); b; b &= b - 1) {
      const int i = __builtin_ctz(b);
      const size_t p = 2 * pixel_of(x[i], y[i]);
      double a[2] = {x[i] + scene_.camera.pixels.x + 0.5, y[i] + scene_.camera.pixels.y + 0.5};
      if (!at_frame_.project({from.x[i], from.y[i], from.z[i]}, a)) continue;
      double z[2] = {a[0], a[1]};
      if (!then.project({to.x[i], to.y[i], to.z[i]}, z)) continue;
      plane[p] = float(z[0] - a[0]), plane[p + 1] = float(z[1] - a[1]);
    }
  }
  // Positions of the points that were hit at another time.
  V place_of(B m, Hits<W> hits, F time) const {
    hits.time = time;
    // A ray from so far away is never used to compute the point.
    Rays<W> far{V(F(1e18f)), V(F(0.0f)), F(0.0f), F(0.0f), time};
    return interact(scene_, m, far, hits).p;
  }
  void write_primvar(PrimvarPlane& plane, B m, const int32_t* x, const int32_t* y, const SurfacePoint<W>& point) {
    const PrimvarLanes<W> whole(scene_, m, point, plane.names[1]), read(scene_, m, point, plane.names[0]);
    for (int k = 0; k < plane.width; ++k) {
      const F a = whole.interpolate(scene_, point, k, 0.0f), b = read.interpolate(scene_, point, k, 0.0f);
      for (uint32_t left = bits(m); left; left &= left - 1) {
        const int i = __builtin_ctz(left);
        const PrimvarLanes<W>& own = whole.present[i] ? whole : read;
        const bool has = own.present[i] && k < own.width[i];
        plane.values[pixel_of(x[i], y[i]) * plane.width + k] = has ? (whole.present[i] ? a[i] : b[i]) : 0.0f;
      }
    }
  }

  const Scene& scene_;
  FirstHitPlanes& planes_;
  const Camera at_frame_;
  const Camera beginning_, end_;  // of the span
  Camera center_;                 // without lens and filter
  const F time_;
  const double unit_;
  FirstHitVolumes<W> volumes_;
  bool reads_inputs_ = true;  // else surfaces are those of their constants: their presence is right if it does not vary
};

// Fills the pixels of a rectangle.
template <int W>
void fill_first_hits(const Scene& scene, const PixelRect& r, FirstHitPlanes& planes) {
  FirstHitTask<W> task(scene, planes);
  if (planes.wants(FirstHitSampling::kPoint)) task.points(r);
  if (planes.wants(FirstHitSampling::kFiltered)) task.filtered(r);
  if (planes.wants(FirstHitSampling::kGuide)) task.guides(r);
  if (planes.wants(FirstHitSampling::kOcclusion)) task.occlusion(r);
  if (!planes.coverage.by_pixel.empty()) task.coverage(r);
}

// Fills the points of one task.
template <int W>
void fill_layers(const Scene& scene, size_t task, LayerPoints& points) {
  FirstHitPlanes none;
  FirstHitTask<W>(scene, none).layers(points, task);
}

}  // namespace primray
