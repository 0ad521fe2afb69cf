// Returns of one task's rays, W at a time: see returns.hpp.
#pragma once

#include <algorithm>
#include <cmath>

#include "accel/query.hpp"
#include "aov/returns.hpp"
#include "bsdf/bsdf_with_open_pbr.hpp"
#include "medium/ray_medium.hpp"
#include "surface/evaluate_inputs.hpp"
#include "surface/interaction.hpp"

namespace primray {

// Maximum number of surfaces along a beam; what is beyond sends nothing.
constexpr int kMostReturns = 256;
// Share of a beam, one way, below which it ends.
constexpr float kSpentBeam = 1e-4f;
// Half the angle of a beam's cone in radians, for textures' footprints: a few centimetres at 100 metres.
constexpr float kBeamSpread = 3e-4f;

template <int W>
class ReturnsTask {
 public:
  ReturnsTask(const Scene& scene, ReturnRays& rays) : scene_(scene), rays_(rays), unit_(1.0 / scene.scale) {}

  void run(size_t task) {
    const size_t begin = task * ReturnRays::kTask, end = std::min(begin + ReturnRays::kTask, rays_.time.size());
    std::vector<Return> found[W];
    for (size_t at = begin; at < end; at += W) {
      const int count = int(std::min(size_t(W), end - at));
      for (std::vector<Return>& lane : found) lane.clear();
      trace(at, count, found);
      for (int i = 0; i < count; ++i) {
        rays_.count[at + size_t(i)] = uint32_t(found[i].size());
        rays_.by_task[task].insert(rays_.by_task[task].end(), found[i].begin(), found[i].end());
      }
    }
  }

 private:
  using F = vfloat<W>;
  using I = vint<W>;
  using B = vbool<W>;
  using V = vvec3<W>;

  // Beams in lanes.
  struct Beams {
    Rays<W> ray;
    V left{F(1.0f)};        // what has got here, one way
    V extinction{F(0.0f)};  // of the medium that the beam is in, per length
    F index{1.0f}, budget;  // index of refraction of that medium; optical length that is left
    // In double, since a float at 100 metres resolves no more than 8 micrometres: the last vertex, the direction from there,
    // and the optical length up to there.
    dvec3 last[W], along[W];
    double travelled[W];
  };

  // Surfaces that beams hit, seen along them.
  struct Seen {
    B front;
    V wo;  // local
    V n;
    Frame<F> frame;
  };

  void trace(size_t at, int count, std::vector<Return> (&found)[W]) {
    Beams beams;
    const double scale = scene_.scale;
    alignas(64) float o[3][W], d[3][W], times[W];
    alignas(64) int32_t lane[W];
    for (int i = 0; i < W; ++i) {
      const size_t k = at + size_t(std::min(i, count - 1));
      const dvec3 from = (rays_.origin[k] - scene_.origin) * scale, along = rays_.direction[k];
      o[0][i] = float(from.x), o[1][i] = float(from.y), o[2][i] = float(from.z);
      d[0][i] = float(along.x), d[1][i] = float(along.y), d[2][i] = float(along.z);
      beams.last[i] = from, beams.along[i] = along, beams.travelled[i] = 0;
      times[i] = rays_.time[k], lane[i] = i < count ? 1 : 0;
    }
    beams.budget = F(float(rays_.far * scale));
    beams.ray = {{load<W>(o[0]), load<W>(o[1]), load<W>(o[2])},
                 {load<W>(d[0]), load<W>(d[1]), load<W>(d[2])},
                 F(float(rays_.near * scale)),
                 beams.budget,
                 load<W>(times)};
    B active = load<W>(lane) == I(1);
    F width(0.0f);  // of the beam's cone
    for (int layer = 0; layer < kMostReturns && any(active); ++layer) active = step(active, beams, width, found);
  }

