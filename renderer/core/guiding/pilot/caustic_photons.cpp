// Photon tracing for caustics. Photons are aimed at the bounding balls of clusters of smooth triangles, and of shapes; a photon
// is a function of its number alone, and photons are kept in the order of their numbers, so that neither threads nor lanes
// change a bit.

#include <algorithm>
#include <atomic>
#include <cmath>
#include <thread>

#include "accel/query.hpp"
#include "base/time_spans.hpp"
#include "bsdf/bsdf_with_open_pbr.hpp"
#include "build/inputs/input_facts.hpp"
#include "guiding/caustic_guide.hpp"
#include "guiding/guided_scattering.hpp"
#include "guiding/pilot/caustic_photons.hpp"
#include "light/mesh/mesh_light.hpp"
#include "light/sampler/selection.hpp"
#include "math/box.hpp"
#include "medium/phase_function.hpp"
#include "medium/ray_medium.hpp"
#include "render/task_function.hpp"
#include "sampler/sampler.hpp"
#include "surface/evaluate_inputs.hpp"
#include "surface/interaction.hpp"

namespace primray {

namespace {

constexpr size_t kMostTargets = 4096;

bool casts(const float* row) {
  if (!(int_at(row, kFlags) & kPreview) || row[kPresence] <= 0) return false;
  const bool clear = !(int_at(row, kFlags) & kOpenPbr) || row[kAlpha] < kPassedAlpha;  // UsdPreviewSurface does not blur
                                                                                       // transmission
  const bool passes = row[kTransmission] > 0 && !(int_at(row, kFlags) & kThin) && clear;
  const bool reflects = row[kAlpha] < kCasterAlpha && std::max({row[kF0], row[kF0 + 1], row[kF0 + 2]}) > 0.01f;
  return passes || reflects || (row[kClearcoat] > 0 && row[kClearcoatAlpha] < kCasterAlpha);
}

CausticTarget ball_about(const Box& b) {
  const float radius = 0.5f * length(b.high - b.low);
  return {(b.low + b.high) * 0.5f, radius, radius};
}

// Triangles of a cluster; more where the scene has so many that there would be more than kMostClusters.
constexpr size_t kCluster = 64, kMostClusters = 1024;

// Number that orders points along a curve which fills the box, so that those with similar numbers are close.
uint32_t place_in(const Box& box, const vec3& p) {
  const auto spread = [](float x) {
    auto v = uint32_t(std::clamp(x, 0.0f, 1.0f) * 1023);
    v = (v | v << 16) & 0x030000ffu, v = (v | v << 8) & 0x0300f00fu, v = (v | v << 4) & 0x030c30c3u;
    return (v | v << 2) & 0x09249249u;
  };
  const vec3 side = box.high - box.low, at = p - box.low;
  return spread(at.x / std::max(side.x, 1e-30f)) | spread(at.y / std::max(side.y, 1e-30f)) << 1 |
         spread(at.z / std::max(side.z, 1e-30f)) << 2;
}

// Adds the clusters of one mesh. They share the mesh's share by their cross sections.
void add_clusters(const Scene& scene, const Group& group, const std::vector<size_t>& triangles, size_t each,
                  std::vector<CausticTarget>& targets) {
  const auto corner = [&](size_t t, size_t k) {
    const float* p = &scene.positions[3 * (size_t(group.vertex_base) + scene.indices[3 * t + k])];
    return vec3{p[0], p[1], p[2]};
  };
  Box all;
  for (const size_t t : triangles)
    for (size_t k = 0; k < 3; ++k) all.add(corner(t, k));
  std::vector<std::pair<uint32_t, size_t>> order;
  for (const size_t t : triangles)
    order.emplace_back(place_in(all, (corner(t, 0) + corner(t, 1) + corner(t, 2)) * (1.0f / 3)), t);
  std::sort(order.begin(), order.end());
  const size_t first = targets.size();
  double sum = 0;
  for (size_t i = 0; i < order.size(); i += each) {
    Box box;
    for (size_t n = i; n < std::min(i + each, order.size()); ++n)
      for (size_t k = 0; k < 3; ++k) box.add(corner(order[n].second, k));
    targets.push_back(ball_about(box));
    sum += double(targets.back().radius) * double(targets.back().radius);
  }
  const double share = double(ball_about(all).radius) / std::max(sum, 1e-30);
  for (size_t i = first; i < targets.size(); ++i)
    targets[i].share = float(share * double(targets[i].radius) * double(targets[i].radius));
}

// Calls f(triangle, mesh) for each triangle of a group that casts caustics.
template <class F>
void for_casting_triangles(const Scene& scene, const Group& group, const std::vector<uint8_t>& caster, const F& f) {
  const size_t end = size_t(group.triangle_base) + group.triangle_count + group.cutout_count;
  for (size_t t = group.triangle_base; t < end; ++t) {
    const int32_t mesh = scene.triangle_mesh[t];
    if (caster[size_t(scene.meshes.surface[size_t(mesh)])]) f(t, mesh);
  }
}

// Adds the targets of a group: clusters of each mesh's triangles, and curved shapes.
void add_targets(const Scene& scene, const Group& group, const std::vector<uint8_t>& caster,
                 std::vector<CausticTarget>& targets) {
  size_t count = 0;
  for_casting_triangles(scene, group, caster, [&](size_t, int32_t) { ++count; });
  const size_t each = std::max(kCluster, (count + kMostClusters - 1) / kMostClusters);
  int32_t last = -1;
  std::vector<size_t> triangles;
  const auto flush = [&] {
    if (!triangles.empty()) add_clusters(scene, group, triangles, each, targets);
    triangles.clear();
  };
  for_casting_triangles(scene, group, caster, [&](size_t t, int32_t mesh) {
    if (mesh != last) flush();
    last = mesh;
    triangles.push_back(t);
  });
  flush();
  for_curved_kinds([&]<class K>(K) {
    const CurvedRange& r = group.curved.of<K>();
    for (uint32_t i = 0; i < r.count; ++i)
      if (caster[size_t(scene.curved.surface[r.first_row + i])])
        targets.push_back(ball_about(K::box(scene.curved.records<K>()[r.first + i])));
  });
}

// Ball around all of a group's targets.
CausticTarget ball_around(const std::vector<CausticTarget>& targets) {
  Box all;
  for (const CausticTarget& t : targets) {
    const vec3 side(t.radius);
    all.add(t.center - side), all.add(t.center + side);
  }
  return ball_about(all);
}

}  // namespace

std::vector<CausticTarget> caustic_targets(const Scene& scene) {
  std::vector<uint8_t> caster;
  bool any = false;
  for (size_t i = 0; i < scene.surfaces.rows.size() / kSurfaceFields; ++i) {
    float row[kSurfaceFields];
    average_row(scene, int32_t(i), row);
    caster.push_back(casts(row));
    any |= caster.back() != 0;
  }
  std::vector<CausticTarget> targets;
  if (!any) return targets;
  add_targets(scene, scene.groups[0], caster, targets);
  // Targets of instances; nested instances are left to chance.
  const Group& world = scene.groups[0];
  std::vector<CausticTarget> own;
  for (uint32_t k = world.placement_base; k < world.placement_base + world.placement_count; ++k) {
    own.clear();
    add_targets(scene, scene.groups[size_t(scene.placement_group[k])], caster, own);
    if (own.empty()) continue;
    const size_t first = size_t(scene.placement_instance[k]);
    const size_t end =
        k + 1 < scene.placement_instance.size() ? size_t(scene.placement_instance[k + 1]) : scene.world_from_group.size() / 12;
    if (own.size() * (end - first) > kMostClusters) own = {ball_around(own)};
    for (size_t i = first; i < end && targets.size() < kMostTargets; ++i) {
      const float* m = &scene.world_from_group[12 * i];
      const auto axis = [m](int c) { return vec3{m[3 * c], m[3 * c + 1], m[3 * c + 2]}; };
      const float scale = std::max({length(axis(0)), length(axis(1)), length(axis(2))});
      for (const CausticTarget& t : own)
        targets.push_back(
            {axis(0) * t.center.x + axis(1) * t.center.y + axis(2) * t.center.z + axis(3), t.radius * scale, t.share * scale});
    }
  }
  return targets;
}

namespace {

constexpr int W = PRIMRAY_MAX_LANES;
using F = vfloat<W>;
using I = vint<W>;
using B = vbool<W>;
using V = vvec3<W>;

// Lower limit of the density per steradian with which small lights are sampled.
constexpr float kSmallLight = 10, kSmallLightInside = 1;  // inside a ball, as seen from its surface
constexpr int kLongest = 10;                              // vertices of a photon's path
constexpr int kMostSurfaces = 24;                         // those and surfaces that it passes straight
constexpr int kRound = 1 << 14, kRounds = 16, kTask = 256;
// Limits of the number of photons, and their number by the frame's pixels; for small images photons would cost more than they
// gain.
constexpr size_t kFewest = 1 << 13, kMost = 1 << 17, kPixelsEach = 4;
// A photon's gradients are computed from two photons that start near it, offset by this share of their target.
constexpr int kCorners = 3;
constexpr float kSpacing = 2e-3f;
constexpr float kLeastSpread = 1e-4f;   // squared sine between their landing offsets
constexpr float kLeastApart2 = 1e-20f;  // squared distances to those: less is rounding, and gradients would overflow
static_assert(W >= kCorners);
constexpr uint32_t kPhotonSeed = 0x51ed270bu;

// Media around the lights that have a position, where media are followed. Lights that are meshes count as outside of all
// bodies; leaving one that was not entered corrects that.
class MediaAroundLights {
 public:
  explicit MediaAroundLights(const Scene& scene) {
    if (!scene.interiors.followed) return;
    const LightTable& lights = scene.lights;
    for (int i = 0; i < lights.analytic_count && i < kMostLights; ++i) {
      const float* row = lights.row(i);
      const LightType type = LightType(int_at(row, kType));
      const bool everywhere = type == LightType::kDistant || type == LightType::kDome;
      add(everywhere ? MediaAround() : media_around(scene, {row[kOrigin], row[kOrigin + 1], row[kOrigin + 2]}));
    }
    while (volumes_.size() < size_t(lights.count)) add(MediaAround());
  }

