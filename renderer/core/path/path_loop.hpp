// The path loop. Included by lanes_<W>.cpp alone, one translation unit for each number of lanes.
#pragma once

#include <algorithm>
#include <cmath>

#include "accel/query.hpp"
#include "emitter/emitter.hpp"
#include "guide/caustics.hpp"
#include "guide/guided_scattering.hpp"
#include "path/add_to_film.hpp"
#include "path/emission.hpp"
#include "path/outline_rays.hpp"
#include "path/path_parts.hpp"
#include "path/ray_streams.hpp"
#include "path/shiny_lanes.hpp"
#include "path/tile_task.hpp"
#include "path/trace_shadows.hpp"
#include "surface/smooth_origin.hpp"

namespace primray {

template <int W>
class TilePaths {
 public:
  TilePaths(const Scene& scene, const IntegratorSettings& settings, const TileBlock& block, Worker& worker,
            RayRecorder* recorder)
      : scene_(scene),
        settings_(settings),
        block_(block),
        w_(worker),
        recorder_(recorder),
        needs_{scene.has_thin,           scene.has_inputs,          scene.lights.lobe_factors,
               scene.lights.links.any(), scene.camera.shutter_open, scene.lights.by_tree() || scene.emitters.by_triangle(),
               settings.guide != nullptr},
        samples_(block.count[0] + block.count[1]) {
    if (has_special() && !w_.special_shadows) w_.special_shadows = std::make_unique<SpecialShadowQueue>();
  }

  void run() {
    pixels_ = list_pixels(block_, w_);
    outlined_ = scene_.outlines.any() && find_outlines(scene_.outlines, block_, w_, pixels_);
    const int slots = pixels_ * samples_;
    std::fill_n(w_.r, slots, 0.0f), std::fill_n(w_.g, slots, 0.0f), std::fill_n(w_.b, slots, 0.0f),
        std::fill_n(w_.a, slots, 0.0f);
    w_.pool->count = 0;
    if (outlined_)
      look_for_outlines<W>(scene_, settings_.seed, block_, w_, pixels_, needs_, [&] { trace_shadows(), w_.shadows.count = 0; });
    while (true) {
      if (settings_.log) ++settings_.log->round;
      refill(slots);
      if (w_.pool->count == 0) break;
      trace();
      shade();
      trace_shadows();
    }
  }

  void add_to(Film& film) const { add_to_film(block_, w_, pixels_, samples_, film); }

 private:
  using F = vfloat<W>;
  using I = vint<W>;
  using B = vbool<W>;
  using V = vvec3<W>;

  bool has_special() const { return scene_.lights.has_special(); }

  // The film point's number in the chain that it and the directions after it make: each even link shares a point of a sequence
  // with the next. The parts of a split path have indices of their own, so there their first two directions do.
  int first_link() const { return settings_.splits > 1 ? 1 : 0; }
  int pixel_x(int i) const { return block_.x0 + w_.pixel_x[i] * block_.stride_x; }
  int pixel_y(int i) const { return block_.y0 + w_.pixel_y[i] * block_.stride_y; }

  void refill(int slots) {
    PathPool& pool = *w_.pool;
    first_camera_ = pool.count;
    const int splits = settings_.splits;
    // Room for every camera path to split.
    while (next_slot_ < slots && pool.count + (splits - 1) * (pool.count - first_camera_) + splits * W <= kPool) {
      alignas(64) int32_t x[W], y[W], slot[W];
      alignas(64) uint32_t index[W], replicate[W];
      const int n = std::min(W, slots - next_slot_);
      for (int i = 0; i < W; ++i) {
        const int s = std::min(next_slot_ + i, slots - 1), pixel = s / samples_, k = s - pixel * samples_;
        const int r = k < block_.count[0] ? 0 : 1;
        x[i] = pixel_x(pixel), y[i] = pixel_y(pixel), slot[i] = s;
        index[i] = uint32_t(block_.first[r] + (r ? k - block_.count[0] : k)), replicate[i] = uint32_t(r);
      }
      const I px = load<W>(x), py = load<W>(y);
      PathLanes<W> p;
      p.sampler = Sampler<W>::of(settings_.seed, px, py, load<W>(replicate), load<W>(index), settings_.screen_block);
      const Pair<W> film = p.sampler.link(I(first_link()));
      Pair<W> lens{F(0.5f), F(0.5f)};
      if (scene_.camera.lens_radius > 0) lens = p.sampler.pair(I(0), Purpose::kLens);
      const CameraRay<W> ray = scene_.camera.ray<W>(px, py, film.u, film.v, lens.u, lens.v);
      p.ray = {ray.o, ray.d, ray.tnear, ray.tfar};
      if (needs_.time) p.ray.time = p.sampler.single(I(0), kShutterTime);
      p.beta = V(F(1.0f)), p.share = p.normal = V(F(0.0f)), p.link = I(kUnlinkedRow);
      p.bsdf_pdf = p.travelled = p.first = F(0.0f), p.splits = F(1.0f);
      p.cone_width = F(scene_.camera.cone_width()), p.cone_spread = F(scene_.camera.cone_spread());
      p.slot = load<W>(slot), p.depth = p.vertex = I(0);
      pool.append(Compaction<W>(lane_numbers<W>() < I(n)), p, needs_);
      next_slot_ += n;
    }
    w_.camera_rays += pool.count - first_camera_;
    w_.scattered_rays += first_camera_;
  }

