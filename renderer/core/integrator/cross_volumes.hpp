// Stages of a round in scenes with volumes. Between the traced rays and media: each path's first collision within its volumes
// becomes its hit. After media: paths that collide scatter there, and are not shaded in this round.
#pragma once

#include "integrator/camera_visibility.hpp"
#include "integrator/gather_emission.hpp"
#include "integrator/media.hpp"
#include "integrator/phase_vertex.hpp"
#include "integrator/place_in_depth.hpp"
#include "integrator/sample_light.hpp"
#include "integrator/scatter.hpp"
#include "integrator/volume_state.hpp"

namespace primray {

// Value of Hits::geom for a collision in a volume: `inst` is then the volume's instance, `ng` the albedo there, and `prim` the
// path's place in the pool when its ray was traced.
constexpr int32_t kVolumeHit = -2;

// Finds the first collision of each path of the pool.
template <int W>
PRIMRAY_RARE void collide_in_volumes(Round& round) {
  using F = vfloat<W>;
  using I = vint<W>;
  PathPool& pool = *round.worker.pool;
  VolumeState& state = *round.worker.volumes;
  for (int at = 0; at < pool.count; at += W) {
    F end = min(load<W>(pool.tfar + at), select(load<W>(pool.geom + at) != I(-1), load<W>(pool.t + at), kInfinity));
    // Random walks below opaque surfaces are not in volumes.
    if (round.follows_media()) end = select(round.worker.medium_states->pool->template at<W>(at).in_subsurface(), F(0.0f), end);
    store(state.end + at, end), store(state.instance + at, I(-1));
    store(state.number + at,
          volume_seed<W>(load<W>(pool.seed + at), load<W>(pool.reversed_index + at), load<W>(pool.vertex + at)));
  }
  const VolumeRays rays{pool.ox,   pool.oy,    pool.oz,   pool.dx,      pool.dy,
                        pool.dz,   pool.tnear, state.end, state.number, round.needs.time ? pool.time : nullptr,
                        pool.depth};
  sample_collisions<W>(
      *round.scene.volumes, rays, pool.count, state.passes,
      {state.end, pool.beta_r, pool.beta_g, pool.beta_b, state.instance, state.albedo[0], state.albedo[1], state.albedo[2]});
  for (int i = 0; i < pool.count; ++i) {
    if (state.instance[i] < 0) continue;
    pool.t[i] = state.end[i], pool.geom[i] = kVolumeHit, pool.inst[i] = state.instance[i], pool.prim[i] = i;
    pool.ngx[i] = state.albedo[0][i], pool.ngy[i] = state.albedo[1][i], pool.ngz[i] = state.albedo[2][i];
  }
}

// Scatters at distance `t` along the rays as at any vertex.
template <int W>
PRIMRAY_RARE void scatter_in_volume(Round& round, vbool<W> scatters, const PathLanes<W>& p, const Hits<W>& hits,
                                    vfloat<W> phase, const MediumInterface<W>* media) {
  with_phase_vertex(round, p, hits.prim, hits.t, phase, media, [&](const auto& v) {
    if (round.scene.lights.count > 0) sample_lights(round, scatters, v, p);
    scatter(round, scatters, v, p);
  });
}

// Advances one packet of paths of which `collides` collide in a volume.
template <int W>
PRIMRAY_RARE void shade_volume_lanes(Round& round, int at, vbool<W> collides, PathLanes<W>& p, const Hits<W>& hits) {
  using F = vfloat<W>;
  const VolumeTable& volumes = *round.scene.volumes;
  const bool in_media = round.follows_media();

  // Gather emission of lights before the collision
  const vbool<W> looks = in_media ? collides & !has_crossed_medium<W>(round, at) : collides;
  vbool<W> reaches = collides;
  if (round.deep) place_in_depth(round, collides, looks, collides, hits, true, p);
  vvec3<W> gathered = gather_emission(round, collides, looks, p, hits, reaches);
  if (in_media) gathered = gathered * radiance_scale_at<W>(round, at);
  if (PathLog* const log = path_log<W>(round); log && any(max_component(abs(gathered)) > F(0.0f)))
    log->add("gathered", p).put("radiance", gathered);
  add_to_slots(round, collides, sum_of(round, p.slot, p.depth), p.beta * gathered);
  if (round.needs.lpe) add_recorded_at(round, at, p), resolve_lpe_where(reaches, p);
  if (round.scene.has_thin) clear_gap_marks(round, reaches & (p.depth == vint<W>(0)), p);

  // End paths at mattes, which cover nothing of their pixels
  if (const CameraVisibilityTable& camera = volumes.in_media.camera; camera.any()) {
    const vbool<W> matte = camera.lanes_with(CameraVisibility::kMatte, reaches & (p.depth == vint<W>(0)), hits.inst);
    if (any(matte)) reduce_alpha(round, matte, p);
    reaches &= !matte;
    if (PathLog* const log = path_log<W>(round); log && any(matte)) log->end(p, "a matte ends it");
  }

  // Scatter
  // All lights illuminate volumes, whichever surface the path comes from.
  p.link = vint<W>(0);
  const MediumLanes<W> medium(volumes, select(collides, hits.inst, vint<W>(0)));
  p.beta = select(collides, p.beta * hits.ng, p.beta);
  const vbool<W> scatters = reaches & (p.depth < vint<W>(round.settings.max_depth)) & (max_component(p.beta) > F(0.0f));
  if (PathLog* const log = path_log<W>(round); log && any(reaches)) {
    log->add("volume", p).put("distance", log->length(hits.t)).put("throughput", p.beta).why = "collides";
    if (!any(scatters)) log->end(p, "the maximum depth is reached, or the volume only absorbs");
  }
  if (!any(scatters)) return;
  if (!in_media) return scatter_in_volume<W>(round, scatters, p, hits, medium.phase(), nullptr);
  MediumState<W> state = round.worker.medium_states->pool->template at<W>(at);
  state.origin_distance = F(0.0f);
  const MediumInterface<W> media{state, Boundary<W>(state.stack), {}};
  scatter_in_volume<W>(round, scatters, p, hits, medium.phase(), &media);
}

// Scatters the paths that collide in volumes; the others stay in the pool.
template <int W>
PRIMRAY_RARE void shade_volumes(Round& round) {
  Worker& w = round.worker;
  PathPool& pool = *w.pool;
  const bool in_media = round.follows_media();
  const int count = pool.count;
  int staying = 0;
  for (int at = 0; at < count; at += W) {
    const vbool<W> active = lane_numbers<W>() < vint<W>(count - at);
    const vbool<W> collides = active & (load<W>(pool.geom + at) == vint<W>(kVolumeHit));
    if (!any(collides) && staying == at) {
      staying += std::min(W, count - at);
      continue;
    }
    PathLanes<W> p = pool.paths<W>(at, round.needs);
    const Hits<W> hits = pool.hits<W>(at);
    MediumState<W> state;
    if (in_media) state = w.medium_states->pool->template at<W>(at);
    if (any(collides)) {
      PathLanes<W> scattered = p;
      shade_volume_lanes(round, at, collides, scattered, hits);
    }
    const Compaction<W> c(active & !collides);
    if (in_media) w.medium_states->pool->put(staying, c, state);
    put_hits(pool, staying, c, hits);
    pool.count = staying;
    pool.append(c, p, round.needs);
    staying = pool.count;
  }
  pool.count = staying;
}

}  // namespace primray