  ShadowMedia<W> of(I light, VolumeSets& sets) const {
    ShadowMedia<W> media;
    for (int k = 0; k < kMaxNestedMedia; ++k)
      media.stack.surfaces[k] = gather<W>(surfaces_.data() + k, light * I(kMaxNestedMedia));
    alignas(64) int32_t set[W];
    for (int i = 0; i < W; ++i) {
      set[i] = 0;
      for (const VolumeObject& object : volumes_[size_t(light[i])]) set[i] = sets.after(set[i], object, true);
    }
    media.volumes = load<W>(set), media.sets = &sets;
    return media;
  }

 private:
  // Limit of the lights around which rays are traced.
  static constexpr int kMostLights = 4096;

  std::vector<int32_t> surfaces_;
  std::vector<std::vector<VolumeObject>> volumes_;

  void add(const MediaAround& around) {
    surfaces_.insert(surfaces_.end(), std::begin(around.surfaces), std::end(around.surfaces));
    volumes_.push_back(around.volumes);
  }
};

class Photons {
 public:
  Photons(const Scene& scene, std::vector<CausticTarget> targets, int longest)
      : scene_(scene), targets_(std::move(targets)), around_lights_(scene), longest_(longest) {
    double sum = 0, run = 0;
    for (const CausticTarget& t : targets_) sum += double(t.share);
    for (const CausticTarget& t : targets_) {
      cdf_.push_back(float(run)), run += double(t.share) / sum;
      data_.insert(data_.end(), {t.center.x, t.center.y, t.center.z, t.radius, float(double(t.share) / sum)});
    }
    cdf_.push_back(1.0f);
  }