  void trace() {
    PathPool& pool = *w_.pool;
    if (scene_.many.any()) return trace_stream<W>(scene_.many, recorder_, pool);
    for (int at = 0; at < pool.count; at += W) {
      const B active = lane_numbers<W>() < I(pool.count - at);
      Rays<W> rays = pool.rays<W>(at);
      if (needs_.time) rays.time = load<W>(pool.time + at);
      EntryChoice& entry = at >= first_camera_ ? w_.camera_entry : w_.scattered_entry;
      const bool packet = entry.packet();
      if (recorder_) recorder_->record(false, packet, active, rays);
      const uint64_t start = entry.measuring() ? EntryChoice::now() : 0;
      const Hits<W> hits = intersect(scene_, packet, active, rays);
      if (entry.measuring()) entry.record(EntryChoice::now() - start, std::min(W, pool.count - at));
      pool.set_hits(at, hits);
    }
  }

  void shade() {
    PathPool& pool = *w_.pool;
    w_.next->count = 0;
    w_.shadows.count = 0;
    if (has_special()) w_.special_shadows->rays.count = 0;
    for (int at = 0; at < pool.count; at += W) {
      w_.busy_lanes += std::min(W, pool.count - at), w_.shaded_lanes += W;
      shade_lanes(at, lane_numbers<W>() < I(pool.count - at));
    }
    std::swap(w_.pool, w_.next);
  }

  void add(B m, I slot, const V& c) { add_to_slots(w_, settings_, m, slot, c); }
  void trace_shadows() { ShadowTracer<W>(scene_, settings_, recorder_, needs_, w_).trace(); }

  // What scattering at a vertex needs to know of it.
  struct Vertex {
    Interaction<W> it;
    V ng;  // on the side where the ray came from
    Frame<F> frame;
    V wo;  // in that frame
    Bsdf<W> bsdf;
    const Hits<W>& hits;
    GuidePlace<W> place;              // region -1: scattered by the BSDF alone
    const CausticLanes<W>* caustics;  // null: no ray is guided into them
  };

