// State that all stages of the path loop share: the scene, one task's samples, and the worker that renders them.
//
// A round advances every path of the pool by one vertex: refill with camera rays, trace, cross volumes and media (in scenes
// that have any), shade (which leaves the surviving paths compacted in the other pool and shadow rays in a queue), trace the
// shadow rays. Each stage is a file of free functions over this.
#pragma once

#include <memory>

#include "guiding/guide.hpp"
#include "integrator/path_log.hpp"
#include "integrator/tile_task.hpp"

namespace primray {

// Optional state that paths of this scene carry.
inline PathNeeds path_needs(const Scene& scene, const IntegratorSettings& settings) {
  return {.travelled = scene.has_thin,
          .cones = scene.has_inputs || scene.interiors.walks,
          .diffuse_shares = scene.lights.lobe_factors || settings.lpe,
          .links = scene.lights.links.any(),
          .time = scene.moves(),
          .normals = scene.lights.by_tree() || scene.emitters.by_triangle(),
          .first_received = settings.guide != nullptr,
          .lpe = settings.lpe != nullptr};
}

struct Round {
  const Scene& scene;
  const IntegratorSettings& settings;
  const TileBlock& block;
  Worker& worker;
  RayRecorder* recorder;
  const PathNeeds needs;
  const int samples;  // per pixel, both replicates together
  // Paths follow both directions of the first smooth glass that they meet. Guides learn from paths that have one.
  const bool branches;
  int pixels = 0;              // of the block, as the worker lists them
  int next_slot = 0;           // slot of the next camera ray
  int first_camera = 0;        // index in the pool of the first camera ray
  const bool sorts;            // the pool's paths by the surfaces that they hit, before these are shaded
  bool outlined = false;       // outlines of lights cross some pixels of this tile
  DeepLayers* deep = nullptr;  // of the block's samples; null: no deep picture

  Round(const Scene& scene_, const IntegratorSettings& settings_, const TileBlock& block_, Worker& worker_,
        RayRecorder* recorder_)
      : scene(scene_),
        settings(settings_),
        block(block_),
        worker(worker_),
        recorder(recorder_),
        needs(path_needs(scene_, settings_)),
        samples(block_.count[0] + block_.count[1]),
        branches(scene_.has_smooth_glass && !settings_.guide_log),
        sorts(scene_.sort_shift >= 0) {
    if (has_special() && !worker.special_shadows) worker.special_shadows = std::make_unique<SpecialShadowQueue>();
    if (follows_media() && !worker.medium_states) worker.medium_states = std::make_unique<MediumStateStore>(scene.interiors);
    if (follows_media()) worker.medium_states->forget_sets();
    if (has_volumes() && !worker.volumes) worker.volumes = std::make_unique<VolumeState>();
    if (samples_along_rays() && !worker.along) worker.along = std::make_unique<AlongState>(scene.lights.pivots);
    if (needs.lpe && !worker.lpe)
      worker.lpe = std::make_unique<LpeStore>(*settings.lpe, settings.clamps() ? Worker::kSums : Worker::kSlots);
    if (leaves_out_caustics()) worker.caustics.resize(3 * size_t(Worker::kSlots));
    if (scene.camera.flawed) worker.weights.resize(Worker::kSlots, vec3(1.0f));
  }

  bool has_special() const { return scene.lights.has_special(); }
  bool follows_media() const { return scene.interiors.followed; }
  bool samples_along_rays() const { return scene.lights.pivots.any(); }
  bool has_volumes() const { return scene.volumes != nullptr; }
  bool leaves_out_caustics() const { return settings.lpe && settings.lpe->leaves_out >= 0; }

  // Whether several paths of one sample are in the pool.
  bool has_parts() const { return settings.splits > 1 || branches; }