  // Traces photons [first, first + kTask).
  void trace(uint32_t first, std::vector<CausticPhoton>& landed) const {
    VolumeSets sets(scene_.interiors);
    for (int i = 0; i < kTask; i += W / kCorners) {
      alignas(64) int32_t number[W], corner[W], inside[W];
      for (int k = 0; k < W; ++k) {
        const int photon = i + k / kCorners;
        number[k] = int32_t(first) + photon, corner[k] = k % kCorners;
        inside[k] = k / kCorners < W / kCorners && photon < kTask;
      }
      trace_lanes({bit_cast<vuint<W>>(load<W>(number)), load<W>(corner), load<W>(inside) != I(0)}, sets, landed);
    }
  }

 private:
  const Scene& scene_;
  const std::vector<CausticTarget> targets_;
  const MediaAroundLights around_lights_;
  const int longest_;
  std::vector<float> cdf_, data_;

  // Photons in triples of adjacent lanes: the photon itself, and two that start near it and are scattered by the same random
  // numbers.
  struct Corners {
    vuint<W> number;
    I corner;
    B active;
  };

  // Length of photons' ways, and 1 / the distance of their light from their target; 0: it is at infinity.
  struct Way {
    F length, by_distance;
    // Ratio of unoccluded light at the target to that after such a way.
    F spread() const {
      const F ratio = length * by_distance;
      return select(by_distance > F(0.0f), ratio * ratio, F(1.0f));
    }
  };

