// The path loop. Included by lanes_<W>.cpp alone, one translation unit for each number of lanes.
#pragma once

#include <algorithm>
#include <cmath>

#include "integrator/ray_recorder.hpp"
#include "integrator/tile_task.hpp"

namespace primray {

// Shadow rays end, and lights are met, this much early or late: points on a light are only so exact.
constexpr float kNearlyOne = 1 - 0x1p-16f;

template <int W>
class TilePaths {
 public:
  TilePaths(const Scene& scene, const IntegratorSettings& settings, const TileBlock& block, Worker& worker, RayRecorder* recorder)
      : scene_(scene), settings_(settings), block_(block), w_(worker), recorder_(recorder), samples_(block.count[0] + block.count[1]) {}

  void run() {
    list_pixels();
    const int slots = pixels_ * samples_;
    std::fill_n(w_.r, slots, 0.0f), std::fill_n(w_.g, slots, 0.0f), std::fill_n(w_.b, slots, 0.0f), std::fill_n(w_.a, slots, 0.0f);
    w_.pool.count = 0;
    while (true) {
      refill(slots);
      if (w_.pool.count == 0) break;
      trace();
      shade();
      trace_shadows();
    }
  }

  void add_to(Film& film) const {
    int64_t invalid = 0;
    for (int i = 0; i < pixels_; ++i) {
      int slot = i * samples_;
      for (int replicate = 0; replicate < kReplicates; ++replicate) {
        double sum[Film::kChannels] = {};
        uint32_t n = 0;
        for (int s = 0; s < block_.count[replicate]; ++s, ++slot) {
          const float c[] = {w_.r[slot], w_.g[slot], w_.b[slot], w_.a[slot]};
          if (!std::isfinite(c[0]) || !std::isfinite(c[1]) || !std::isfinite(c[2])) {
            ++invalid;
            continue;
          }
          for (int k = 0; k < Film::kChannels; ++k) sum[k] += double(c[k]);
          ++n;
        }
        const size_t p = film.pixel(replicate, block_.x0 + w_.pixel_x[i], block_.y0 + w_.pixel_y[i]);
        for (int k = 0; k < Film::kChannels; ++k) film.sums[p * Film::kChannels + k] += sum[k];
        film.counts[p] += n;
      }
    }
    film.invalid_samples += invalid;
    film.samples += int64_t(pixels_) * samples_;
  }

 private:
  using F = vfloat<W>;
  using I = vint<W>;
  using B = vbool<W>;
  using V = vvec3<W>;

  // Pixels in Morton order, so that neighbours in a packet are neighbours on the film.
  void list_pixels() {
    pixels_ = 0;
    for (int m = 0; m < kTile * kTile; ++m) {
      int x = 0, y = 0;
      for (int b = 0; (1 << b) < kTile; ++b) x |= (m >> (2 * b) & 1) << b, y |= (m >> (2 * b + 1) & 1) << b;
      if (block_.x0 + x < block_.x1 && block_.y0 + y < block_.y1) w_.pixel_x[pixels_] = uint8_t(x), w_.pixel_y[pixels_] = uint8_t(y), ++pixels_;
    }
  }

  void refill(int slots) {
    PathPool& pool = w_.pool;
    first_camera_ = pool.count;
    while (next_slot_ < slots && pool.count + W <= kPool) {
      alignas(64) int32_t x[W], y[W], slot[W];
      alignas(64) uint32_t index[W], replicate[W];
      const int n = std::min(W, slots - next_slot_);
      for (int i = 0; i < W; ++i) {
        const int s = std::min(next_slot_ + i, slots - 1), pixel = s / samples_, k = s - pixel * samples_;
        const int r = k < block_.count[0] ? 0 : 1;
        x[i] = block_.x0 + w_.pixel_x[pixel], y[i] = block_.y0 + w_.pixel_y[pixel], slot[i] = s;
        index[i] = uint32_t(block_.first[r] + (r ? k - block_.count[0] : k)), replicate[i] = uint32_t(r);
      }
      const I px = load<W>(x), py = load<W>(y);
      const Sampler<W> sampler{reverse_bits(load<W>(index)), Sampler<W>::pixel_seed(settings_.seed, px, py, load<W>(replicate))};
      const Pair<W> film = sampler.pair(I(0), Purpose::kFilm);
      Pair<W> lens{F(0.5f), F(0.5f)};
      if (scene_.camera.lens_radius > 0) lens = sampler.pair(I(0), Purpose::kLens);
      const CameraRay<W> ray = scene_.camera.ray<W>(px, py, film.u, film.v, lens.u, lens.v);
      const int at = pool.count;
      store(pool.ox + at, ray.o.x), store(pool.oy + at, ray.o.y), store(pool.oz + at, ray.o.z);
      store(pool.dx + at, ray.d.x), store(pool.dy + at, ray.d.y), store(pool.dz + at, ray.d.z);
      store(pool.tnear + at, ray.tnear), store(pool.tfar + at, ray.tfar);
      store(pool.beta_r + at, F(1.0f)), store(pool.beta_g + at, F(1.0f)), store(pool.beta_b + at, F(1.0f));
      store(pool.bsdf_pdf + at, F(0.0f)), store(pool.slot + at, load<W>(slot)), store(pool.depth + at, I(0));
      store(pool.reversed_index + at, sampler.reversed_index), store(pool.seed + at, sampler.seed);
      pool.count += n;
      next_slot_ += n;
    }
    w_.camera_rays += pool.count - first_camera_;
    w_.scattered_rays += first_camera_;
  }