  // Index of the film point in the chain of linked dimensions that it forms with the following directions: each even link
  // shares a 4D point of a sequence with the next. Parts of a split path have indices of their own, so there the first two
  // directions are paired.
  int first_link() const { return settings.splits > 1 ? 1 : 0; }
  // Replicate of a pixel's k-th sample: those of the first replicate come first.
  int replicate(int k) const { return k < block.count[0] ? 0 : 1; }
  uint32_t index(int k) const { return uint32_t(replicate(k) ? block.first[1] + k - block.count[0] : block.first[0] + k); }
  int pixel_x(int i) const { return block.x0 + worker.pixel_x[i] * block.stride_x; }
  int pixel_y(int i) const { return block.y0 + worker.pixel_y[i] * block.stride_y; }
};

// Returns the log of the paths, which only the loop for one lane writes; null: none.
template <int W>
PRIMRAY_INLINE PathLog* path_log(const Round& round) {
  if constexpr (W == 1)
    return round.settings.path_log;
  else
    return nullptr;
}

// Returns ray times within the shutter interval for numbers u in [0, 1), at pixels (x, y), with rolling shutter.
template <int W>
PRIMRAY_INLINE vfloat<W> time_of(const Round& round, vfloat<W> u, vint<W> x, vint<W> y) {
  const MotionTable& motion = round.scene.motion;
  const vfloat<W> time = motion.opens + u * motion.length;
  if (!motion.rolls) return time;
  return min(max(time + to_float(x) * motion.per_column + to_float(y) * motion.per_row, 0.0f), vfloat<W>(1.0f));
}

// Adds to the medium of the paths at `at`: volumes and fog outside of objects with an interface, and what they emit.
template <int W>
PRIMRAY_RARE void add_media(const Round& round, int at, const MediumState<W>& state, RayMedium<W>& r) {
  const PathPool& pool = *round.worker.pool;
  const Interiors& interiors = round.scene.interiors;
  r.any_emission = interiors.emits;
  const vbool<W> in_subsurface = state.in_subsurface(), outside = (state.stack.top() < vint<W>(0)) & !in_subsurface;
  if (!interiors.emission.empty()) r.emission = emission_in(round.scene, state.stack, !in_subsurface);
  if (!any(outside)) return;
  const Rays<W> rays = pool.rays<W>(at);
  // A ray that reaches no surface is in no closed shape, but where the camera's far plane ends it.
  const vbool<W> closed = (load<W>(pool.geom + at) != vint<W>(-1)) | (rays.tfar < vfloat<W>(kInfinity));
  const vbool<W> in_volumes = outside & closed & (state.volumes != vint<W>(0));
  if (any(in_volumes)) {
    const vint<W> sets = select(in_volumes, state.volumes, vint<W>(0));
    r.add(in_volumes, round.worker.medium_states->sets, VolumeSets::row_of(sets, load<W>(pool.depth + at) == vint<W>(0)));
  }
  if (interiors.fog.any()) {
    const vbool<W> in_fog = interiors.fog.hidden ? outside & (load<W>(pool.depth + at) != vint<W>(0)) : outside;
    r.add(FogAlong<W>(interiors.fog, in_fog, rays.o - rays.d * state.origin_distance, rays.d), interiors.fog);
  }
}

// Medium that surrounds the paths at `at`, along their rays: `state` is theirs.
template <int W>
PRIMRAY_INLINE RayMedium<W> medium_at(const Round& round, int at, const MediumState<W>& state) {
  RayMedium<W> r(state.medium(round.scene));
  if (round.scene.interiors.has_added() || round.scene.interiors.emits) add_media(round, at, state, r);
  return r;
}
// Returns the lanes in which light samples can contribute: media without a refracting boundary, and all media if a light is
// inside one.
template <int W>
PRIMRAY_INLINE vbool<W> is_lit(const Scene& scene, const MediumState<W>& state) {
  if (scene.lights.count == 0) return vbool<W>(false);
  return (!state.in_subsurface()) & (vbool<W>(scene.interiors.lit) | (ior_in(scene, state.stack) == vfloat<W>(1.0f)));
}

// Whether the paths at `at` were in a medium: cross_media() has already added the lights that those rays hit.
template <int W>
PRIMRAY_RARE vbool<W> has_crossed_medium(const Round& round, int at) {
  return medium_at(round, at, round.worker.medium_states->pool->template at<W>(at)).exists();
}

// Factor of radiance that the paths at `at` receive (medium/medium_stack.hpp).
template <int W>
PRIMRAY_RARE vfloat<W> radiance_scale_at(const Round& round, int at) {
  return radiance_scale(round.scene, round.worker.medium_states->pool->template at<W>(at).stack);
}

// Alpha of the sample that `slot` names (integrator/tile_task.hpp).
PRIMRAY_INLINE float& alpha_of(const Round& round, int32_t slot) { return round.worker.a[slot & kSumMask]; }

// Index of the sum for light that reaches samples `slot` after that many scattering events.
template <int W>
PRIMRAY_INLINE vint<W> sum_of(const Round& round, vint<W> slot, vint<W> scatterings) {
  if (!round.settings.clamps()) return slot;
  return slot + select(scatterings > vint<W>(1), vint<W>(Worker::kSlots), vint<W>(0));
}

// Adds `c` to the slots of lanes `m`; most paths contribute nothing at most vertices.
template <int W>
PRIMRAY_INLINE void add_to_slots(const Round& round, vbool<W> m, vint<W> slot, const vvec3<W>& c) {
  Worker& w = round.worker;
  GuideLog* const log = round.settings.guide_log;
  DeepLayers* const deep = round.deep;
  const vfloat<W> zero(0.0f);
  for (uint32_t b = bits(m & ((c.x != zero) | (c.y != zero) | (c.z != zero))); b; b &= b - 1) {
    const int i = __builtin_ctz(b), s = slot[i] & kSumMask;
    PRIMRAY_ASSERT(s >= 0 && s % Worker::kSlots < round.pixels * round.samples && s < Worker::kSums);
    w.r[s] += c.x[i], w.g[s] += c.y[i], w.b[s] += c.z[i];
    if (deep) deep->add_light(slot[i], c.x[i], c.y[i], c.z[i]);
    if (log) log->add_light(s, c.x[i] + c.y[i] + c.z[i]);
    if (PathLog* const paths = path_log<W>(round)) paths->contribute(c.x[i], c.y[i], c.z[i]);
  }
}

}  // namespace primray