  // One vertex of the paths at [at, at + W): light met, light sampled, next ray.
  void shade_lanes(int at, B active) {
    const PathPool& pool = *w_.pool;
    const PathLanes<W> p = pool.paths<W>(at, needs_);
    const Hits<W> hits = pool.hits<W>(at);
    B hit = active & (hits.geom != I(-1));

    // Light that comes back along the ray from lights it meets, and from afar.
    V gathered(F(0.0f));
    const MetLights<W> met = meet_lights(scene_.lights, active, hit, p, hits.t, gathered);
    const B covered = met.covered;
    if (const B camera = covered & (p.vertex == I(0)); outlined_ && any(camera))
      gathered = select(is_outlined(w_, camera, p.slot, samples_, met.light), V(F(0.0f)), gathered);
    hit &= !covered;
    const B escaped = active & !hit & !covered;
    if (!scene_.lights.domes.empty() && any(escaped))
      gathered += select(escaped, meet_domes(scene_.lights, escaped, p), V(F(0.0f)));
    for (uint32_t b = bits(active & (p.vertex == I(0)) & (hit | covered)); b; b &= b - 1) w_.a[p.slot[__builtin_ctz(b)]] = 1.0f;
    if (!any(hit)) {
      add(active, p.slot, p.beta * gathered);
      return;
    }

    Interaction<W> it = interact(scene_, hit, p.ray, hits);
    SurfaceRows<W> rows(scene_.surfaces, it.surface);
    LaneRows<W> varying;
    if (scene_.has_inputs && any(hit & has_inputs(scene_, it.surface))) {
      // Whatever the angle, as much area as the cone cuts out of the surface.
      const F width = p.cone_width + p.cone_spread * hits.t, cosine = abs(dot(it.ng, p.ray.d));
      rows = evaluate_inputs(scene_, hit, hits, it.surface, width * width / max(cosine, kGrazing), it.ng, it.ns, varying);
    }
    if (scene_.has_emission) gathered += select(hit, emitted(scene_, hit, hits, it, rows, p), V(F(0.0f)));
    add(active, p.slot, p.beta * gathered);

    // Scatter, on the side of the surface where the ray came from. Where rounding hides which that is, the path ends: taking
    // the wrong one lets light through closed surfaces at their edges. Such hits are seen edge-on, or lie behind the ray's
    // start (Embree's distance is wrong where the start is almost in the triangle's plane; the point is not), or on a back so
    // near to the start that this may have been on the wrong side of the next face, or on the edge of a triangle's back whose
    // inside the ray would not see: it came in past the outline of a body.
    const V wo = -p.ray.d;
    const F facing = dot(it.ng, wo);
    const B behind = !(facing > F(0.0f));
    const F ahead = dot(it.p - p.ray.o, p.ray.d);
    B certain = (abs(facing) > it.edge_on) & (ahead > it.offset * select(behind, F(kBackAhead), F(kAhead)));
    if (const B back = hit & it.on_edge & behind; any(back)) certain &= (!back) | sees_within(back, p, hits, it);
    const B scatters = hit & certain & ((p.depth < I(settings_.max_depth)) | B(scene_.has_thin));
    if (!any(scatters)) return;
    const B front = facing > F(0.0f);
    const F side = select(front, F(1.0f), F(-1.0f));
    const V ng = it.ng * side;
    // A shading normal that faces away from the viewer cannot be seen: use the true one.
    const V ns = it.ns * side;
    const Frame<F> frame(select(dot(ns, wo) > F(1e-4f), ns, ng));
    const V wo_local = frame.to_local(wo);
    Vertex v{it, ng, frame, wo_local, Bsdf<W>(rows, scatters, wo_local, front), hits, {I(-1), I(0)}, nullptr};
    v.bsdf.diffuse *= it.color;
    if (settings_.guide) v.place = find_place(*settings_.guide, scatters, it.p, ng, v.bsdf);
    if (settings_.caustics) return go_on_guided(scatters, v, p);
    go_on(scatters, v, p);
  }

  PRIMRAY_RARE void go_on_guided(B scatters, Vertex& v, const PathLanes<W>& p) {
    const auto sends = [&](const V& w, F width2) { return suits(v.bsdf, v.wo, v.frame.to_local(w), width2); };
    const CausticLanes<W> guide(*settings_.caustics, scatters & follows_caustics(v.bsdf), v.it.p, sends);
    if (any(guide.share > F(0.0f))) v.caustics = &guide;
    go_on(scatters, v, p);
  }
  void go_on(B scatters, const Vertex& v, const PathLanes<W>& p) {
    if (scene_.lights.count > 0) sample_lights(scatters & (p.depth < I(settings_.max_depth)), v, p);
    scatter(scatters, v, p);
  }

  // One sample of the lights; at a path's first surface that is no mirror, as many as pilots found worth their rays.
  void sample_lights(B scatters, const Vertex& v, const PathLanes<W>& p) {
    const B more = scatters & (p.vertex == I(0)) & !v.bsdf.mirror;
    if (settings_.light_samples == 1 || !any(more)) return sample_light(scatters, v, p);
    PathLanes<W> part = part_of(p, more, settings_.light_samples);
    for (int k = 0; k < settings_.light_samples; ++k) {
      number_part(part, p, more, settings_.light_samples, k);
      sample_light(k == 0 ? scatters : more, v, part);
    }
  }