  void trace() {
    PathPool& pool = w_.pool;
    for (int at = 0; at < pool.count; at += W) {
      const B active = lane_numbers<W>() < I(pool.count - at);
      const Rays<W> rays = pool.rays<W>(at);
      EntryChoice& entry = at >= first_camera_ ? w_.camera_entry : w_.scattered_entry;
      const bool packet = entry.packet();
      if (recorder_) recorder_->record(false, packet, active, rays);
      const uint64_t start = entry.measuring() ? EntryChoice::now() : 0;
      const Hits<W> hits = packet ? intersect_packet(scene_.accel(), active, rays) : intersect_single(scene_.accel(), active, rays);
      if (entry.measuring()) entry.record(EntryChoice::now() - start, std::min(W, pool.count - at));
      pool.set_hits(at, hits);
    }
  }

  void shade() {
    PathPool& pool = w_.pool;
    const int count = pool.count;
    pool.count = 0;
    w_.shadows.count = 0;
    for (int at = 0; at < count; at += W) {
      w_.busy_lanes += std::min(W, count - at), w_.shaded_lanes += W;
      shade_lanes(at, lane_numbers<W>() < I(count - at));
    }
  }

  // Adds `c` to the slots of lanes `m`.
  void add(B m, I slot, const V& c) {
    for (uint32_t b = bits(m); b; b &= b - 1) {
      const int i = __builtin_ctz(b), s = slot[i];
      w_.r[s] += c.x[i], w_.g[s] += c.y[i], w_.b[s] += c.z[i];
    }
  }

  // One vertex of the paths at [at, at + W): light met, light sampled, next ray.
  void shade_lanes(int at, B active) {
    PathPool& pool = w_.pool;
    const Rays<W> ray = pool.rays<W>(at);
    const Hits<W> hits = pool.hits<W>(at);
    V beta{load<W>(pool.beta_r + at), load<W>(pool.beta_g + at), load<W>(pool.beta_b + at)};
    const F bsdf_pdf = load<W>(pool.bsdf_pdf + at);
    const I slot = load<W>(pool.slot + at), depth = load<W>(pool.depth + at);
    const Sampler<W> sampler{load<W>(pool.reversed_index + at), load<W>(pool.seed + at)};
    B hit = active & (hits.geom != I(-1));
    const B camera = active & (depth == I(0));

    // Light that the ray carries back from lights it meets, and from afar.
    V gathered(F(0.0f));
    const B covered_by_light = meet_lights(active, hit, ray, hits.t, bsdf_pdf, camera, gathered);
    hit = hit & !covered_by_light;
    meet_domes(active & !hit & !covered_by_light, ray, bsdf_pdf, camera, gathered);
    for (uint32_t b = bits(camera & (hit | covered_by_light)); b; b &= b - 1) w_.a[slot[__builtin_ctz(b)]] = 1.0f;
    if (!any(hit)) {
      add(active, slot, beta * gathered);
      return;
    }

    const Interaction<W> it = interact(scene_, hit, hits);
    if (scene_.has_emission) {
      const I base = it.surface * I(kSurfaceFields) + I(kEmission);
      gathered += select(hit, gather_vec3<W>(scene_.surfaces.rows.data(), base), V(F(0.0f)));
    }
    add(active, slot, beta * gathered);

    // Scatter, on the side of the surface where the ray came from.
    const B scatters = hit & (depth < I(settings_.max_depth));
    if (!any(scatters)) return;
    const V wo_world = -ray.d;
    const B front = dot(it.ng, wo_world) > F(0.0f);
    const F side = select(front, F(1.0f), F(-1.0f));
    const V ng = it.ng * side;
    V ns = it.ns * side;
    // A shading normal that faces away from the viewer cannot be seen: use the true one.
    ns = select(dot(ns, wo_world) > F(1e-4f), ns, ng);
    const Frame<F> frame(ns);
    V wo = frame.to_local(wo_world);
    Bsdf<W> bsdf(scene_.surfaces, it.surface, scatters, wo, front);
    bsdf.diffuse *= it.color;
    const I bounce = depth + I(1);
    const LightTable& lights = scene_.lights;
    if (lights.count > 0) sample_light(scatters, it, ng, frame, wo, bsdf, sampler, bounce, beta, slot);
    continue_paths(scatters, it, ng, frame, wo, bsdf, sampler, bounce, beta, slot);
  }