  // Photon on its way: its ray, the area of unoccluded light that it represents, and its throughput, of the light's colour and
  // luminance 1 at the start.
  struct Flight {
    Rays<W> ray;
    F weight{0.0f};
    V beta{F(0.0f)};
    Way travelled{F(0.0f), F(0.0f)};
    ShadowMedia<W> media;
    F passed{0.0f};  // way along the ray up to the last boundary of a volume

    F brings() const { return weight * travelled.spread() * luminance(beta); }
  };

  // Samples a point of lights as seen from p. `among_triangles`: random bits that choose a mesh light's triangle.
  LightSample<W> point_on_light(B m, I light, const V& p, vuint<W> among_triangles, const Pair<W>& u, F time) const {
    const LightTable& lights = scene_.lights;
    LightSample<W> s = light_sample(lights, light, m, p, u.u, u.v, time);
    if (!scene_.emitters.any()) return s;
    const B mesh = m & is_type(LightRow<W>(lights, light).type(), LightType::kMesh);
    if (any(mesh)) sample_mesh(scene_, mesh, light, p, V(F(0.0f)), among_triangles, u.u, u.v, time, s);
    return s;
  }

  B launch(const Corners& lanes, const Sampler<W>& sampler, VolumeSets& sets, Flight& photon) const {
    const LightTable& lights = scene_.lights;
    const I none(0);
    const I t = find_interval<W>(cdf_.data(), none, int(targets_.size()), sampler.single(none, Purpose::kLobe));
    const auto field = [&](int f) { return gather<W>(data_.data() + f, t * I(5)); };
    const V center{field(0), field(1), field(2)};
    const F radius = field(3);
    const LightChoice<W> choice =
        choose_light(lights, B(true), center, V(F(0.0f)), sampler.bits_of(none, Purpose::kLightChoice));
    const Pair<W> u = sampler.pair(none, Purpose::kLightPoint), disc = sampler.link(none);
    F time(0.0f);
    if (scene_.moves()) time = scene_.motion.opens + sampler.single(none, Purpose::kRoulette) * scene_.motion.length;
    const B possible = choice.probability > F(0.0f);
    const vuint<W> among_triangles = sampler.bits_of(none, Purpose::kEmitter);
    LightSample<W> s = point_on_light(possible, choice.light, center, among_triangles, u, time);
    // A light inside the ball, as a lamp in a globe, is sampled from points of the ball's surface.
    const F reach = radius * 1.01f;
    const B inside = possible & !((s.pdf > F(0.0f)) & (s.t > reach));
    V reference = center, outwards = s.wi;
    if (any(inside)) {
      outwards = select(inside, direction_at(1.0f - 2.0f * disc.u, disc.v), outwards),
      reference = select(inside, center + outwards * radius, center);
      const LightSample<W> other = point_on_light(inside, choice.light, reference, among_triangles, u, time);
      s.wi = select(inside, other.wi, s.wi), s.t = select(inside, other.t, s.t), s.pdf = select(inside, other.pdf, s.pdf);
      s.L = select(inside, other.L, s.L), s.is_delta = (inside & other.is_delta) | (!inside & s.is_delta);
    }
    B alive = lanes.active & possible & (s.pdf > F(0.0f));
    alive &= s.is_delta | (s.pdf > select(inside, F(kSmallLightInside), F(kSmallLight)));
    alive &= max_component(s.L) > F(0.0f);
    const Frame<F> frame(outwards);
    const SinCos<W> phi = sincos_turns(disc.v);
    const F spacing = radius * kSpacing, zero(0.0f), r = select(inside, zero, radius * sqrt(disc.u));
    const V at = reference + frame.s * (r * phi.cos + select(lanes.corner == I(1), spacing, zero)) +
                 frame.t * (r * phi.sin + select(lanes.corner == I(2), spacing, zero));
    // Start at the light's sampled point, unless it is at infinity.
    const B near = s.t < F(1e18f);
    const V point = reference + s.wi * select(near, s.t, F(0.0f));
    const V wi = select(near, normalize(point - at), s.wi);
    const F way = length(point - at);
    const V start = at + wi * select(inside, 0.999f * way, reach);
    const F left = select(inside, F(0.0f), select(near, way - reach, F(kInfinity)));
    alive &= inside | (left > F(0.0f));
    if (!any(alive)) return alive;
    const Rays<W> to_light{start, wi, F(0.0f), left * 0.999f, time};
    if (const B outside = alive & !inside; any(outside)) alive &= inside | !occluded(scene_, true, outside, to_light);
    photon.ray = {start, -wi, F(0.0f), F(kInfinity), time};
    photon.travelled = {select(near, left, F(0.0f)), select(near, 1.0f / max(s.t, 1e-20f), F(0.0f))};
    photon.weight = radius * radius * select(inside, 4.0f * abs(dot(outwards, s.wi)), F(1.0f)) * kPi / field(4);
    photon.beta = s.L * (1.0f / max(luminance(s.L), 1e-30f));
    if (scene_.interiors.followed) {
      photon.media = around_lights_.of(select(alive, choice.light, none), sets);
      photon.beta = photon.beta * transmittance_along(scene_, photon.media, to_light, left, near);
    }
    return alive & (max_component(photon.beta) > F(0.0f));
  }