  // Follows beams to the next surface; returns the lanes that go on from there.
  B step(B active, Beams& beams, F& width, std::vector<Return> (&found)[W]) {
    Rays<W>& ray = beams.ray;
    const Hits<W> hits = intersect(scene_, true, active, ray);
    B hit = active & (hits.geom != I(-1));
    if (!any(hit)) return hit;
    const Interaction<W> it = interact(scene_, hit, ray, hits);
    const B passed = bounds_volume(scene_, hit, it.surface) |
                     scene_.camera_visibility.lanes_with(CameraVisibility::kHidden, hit, it.surface);
    hit &= !passed;
    const F gone = dot(it.p - ray.o, ray.d);
    V ns = it.ns;
    SurfaceRows<W> rows(scene_.surfaces, it.surface, hit);
    LaneRows<W> varying;
    if (any_inputs(scene_, hit, it.surface)) {
      const F radius = width + gone * kBeamSpread, cosine = max(abs(dot(it.ng, ray.d)), 0.05f);
      rows = evaluate_inputs(scene_, hit, hits, it.surface, radius * radius / cosine, it.p, it.ng, ns, varying);
    }

    // Absorb in the medium up to here.
    const V absorbed = beams.extinction * gone;
    const auto falls = [](F x) { return exp2_negative<W>(min(x, 80.0f) * -1.44269504f); };
    const V before = select(hit, beams.left * V{falls(absorbed.x), falls(absorbed.y), falls(absorbed.z)}, beams.left);

    // Evaluate what comes straight back, and what goes on.
    Seen seen;
    seen.front = dot(it.ng, ray.d) < F(0.0f);
    const F side = select(seen.front, F(1.0f), F(-1.0f));
    const V ng = it.ng * side, shaded = ns * side;
    seen.n = select(dot(shaded, ray.d) < F(0.0f), shaded, ng);
    seen.frame = Frame<F>(seen.n);
    if (!scene_.surfaces.open_pbr.empty()) align_tangent(rows, hit, seen.frame);
    seen.wo = seen.frame.to_local(-ray.d);
    V back(F(0.0f)), through(F(0.0f));
    B bends(false);
    if (scene_.surfaces.open_pbr.empty()) {
      Bsdf<W> bsdf(rows, hit, seen.wo, seen.front);
      evaluate(bsdf, it, seen, back, through, bends);
    } else {
      BsdfWithOpenPbr<W> bsdf(rows, hit, seen.wo, seen.front);
      widen(bsdf, seen.wo);
      evaluate(bsdf, it, seen, back, through, bends);
      pass_open_pbr(rows, bsdf, hit, seen, through, bends);
    }
    record(hit, beams, hits, it, seen, before * before * back, found);
    beams.left = select(hit, before * through, beams.left);
    hit &= max_component(beams.left) > F(kSpentBeam);
    if (any(hit & bends)) refract(hit & bends, rows, seen, beams);

    // Continue beyond the surface.
    const F outwards = copysign(F(1.0f), dot(it.ng, ray.d));
    const V o = it.p + it.ng * (it.offset * outwards);
    beams.budget = select(hit, beams.budget - gone * optical_, beams.budget);
    ray.o = select(hit, o, ray.o);
    ray.tnear = select(passed, behind_boundary(hits.t, it.offset), select(hit, F(0.0f), ray.tnear));
    ray.tfar = select(hit, beams.budget / beams.index, ray.tfar);
    width = select(hit, width + gone * kBeamSpread, width);
    return (hit | (passed & active)) & (ray.tfar > ray.tnear);
  }

  // Evaluates what a surface sends back along the beam, and what of the beam passes it.
  template <class Lobes>
  void evaluate(Lobes& bsdf, const Interaction<W>& it, const Seen& seen, V& back, V& through, B& bends) const {
    const F least(rays_.least_alpha);
    bsdf.diffuse = bsdf.diffuse * it.color;
    through = bsdf.any_presence ? V(1.0f - bsdf.presence) : V(F(0.0f));
    if (bsdf.any_preview && bsdf.any_transmission) {
      const B glass = bsdf.preview & (max_component(bsdf.transmission) > F(0.0f));
      through += select(glass, bsdf.transmission * bsdf.coat_keep * bsdf.presence, V(F(0.0f)));
      bends = glass & !bsdf.thin;
    }
    if (bsdf.any_preview) {
      bsdf.alpha = max(bsdf.alpha, least);
      bsdf.mirror = B(false);
      if (bsdf.any_coat) bsdf.coat_alpha = max(bsdf.coat_alpha, least);
    }
    const BsdfEval<W> e = bsdf.eval(seen.wo, seen.wo);
    back = select(seen.wo.z > F(0.0f), (e.diffuse + e.specular) * kPi, V(F(0.0f)));
  }