  // Emission of area and distant lights along the rays. Camera rays and rays after a mirror see the nearest light as a body: the
  // result marks them. Others pass through, as light samples do, and take each light with its MIS weight.
  B meet_lights(B active, B hit, const Rays<W>& ray, F t_surface, F bsdf_pdf, B camera, V& gathered) {
    const LightTable& lights = scene_.lights;
    B covered(false);
    if (!lights.needs_hit_test) return covered;
    const B sees_body = active & (bsdf_pdf == F(0.0f));
    const bool weighed = lights.count <= LightTable::kWeighed;
    F nearest(kInfinity), total(-1.0f);
    V body(F(0.0f));
    for (int i = 0; i < lights.count; ++i) {
      const float* row = lights.row(i);
      const LightType type = LightType(int(row[kType]));
      if (type == LightType::kPoint || type == LightType::kDome) continue;
      const LocalHit<W> h = light_hit<W>(row, ray.o, ray.d);
      B met = active & (h.pdf > F(0.0f));
      if (type == LightType::kDistant) {
        met = met & !hit & !camera;
      } else {
        met = met & (h.t * kNearlyOne <= t_surface) & (h.t >= ray.tnear);
      }
      if (!any(met)) continue;
      const V L{F(row[kRadiance]), F(row[kRadiance + 1]), F(row[kRadiance + 2])};
      const bool lobe_factors = int(row[kLightFlags]) & kSampledOnly;
      const B direct = met & sees_body & (h.t < nearest);
      nearest = select(direct, h.t, nearest);
      // After a mirror all is specular; the camera sees the light itself.
      const F factor = lobe_factors ? select(camera, F(1.0f), F(row[kSpecularFactor])) : F(1.0f);
      body = select(direct, L * factor, body);
      covered |= direct;
      const B scattered = met & !sees_body;
      if (!any(scattered) || lobe_factors) continue;
      if (weighed && total[0] < 0.0f && lights.count > 1) total = total_importance(lights, ray.o);
      const F light_pdf = h.pdf * light_probability(lights, i, ray.o, total);
      gathered += select(scattered, L * mis_weight(bsdf_pdf, light_pdf), V(F(0.0f)));
    }
    gathered += body;
    return covered;
  }

  void meet_domes(B escaped, const Rays<W>& ray, F bsdf_pdf, B camera, V& gathered) {
    if (!any(escaped)) return;
    const LightTable& lights = scene_.lights;
    for (size_t k = 0; k < lights.domes.size(); ++k) {
      F pdf;
      V L = dome_eval(lights.domes[k], ray.d, pdf);
      F weight(1.0f);
      const int light = lights.dome_light[k];
      const DomeFactors f = lights.dome_factors[k];
      if (f.specular != 1.0f || f.diffuse != 1.0f) {
        weight = select(camera, F(1.0f), select(bsdf_pdf == F(0.0f), F(f.specular), F(0.0f)));
      } else if (light >= 0) {
        const F total = lights.count > 1 && lights.count <= LightTable::kWeighed ? total_importance(lights, ray.o) : F(1.0f);
        const F light_pdf = pdf * light_probability(lights, light, ray.o, total);
        weight = select(bsdf_pdf == F(0.0f), F(1.0f), mis_weight(bsdf_pdf, light_pdf));
      }
      gathered += select(escaped, L * weight, V(F(0.0f)));
    }
  }