  // Attenuates photons on their way to hits at distance `t`, and moves those that hit boundaries of volumes through them;
  // returns their lanes. `front`: lanes that hit a surface from outside.
  B cross_media(B alive, const Hits<W>& hits, const Interaction<W>& it, F t, B front, Flight& photon) const {
    ShadowMedia<W>& media = photon.media;
    const B passes = bounds_volume(scene_, alive, it.surface);
    if (const B leaves = passes & !front; any(leaves))
      enter_missed(scene_, *media.sets, leaves, hits, it.surface, front, media.volumes);
    photon.beta = photon.beta * transmittance_along(scene_, media, photon.ray, t, alive);
    if (!any(passes)) return passes;
    cross_boundaries(scene_, *media.sets, passes, hits, it.surface, front, media.volumes);
    // As camera paths do: the origin stays, so that no surface near the boundary is skipped.
    media.origin_distance = select(passes, -t, media.origin_distance);
    photon.ray.tnear = select(passes, behind_boundary(t, it.offset), photon.ray.tnear);
    photon.passed = select(passes, t, photon.passed);
    return passes;
  }

  // Boundary of media that photons meet; those that missed an earlier one are attenuated as if they had come through it.
  Boundary<W> boundary_at(B meets, const Interaction<W>& it, F t, B front, Flight& photon) const {
    const ShadowMedia<W>& media = photon.media;
    if (!scene_.interiors.followed) return Boundary<W>(media.stack);
    const Boundary<W> boundary(scene_, meets, media.stack, it.surface, front);
    if (const B m = boundary.missed & (media.stack.top() < I(0)); any(m)) {
      const V left = medium_of(scene_, boundary.here).transmittance(t + media.origin_distance);
      photon.beta = select(m, photon.beta * left, photon.beta);
    }
    return boundary;
  }

  // Returns the lanes whose sample continues a caustic: by a lobe that is smooth enough. `lobe`: the number that chose it;
  // `front`: hit from outside, so that a reflection does not stay in a body.
  static B stays_narrow(const BsdfWithOpenPbr<W>& bsdf, const BsdfSample<W>& s, B front, F lobe) {
    const B passes = bsdf.lets_through() & (s.transmits | !front);
    const B smooth_base = bsdf.alpha < select(passes, F(kPassedAlpha), F(kCasterAlpha));
    const F among = lobe / max(bsdf.presence, 1e-20f);
    B smooth = among >= bsdf.p_diffuse;
    if (bsdf.any_coat) {
      const B coat = among >= bsdf.p_diffuse + bsdf.p_specular;
      smooth &= (coat & (bsdf.coat_alpha < F(kCasterAlpha))) | ((!coat) & smooth_base);
    } else {
      smooth &= smooth_base;
    }
    return bsdf.preview & (s.is_delta | smooth) & (max_component(s.weight) > F(0.0f));
  }