  // Widens the lobes of OpenPBR surfaces to the least width.
  void widen(BsdfWithOpenPbr<W>& bsdf, const V& wo) const {
    if (!bsdf.open_pbr) return;
    const F least(rays_.least_alpha);
    OpenPbr<W>& o = *bsdf.open_pbr;
    o.facets = Facets<W>(max(o.facets.alpha_t, least), max(o.facets.alpha_b, least), wo);
    o.mirror = B(false), o.any_rough = true;
    if (o.any_coat) o.coat_facets = Facets<W>(max(o.coat_facets.alpha_t, least), max(o.coat_facets.alpha_b, least), wo);
  }

  // Sets what passes OpenPBR's smooth closed glass, which `evaluate` does not know: the dielectric's transmittance and tint.
  void pass_open_pbr(const SurfaceRows<W>& rows, const BsdfWithOpenPbr<W>& bsdf, B hit, const Seen& seen, V& through,
                     B& bends) const {
    if (!bsdf.open_pbr) return;
    const F pass = rows(kTransmission), ior = rows(kIor);
    const B own = hit & bsdf.is_open_pbr;
    bends &= !own;
    const B glass = own & !bsdf.thin & (pass > F(0.0f)) & (rows(kAlpha) == F(0.0f));
    if (!any(glass)) return;
    const F fresnel = dielectric_fresnel(seen.wo.z, select(seen.front, ior, 1.0f / ior));
    const V tint = rows.open_pbr_rows(glass).color(kOpenTint);
    through = select(glass, tint * ((1.0f - fresnel) * pass * bsdf.presence) + V(1.0f - bsdf.presence), through);
    bends |= glass;
  }

  // Bends beams at boundaries of closed glass, into the medium behind them. Total reflection passes nothing (`evaluate`).
  void refract(B m, const SurfaceRows<W>& rows, const Seen& seen, Beams& beams) {
    const F ior = rows(kIor), ratio = select(seen.front, 1.0f / ior, ior), cosine = seen.wo.z;
    const F inside = safe_sqrt(1.0f - ratio * ratio * (1.0f - cosine * cosine));
    const V d = normalize(beams.ray.d * ratio + seen.n * (ratio * cosine - inside));
    beams.ray.d = select(m, d, beams.ray.d);
    beams.index = select(m, select(seen.front, ior, F(1.0f)), beams.index);
    V extinction(F(0.0f));
    const B open = m & seen.front & ((rows.flags() & I(kOpenPbr)) != I(0));
    if (any(open))
      extinction = select(open, rows.open_pbr_rows(open).color(kOpenExtinction) * scene_.interiors.per_length, extinction);
    beams.extinction = select(m, extinction, beams.extinction);
    for (uint32_t b = bits(m); b; b &= b - 1) {
      const int i = __builtin_ctz(b);
      const dvec3 along{d.x[i], d.y[i], d.z[i]};
      beams.along[i] = along * (1.0 / std::sqrt(dot(along, along)));
    }
  }

  // Adds the returns of lanes `m`, and moves their beams' vertices there.
  void record(B m, Beams& beams, const Hits<W>& hits, const Interaction<W>& it, const Seen& seen, const V& strength,
              std::vector<Return> (&found)[W]) {
    optical_ = beams.index;
    const V& s = strength;
    const F weighted = s.x * rays_.weights.x + s.y * rays_.weights.y + s.z * rays_.weights.z;
    const HitGroup<W> in(scene_, m, hits);
    const SurfacePoint<W> point(scene_, m, hits);
    for (uint32_t b = bits(m); b; b &= b - 1) {
      const int i = __builtin_ctz(b);
      const dvec3 here{it.p.x[i], it.p.y[i], it.p.z[i]};
      beams.travelled[i] += dot(here - beams.last[i], beams.along[i]) * double(beams.index[i]);
      beams.last[i] = here;
      if (!(weighted[i] > rays_.least_strength)) continue;
      const int32_t shape = point.is_triangle[i] ? it.mesh[i] : -2 - it.curved[i];
      const int32_t instance = in.instanced[i] ? in.instance[i] : -1, outer = in.grouped[i] ? in.outer[i] : -1;
      found[i].push_back(
          {shape, instance, outer, it.surface[i], beams.travelled[i] * unit_, weighted[i], std::min(seen.wo.z[i], 1.0f)});
    }
  }

  const Scene& scene_;
  ReturnRays& rays_;
  const double unit_;
  F optical_{1.0f};  // index of the medium before the surface at which beams are
};

template <int W>
void fill_returns(const Scene& scene, size_t task, ReturnRays& rays) {
  ReturnsTask<W>(scene, rays).run(task);
}

}  // namespace primray