  // Veach 1997, "Robust Monte Carlo Methods for Light Transport Simulation", section 9.2.2: the power heuristic with exponent 2.
  static PRIMRAY_INLINE F mis_weight(F pdf, F other) {
    const F r = other / pdf;
    return 1.0f / (1.0f + r * r);
  }

  void sample_light(B scatters, const Interaction<W>& it, const V& ng, const Frame<F>& frame, const V& wo, const Bsdf<W>& bsdf,
                    const Sampler<W>& sampler, I bounce, const V& beta, I slot) {
    const LightTable& lights = scene_.lights;
    const Pair<W> u = sampler.pair(bounce, Purpose::kLightPoint);
    const F choice_u = lights.count > 1 ? sampler.single(bounce, Purpose::kLightChoice) : F(0.0f);
    const LightChoice<W> choice = choose_light(lights, it.p, choice_u);
    B useful = scatters & (choice.probability > F(0.0f));
    if (!any(useful)) return;
    const LightSample<W> s = light_sample(lights, choice.light, useful, it.p, u.u, u.v);
    const V wi = frame.to_local(s.wi);
    useful &= (s.pdf > F(0.0f)) & (dot(ng, s.wi) > F(0.0f)) & (wi.z > F(0.0f));
    if (!any(useful)) return;
    const BsdfEval<W> f = bsdf.eval(wo, wi);
    V reflected = f.diffuse + f.specular;
    const F pdf = s.pdf * choice.probability;
    F weight = select(s.is_delta, F(1.0f), mis_weight(pdf, f.pdf));
    if (lights.lobe_factors) {
      const LightRow<W> row(lights, choice.light);
      reflected = f.diffuse * row(kDiffuseFactor) + f.specular * row(kSpecularFactor);
      weight = select((row.flags() & I(kSampledOnly)) != I(0), F(1.0f), weight);
    }
    const V carried = beta * reflected * s.L * (weight / pdf);
    useful &= max_component(carried) > F(0.0f);
    push_shadow(useful, it.p + ng * it.offset, s.wi, s.t * kNearlyOne, carried, slot);
  }

  void push_shadow(B m, const V& o, const V& d, F tfar, const V& carried, I slot) {
    if (!any(m)) return;
    ShadowQueue& q = w_.shadows;
    const Compaction<W> c(m);
    const int at = q.count;
    c.append(q.ox + at, o.x), c.append(q.oy + at, o.y), c.append(q.oz + at, o.z);
    c.append(q.dx + at, d.x), c.append(q.dy + at, d.y), c.append(q.dz + at, d.z), c.append(q.tfar + at, tfar);
    c.append(q.r + at, carried.x), c.append(q.g + at, carried.y), c.append(q.b + at, carried.z), c.append(q.slot + at, slot);
    q.count += c.count;
  }

  void continue_paths(B scatters, const Interaction<W>& it, const V& ng, const Frame<F>& frame, const V& wo, const Bsdf<W>& bsdf,
                      const Sampler<W>& sampler, I bounce, V beta, I slot) {
    const Pair<W> u = sampler.pair(bounce, Purpose::kDirection);
    const F lobe = bsdf.any_preview ? sampler.single(bounce, Purpose::kLobe) : F(0.0f);
    const BsdfSample<W> s = bsdf.sample(wo, lobe, u.u, u.v);
    const V wi = frame.to_world(s.wi);
    const F out = dot(ng, wi);
    // The true surface decides which side a direction is on, whatever the shading normal says.
    B alive = scatters & select_bool(s.transmits, out < F(0.0f), out > F(0.0f));
    beta *= s.weight;
    alive &= max_component(beta) > F(0.0f);
    // The last vertex only looks for light: without any that a ray could meet, there is nothing to look for.
    if (!scene_.rays_find_light) alive &= bounce < I(settings_.max_depth);
    const B roulette = alive & (bounce >= I(kRouletteStart));
    if (any(roulette)) {
      const F survive = min(max_component(beta), 1.0f);
      const F r = sampler.single(bounce, Purpose::kRoulette);
      alive &= !(roulette & (r >= survive));
      beta = select(roulette, beta * (1.0f / survive), beta);
    }
    if (!any(alive)) return;
    const V o = it.p + ng * (it.offset * select(out > F(0.0f), F(1.0f), F(-1.0f)));
    PathPool& pool = w_.pool;
    const Compaction<W> c(alive);
    const int at = pool.count;
    c.append(pool.ox + at, o.x), c.append(pool.oy + at, o.y), c.append(pool.oz + at, o.z);
    c.append(pool.dx + at, wi.x), c.append(pool.dy + at, wi.y), c.append(pool.dz + at, wi.z);
    store(pool.tnear + at, F(0.0f)), store(pool.tfar + at, F(kInfinity));
    c.append(pool.beta_r + at, beta.x), c.append(pool.beta_g + at, beta.y), c.append(pool.beta_b + at, beta.z);
    c.append(pool.bsdf_pdf + at, s.pdf), c.append(pool.slot + at, slot), c.append(pool.depth + at, bounce);
    c.append(pool.reversed_index + at, sampler.reversed_index), c.append(pool.seed + at, sampler.seed);
    pool.count += c.count;
  }