  void sample_light(B scatters, const Vertex& v, const PathLanes<W>& p) {
    const LightTable& lights = scene_.lights;
    // From where scattered rays start, so that both agree on which lights lie before the surface.
    const V from = v.it.p + v.ng * v.it.offset;
    const I bounce = p.vertex + I(1);
    const Pair<W> u = p.sampler.pair(bounce, Purpose::kLightPoint);
    const vuint<W> number = lights.count > 1 ? p.sampler.bits_of(bounce, Purpose::kLightChoice) : vuint<W>(0u);
    const bool linked = lights.links.any();
    ShinyLanes<W> shiny;
    const bool any_shiny =
        v.bsdf.any_preview && lights.by_tree() && !linked && find_shiny(scatters, v.bsdf, v.frame.to_world(v.wo), shiny);
    const LightChoice<W> choice = linked
                                      ? choose_linked_light(lights, scatters, from, v.frame.n, number, v.it.link)
                                      : choose_light(lights, scatters, from, v.frame.n, number, any_shiny ? &shiny : nullptr);
    B useful = scatters & (choice.probability > F(0.0f));
    if (!any(useful)) return;
    LightSample<W> s = light_sample(lights, choice.light, useful, from, u.u, u.v);
    if (lights.has_portals()) {
      const B dome = useful & is_type(LightRow<W>(lights, choice.light).type(), LightType::kDome);
      if (any(dome)) sample_portals(lights, dome, choice.light, from, p.sampler.single(bounce, Purpose::kEmitter), u.u, u.v, s);
    }
    if (scene_.emitters.any()) {
      const LightRow<W> row(lights, choice.light);
      const B geometry = useful & ((row.flags() & I(kGeometry)) != I(0));
      const B mesh = geometry & is_type(row.type(), LightType::kMesh), sphere = geometry & !mesh;
      if (any(sphere)) end_before_sphere(scene_, sphere, choice.light, from, s);
      if (any(mesh)) {
        const vuint<W> bits = p.sampler.bits_of(bounce, Purpose::kEmitter);
        sample_mesh(scene_, mesh, choice.light, from, v.frame.n, bits, u.u, u.v, s);
      }
    }
    const V wi = v.frame.to_local(s.wi);
    const B above = dot(v.ng, s.wi) > F(0.0f);
    useful &= (s.pdf > F(0.0f)) & (wi.z > F(0.0f)) & (above | v.it.smooth);
    if (!any(useful)) return;
    const BsdfEval<W> f = v.bsdf.eval(v.wo, wi);
    V reflected = f.diffuse + f.specular;
    if (lights.lobe_factors) {
      const LightRow<W> row(lights, choice.light);
      reflected = f.diffuse * row(kDiffuseFactor) + f.specular * row(kSpecularFactor);
    }
    const F pdf = s.pdf * choice.probability;
    B special(false);  // no other way leads to those
    if (has_special()) special = (LightRow<W>(lights, choice.light).flags() & I(kSpecial)) != I(0);
    const F scattered_pdf = scattered_density(v, s.wi, f.pdf);
    B alone = s.is_delta | special;
    if (!lights.met.empty()) alone |= rarely_met(lights, choice.light, from, scattered_pdf);
    // For MIS the choice is as if no surface shone, which is all that a ray that meets the light knows: weights of both ways
    // add up to 1, whatever the densities in them.
    F known_pdf = pdf;
    if (any_shiny) {
      const B m = useful & shiny.shiny;
      known_pdf = select(m, s.pdf * probability_of(lights, choice.light, m, from, v.frame.n), pdf);
    }
    const F weight = select(alone, F(1.0f), mis_weight(known_pdf, scattered_pdf));
    const V carried = p.beta * reflected * s.L * (weight / pdf);
    useful &= max_component(carried) > F(0.0f);
    V o = from;
    if (const B below = useful & !above; any(below)) {
      const B lifted = start_lifted(below, v, s.wi, p.ray.time, o);
      useful &= above | lifted;
      // On to the same point of the light.
      const V to = s.wi * s.t - (o - from);
      const F t = length(to);
      const B near = lifted & (t < F(kInfinity)) & (t > F(0.0f));
      s.wi = select(near, to * (1.0f / t), s.wi), s.t = select(near, t, s.t);
    }
    if (any(useful & special))
      w_.special_shadows->append(useful & special, o, s.wi, s.t * kNearlyOne, carried, p.slot, choice.light, p.ray.time,
                                 needs_);
    useful &= !special;
    if (any(useful)) w_.shadows.append(useful, o, s.wi, s.t * kNearlyOne, carried, p.slot, p.ray.time, needs_);
  }