  void trace_lanes(const Corners& lanes, VolumeSets& sets, std::vector<CausticPhoton>& landed) const {
    const bool follows = scene_.interiors.followed;
    const Sampler<W> sampler{reverse_bits(lanes.number), Sampler<W>::pixel_seed(kPhotonSeed, I(0), I(0), vuint<W>(0u))};
    Flight photon;
    Rays<W>& rays = photon.ray;
    B alive = launch(lanes, sampler, sets, photon), scattered(false);
    V source = rays.o;
    I way(0);  // hash of the surfaces that were hit, and of what passed them
    I vertex(1);
    for (int surface = 1; surface <= kMostSurfaces && any(alive); ++surface) {
      const Hits<W> hits = intersect(scene_, true, alive, rays);
      alive &= hits.geom != I(-1);
      if (!any(alive)) return;
      Interaction<W> it = interact(scene_, alive, rays, hits);
      const V wo = -rays.d;
      const F t = max(dot(it.p - rays.o, rays.d), 0.0f);
      photon.travelled.length += max(t - photon.passed, 0.0f);
      const B front = dot(it.ng, wo) > F(0.0f), passes = follows ? cross_media(alive, hits, it, t, front, photon) : B(false);
      way = way * I(31) + it.surface * I(2);
      const B meets = alive & !passes;
      if (!any(meets)) continue;

      // The surface's lobes, and the media on both of its sides
      SurfaceRows<W> rows(scene_.surfaces, it.surface);
      LaneRows<W> varying;
      if (any_inputs(scene_, alive, it.surface))
        rows = evaluate_inputs(scene_, alive, hits, it.surface, F(0.0f), it.p, it.ng, it.ns, varying);
      const F side = select(front, F(1.0f), F(-1.0f));
      const V ng = it.ng * side, ns = it.ns * side;
      Frame<F> frame(select(dot(ns, wo) > F(1e-4f), ns, ng));
      if (!scene_.surfaces.open_pbr.empty()) align_tangent(rows, alive, frame);
      const V local = frame.to_local(wo);
      const Boundary<W> boundary = boundary_at(meets, it, t, front, photon);
      const BsdfWithOpenPbr<W> bsdf(rows, alive, local, front, boundary.ior_outside);

      // Photons land on what scatters widely, and go on from what does not
      const B there = meets & scattered & !boundary.overridden;
      store_photons(there, there & (lanes.corner == I(0)) & follows_caustics<W>(bsdf), it.p, wo, length(it.p - source), way,
                    photon.brings(), landed);
      if (!bsdf.any_preview && !follows) return;
      const Pair<W> u = sampler.link(I(surface));
      const F lobe = sampler.single(I(surface), Purpose::kLobe);
      const BsdfSample<W> s = bsdf.sample(local, lobe, u.u, u.v);
      const B straight = s.straight | boundary.overridden, transmits = s.transmits | boundary.overridden;
      const V d = select(straight, rays.d, frame.to_world(s.wi));
      const F out = dot(ng, d);
      alive &= passes | boundary.overridden | (stays_narrow(bsdf, s, front, lobe) & (s.transmits | (out > F(0.0f))));
      const B moves = alive & meets, bends = moves & !straight;
      source = select(bends, it.p, source);
      way += select(transmits & meets, I(1), I(0));
      scattered |= bends;
      // All lobes together never gain; one of them may, by the probability of its choice.
      photon.beta = select(bends, photon.beta * s.weight * min(1.0f / max(luminance(s.weight), 1e-20f), 1.0f), photon.beta);
      vertex += select(bends, I(1), I(0));
      alive &= vertex <= I(longest_);
      rays.o = select(moves, it.p + ng * (it.offset * select(out > F(0.0f), F(1.0f), F(-1.0f))), rays.o);
      rays.d = select(moves, d, rays.d), rays.tnear = select(moves, F(0.0f), rays.tnear);
      photon.passed = select(moves, F(0.0f), photon.passed);
      if (!follows) continue;
      ShadowMedia<W>& media = photon.media;
      media.stack = select(moves, select(transmits, boundary.beyond, boundary.here), media.stack);
      media.origin_distance = select(moves, origin_distance_of(it.offset, ng, d), media.origin_distance);
    }
  }