  static PRIMRAY_INLINE B select_bool(B m, B a, B b) { return (m & a) | ((!m) & b); }

  void trace_shadows() {
    ShadowQueue& q = w_.shadows;
    w_.shadow_rays += q.count;
    for (int at = 0; at < q.count; at += W) {
      const B active = lane_numbers<W>() < I(q.count - at);
      const Rays<W> rays = q.rays<W>(at);
      V carried{load<W>(q.r + at), load<W>(q.g + at), load<W>(q.b + at)};
      B blocked;
      if (scene_.has_thin) {
        blocked = !pass_thin(active, rays, carried);
      } else {
        const bool packet = w_.shadow_entry.packet(), measuring = w_.shadow_entry.measuring();
        if (recorder_) recorder_->record(true, packet, active, rays);
        const uint64_t start = measuring ? EntryChoice::now() : 0;
        blocked = packet ? occluded_packet(scene_.accel(), active, rays) : occluded_single(scene_.accel(), active, rays);
        if (measuring) w_.shadow_entry.record(EntryChoice::now() - start, std::min(W, q.count - at));
      }
      add(active & !blocked, load<W>(q.slot + at), carried);
    }
  }

  // Follows shadow rays through surfaces that let light straight through; what arrives is left in `carried`.
  B pass_thin(B active, Rays<W> rays, V& carried) {
    B arrived(false);
    while (any(active)) {
      if (recorder_) recorder_->record(false, true, active, rays);
      const Hits<W> hits = intersect_packet(scene_.accel(), active, rays);
      const B hit = active & (hits.geom != I(-1));
      arrived |= active & !hit;
      active = hit;
      if (!any(active)) break;
      const Interaction<W> it = interact(scene_, active, hits);
      const F cosine = dot(it.ns, rays.d);
      const B front = dot(it.ng, rays.d) < F(0.0f);
      const F z = clamp(abs(cosine), 0.0f, 1.0f);
      const V wo{safe_sqrt(1.0f - z * z), F(0.0f), z};
      // Lanes that have arrived keep what they carry.
      carried = select(active, carried * straight_transmittance(Bsdf<W>(scene_.surfaces, it.surface, active, wo, front)), carried);
      active &= max_component(carried) > F(0.0f);
      // Go on from the point that was hit, as far as is left.
      const V o = it.p + it.ng * (it.offset * select(front, F(-1.0f), F(1.0f)));
      rays.tfar = rays.tfar - dot(o - rays.o, rays.d);
      rays.o = o;
      active &= rays.tfar > F(0.0f);
      arrived |= hit & (max_component(carried) > F(0.0f)) & !(rays.tfar > F(0.0f));
    }
    return arrived;
  }

  const Scene& scene_;
  const IntegratorSettings& settings_;
  const TileBlock& block_;
  Worker& w_;
  RayRecorder* recorder_;
  int samples_, pixels_ = 0, next_slot_ = 0, first_camera_ = 0;
};

template <int W>
void render_tile_block(const Scene& scene, const IntegratorSettings& settings, const TileBlock& block, Worker& worker, Film& film,
                       RayRecorder* recorder) {
  TilePaths<W> paths(scene, settings, block, worker, recorder);
  paths.run();
  paths.add_to(film);
}

}  // namespace primray