  // Whether a ray that met the edge of a triangle also meets it a little further inside.
  B sees_within(B m, const PathLanes<W>& p, const Hits<W>& h, const Interaction<W>& it) {
    const SurfacePoint<W> at(scene_, m, h);
    const V to = it.p + (at.e1 * (1.0f / 3 - at.u) + at.e2 * (1.0f / 3 - at.v)) * kWithin - p.ray.o;
    const Rays<W> rays{p.ray.o, normalize(to), F(0.0f), F(kInfinity), p.ray.time};
    if (recorder_) recorder_->record(false, false, m, rays);
    w_.scattered_rays += __builtin_popcount(bits(m));
    const Hits<W> seen = intersect(scene_, false, m, rays);
    return m & (seen.geom == h.geom) & (seen.prim == h.prim) & (seen.inst == h.inst) & (seen.inst_prim == h.inst_prim);
  }

  // Which rays along `wi` of lanes `below`, smooth ones and below the triangle's plane, go out all the same: from `o`. Nothing
  // may stand on the way there, or light would come through it.
  B start_lifted(B below, const Vertex& v, const V& wi, F time, V& o) {
    V shift;
    B lifted = lift_to_smooth(scene_, below, v.hits, v.it.offset, v.ng, wi, shift);
    if (!any(lifted)) return lifted;
    const V from = v.it.p + v.ng * v.it.offset;
    const F far = length(shift);
    const Rays<W> way{from, shift * (1.0f / far), F(0.0f), far + 2.0f * v.it.offset, time};
    if (recorder_) recorder_->record(true, false, lifted, way);
    w_.shadow_rays += __builtin_popcount(bits(lifted));
    lifted &= !occluded(scene_, false, lifted, way);
    o = select(lifted, from + shift, o);
    return lifted;
  }

  // Sends the paths on; a path at its first surface that is no mirror is split, which spends more on what comes after
  // than on finding that surface.
  void scatter(B scatters, const Vertex& v, const PathLanes<W>& p) {
    const int splits = settings_.splits;
    const B split = scatters & (p.vertex == I(0)) & !v.bsdf.mirror;
    if (splits == 1 || !any(split)) return scatter_once(scatters, v, p);
    PathLanes<W> part = part_of(p, split, splits);
    part.splits = select(split, F(float(splits)), p.splits);
    for (int k = 0; k < splits; ++k) {
      number_part(part, p, split, splits, k);
      scatter_once(k == 0 ? scatters : split, v, part);
    }
  }

  // The density of `wi` (of the world) without photons.
  F scattered_density(const Vertex& v, const V& wi, F by_bsdf) const {
    return settings_.guide ? mixed_pdf(*settings_.guide, v.place, wi, by_bsdf) : by_bsdf;
  }