  // Stores photons `chosen` of those that are `there`, with gradients where their neighbours took the same path.
  static void store_photons(B there, B chosen, const V& p, const V& direction, F distance, I way, F weight,
                            std::vector<CausticPhoton>& landed) {
    const auto at = [](const V& v, int i) { return vec3{v.x[i], v.y[i], v.z[i]}; };
    constexpr uint32_t all = (1u << kCorners) - 1;
    for (uint32_t b = bits(chosen); b; b &= b - 1) {
      const int i = __builtin_ctz(b);
      CausticPhoton photon{at(p, i), at(direction, i), distance[i], weight[i]};
      if ((bits(there) >> i & all) == all && way[i + 1] == way[i] && way[i + 2] == way[i]) {
        const vec3 landings[2] = {at(p, i + 1) - photon.landing, at(p, i + 2) - photon.landing};
        const vec3 turns[2] = {at(direction, i + 1) - photon.direction, at(direction, i + 2) - photon.direction};
        add_gradients(landings, turns, photon);
      }
      landed.push_back(photon);
    }
  }

  // Adds the smallest gradients that map changes of the landing point to changes of the direction: by the pseudo-inverse of the
  // landing offsets.
  static void add_gradients(const vec3 (&landings)[2], const vec3 (&turns)[2], CausticPhoton& photon) {
    const vec3 &a = landings[0], &b = landings[1];
    const float aa = dot(a, a), ab = dot(a, b), bb = dot(b, b), det = aa * bb - ab * ab;
    if (!(det > kLeastSpread * aa * bb) || std::min(aa, bb) < kLeastApart2) return;
    const vec3 by_a = (a * bb - b * ab) * (1 / det), by_b = (b * aa - a * ab) * (1 / det);
    photon.gradient[0] = by_a * turns[0].x + by_b * turns[1].x;
    photon.gradient[1] = by_a * turns[0].y + by_b * turns[1].y;
    photon.gradient[2] = by_a * turns[0].z + by_b * turns[1].z;
  }
};

}  // namespace

std::vector<CausticPhoton> trace_photons(const Scene& scene, int longest, int threads, const std::atomic<bool>* cancel) {
  const auto is_cancelled = [&] { return cancel && cancel->load(std::memory_order_relaxed); };
  std::vector<CausticPhoton> all;
  if (scene.lights.count == 0) return all;
  std::vector<CausticTarget> targets = caustic_targets(scene);
  if (targets.empty()) return all;
  const Photons photons(scene, std::move(targets), std::min(longest, kLongest));
  const size_t pixels = size_t(scene.camera.width) * size_t(scene.camera.height);
  const size_t enough = std::clamp(pixels / kPixelsEach, kFewest, kMost);
  int rounds = 0;
  while (rounds < kRounds && all.size() < enough) {
    std::vector<CausticPhoton> landed[kRound / kTask];
    std::atomic<int> next{0};
    const auto work = [&] {
      const TimeSpan span("trace photons");
      set_float_mode();
      for (int i; (i = next++) < kRound / kTask && !is_cancelled();)
        photons.trace(uint32_t(rounds * kRound + i * kTask), landed[i]);
    };
    std::vector<std::thread> pool;
    for (int i = 0; i < std::max(threads, 1); ++i) pool.emplace_back(work);
    for (std::thread& t : pool) t.join();
    for (const auto& part : landed) all.insert(all.end(), part.begin(), part.end());
    ++rounds;
    if (is_cancelled()) return {};
    if (all.size() < size_t(kRound) / 512) return {};  // hardly any light comes that way
  }
  for (CausticPhoton& p : all) p.weight /= float(rounds * kRound);
  return all;
}

}  // namespace primray