  void scatter_once(B scatters, const Vertex& v, const PathLanes<W>& p) {
    const I bounce = p.vertex + I(1);
    Pair<W> u = p.sampler.link(bounce + I(first_link()));
    const F lobe = v.bsdf.any_preview || v.caustics ? p.sampler.single(bounce, Purpose::kLobe) : F(0.0f);
    PathLanes<W> n = p;
    const B by_guide = settings_.guide ? choose_guide(v.place, u.u) : B(false);
    F own(0.0f);
    const auto sample = [&](F l) {
      BsdfSample<W> found = v.bsdf.sample(v.wo, l, u.u, u.v);
      if (settings_.guide) sample_guided(*settings_.guide, v.place, by_guide, u, v.frame, v.wo, v.bsdf, found);
      return found;
    };
    const auto density = [&](const V& wi, F by_bsdf) { return scattered_density(v, wi, by_bsdf); };
    BsdfSample<W> s = v.caustics ? sample_guided(*v.caustics, v.bsdf, v.frame, v.wo, lobe, u, settings_.splits, sample, density,
                                                 n.splits, own)
                                 : sample(lobe);
    n.ray.d = select(s.straight, p.ray.d, v.frame.to_world(s.wi));
    const F out = dot(v.ng, n.ray.d);
    n.beta = p.beta * s.weight;
    n.ray.o = v.it.p + v.ng * (v.it.offset * select(out > F(0.0f), F(1.0f), F(-1.0f)));
    // The true surface, or the one that its smooth normals stand for, decides which side a direction is on, whatever the
    // shading normal says.
    B above = out > F(0.0f);
    if (const B below = scatters & v.it.smooth & !above & !s.transmits & (max_component(n.beta) > F(0.0f)); any(below))
      above |= start_lifted(below, v, n.ray.d, p.ray.time, n.ray.o);
    B alive = scatters & ((s.transmits & (out < F(0.0f))) | (above & !s.transmits));
    alive &= max_component(n.beta) > F(0.0f);
    n.vertex = bounce;
    n.depth = p.depth + select(s.straight, I(0), I(1));
    alive &= n.depth <= I(settings_.max_depth);
    // The last vertex only looks for light: without any that a ray could meet, there is nothing to look for.
    const B last = n.depth == I(settings_.max_depth);
    if (!scene_.rays_find_light) alive &= !last;
    n.bsdf_pdf = select(s.straight, p.bsdf_pdf, v.caustics ? own : s.pdf);
    if (scene_.has_thin) n.travelled = select(s.straight, p.travelled + dot(v.it.p - p.ray.o, p.ray.d), F(0.0f));
    if (scene_.has_inputs) {
      n.cone_width = p.cone_width + p.cone_spread * dot(v.it.p - p.ray.o, p.ray.d);
      n.cone_spread = p.cone_spread + select(s.pdf > F(0.0f), kLobeSpread / sqrt(max(s.pdf, 1e-6f)), F(0.0f));
    }
    if (needs_.normals) n.normal = select(s.straight, p.normal, v.frame.n);
    if (needs_.links) n.link = select(s.straight, p.link, v.it.link);
    if (scene_.lights.lobe_factors) n.share = select(s.straight, p.share, s.diffuse_share);
    // What was guided counts as its surface would have sent it, until it next scatters widely.
    if (settings_.caustics) {
      const B widely = (s.pdf > F(0.0f)) & (s.pdf < F(kDiffuseDensity));
      n.splits = select(widely, min(n.splits, float(settings_.splits)), n.splits);
    }
    const F expected = needs_.first ? expected_light(*settings_.guide, v.place, n.ray.d, n.first) : F(0.0f);
    const B roulette = alive & (bounce >= I(kRouletteStart)) & !s.straight;
    F survive(1.0f);
    if (any(roulette)) {
      const F most = select(bounce >= I(kRouletteDeep), F(kRouletteDeepKeep), F(1.0f));
      F kept = max_component(n.beta) * n.splits * kRouletteKeep;
      if (needs_.first) kept = select(n.first > F(0.0f), max(kept * expected, kLeastSurvival), kept);
      survive = select(roulette, min(kept, most), survive);
      const F r = p.sampler.single(bounce, Purpose::kRoulette);
      alive &= !(roulette & (r >= survive));
      n.beta = n.beta * (1.0f / survive);
    }
    // Nor are there lights for it that light sampling does not find.
    if (scene_.only_met_lights_found)
      alive &= (!last) | s.straight | may_meet(scene_.lights.met, alive & last & !s.straight, n.ray.o, n.ray.d, n.bsdf_pdf);
    if (!any(alive)) return;
    // What the camera does not see beyond its far plane it does not see through a gap either.
    n.ray.tnear = F(0.0f);
    n.ray.tfar = select(s.straight & (p.depth == I(0)), p.ray.tfar - dot(n.ray.o - p.ray.o, p.ray.d), F(kInfinity));
    if (scene_.only_domes_found && any(alive & last & !s.straight)) {
      // Only whether it meets the sky counts: a shadow ray tells that for less.
      const B sky = alive & last & !s.straight;
      const V carried = n.beta * meet_domes(scene_.lights, sky, n);
      const B lit = sky & (max_component(carried) > F(0.0f));
      if (any(lit)) w_.shadows.append(lit, n.ray.o, n.ray.d, F(kInfinity), carried, p.slot, p.ray.time, needs_);
      alive &= !sky;
      if (!any(alive)) return;
    }
    if (settings_.log) keep_vertex(*settings_.log, alive & (s.pdf > F(0.0f)), v.it.p, v.ng, v.frame.n, s.pdf, survive, n);
    w_.next->append(Compaction<W>(alive), n, needs_);
  }

  const Scene& scene_;
  const IntegratorSettings& settings_;
  const TileBlock& block_;
  Worker& w_;
  RayRecorder* recorder_;
  const PathNeeds needs_;
  int samples_, pixels_ = 0, next_slot_ = 0, first_camera_ = 0;
  bool outlined_ = false;  // lights end in some pixels of this tile
};

template <int W>
void render_tile_block(const Scene& scene, const IntegratorSettings& settings, const TileBlock& block, Worker& worker,
                       Film& film, RayRecorder* recorder) {
  TilePaths<W> paths(scene, settings, block, worker, recorder);
  paths.run();
  paths.add_to(film);
}

}  // namespace primray
