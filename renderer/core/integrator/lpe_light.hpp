// Contributions of emission hit by path rays to light path expressions, light by light; integrator/shade.hpp adds the sums.
#pragma once

#include "integrator/emission.hpp"
#include "integrator/lpe_states.hpp"
#include "integrator/outline_rays.hpp"
#include "integrator/round.hpp"

namespace primray {

// Records radiance `L` of lights of kind `end` that lanes `m` hit; `factors` are the lights' lobe multipliers.
template <int W>
PRIMRAY_INLINE void record_emission(LpeStore& store, vbool<W> m, vint<W> end, const vvec3<W>& L, LobeFactors factors) {
  const vfloat<W> zero(0.0f);
  const uint32_t lanes = bits(m & ((L.x != zero) | (L.y != zero) | (L.z != zero)));
  if (lanes == 0) return;
  RecordedLight& light = store.recorded.emplace_back();
  light.lanes = lanes, light.diffuse = factors.diffuse, light.specular = factors.specular;
  for (int i = 0; i < W; ++i) light.end[i] = end[i], light.L[0][i] = L.x[i], light.L[1][i] = L.y[i], light.L[2][i] = L.z[i];
}

// Listener of intersect_lights() that records each light for light path expressions.
template <int W>
struct LpeListener {
  const LightTable& lights;
  LpeStore& store;

  LobeFactors factors(int i) const { return {lights.row(i)[kDiffuseFactor], lights.row(i)[kSpecularFactor]}; }
  void light(int i, vbool<W> m, const vvec3<W>& L) const {
    record_emission(store, m, vint<W>(lights.end_of(i)), L, factors(i));
  }
  void bodies(const LightHits<W>& seen, const vvec3<W>& L) const {
    for (uint32_t left = bits(seen.covered); left;) {
      const int32_t i = seen.light[__builtin_ctz(left)];
      const vbool<W> same = seen.covered & (seen.light == vint<W>(i));
      light(i, same, L);
      left &= ~bits(same);
    }
  }
  void dome(size_t k, vbool<W> m, const vvec3<W>& L) const {
    record_emission(store, m, vint<W>(lights.dome_traits[k].end), L, lights.dome_factors[k]);
  }
};

// Medium in which lanes look for lights, and its extra distance before the ray's origin.
template <int W>
struct ListenerMedium {
  const RayMedium<W>* medium = nullptr;
  vfloat<W> origin_distance{0.0f};
};

// Records what gather_emission() is about to gather; `hit` are the lanes that hit a surface. Camera rays of pixels in which a
// light has its own outline rays contribute nothing of that light.
template <int W>
PRIMRAY_RARE void record_light_hits(Round& round, vbool<W> looks, const PathLanes<W>& p, const Hits<W>& hits, vbool<W> hit,
                                    const ListenerMedium<W>& in = {}) {
  LpeStore& store = *round.worker.lpe;
  const LightTable& lights = round.scene.lights;
  const LpeListener<W> listener{lights, store};
  vvec3<W> gathered(vfloat<W>(0.0f));
  const LightHits<W> light_hits =
      intersect_lights(lights, looks, hit, p, hits.t, gathered, in.medium, in.origin_distance, listener);
  if (in.medium) return;
  if (const vbool<W> camera = light_hits.covered & (p.vertex == vint<W>(0)); round.outlined && any(camera)) {
    const uint32_t outlined = bits(is_outlined(round, camera, p.slot, light_hits.light));
    for (RecordedLight& light : store.recorded) light.lanes &= ~outlined;
  }
}

template <int W>
PRIMRAY_RARE void record_domes(Round& round, vbool<W> escaped, const PathLanes<W>& p) {
  evaluate_domes(round.scene.lights, escaped, p, LpeListener<W>{round.scene.lights, *round.worker.lpe});
}

// Records radiance `L` of emissive surfaces that lanes `m` hit.
template <int W>
PRIMRAY_RARE void record_surface_emission(Round& round, vbool<W> m, const Hits<W>& hits, const Interaction<W>& it,
                                          const vvec3<W>& L) {
  const Scene& scene = round.scene;
  const GeometryLights& lights = scene.geometry_lights;
  vint<W> number(-1);
  if (lights.any()) number = geometry_light(scene, m, hits, it);
  for (uint32_t left = bits(m); left;) {
    const int32_t of = number[__builtin_ctz(left)];
    const vbool<W> same = m & (number == vint<W>(of));
    left &= ~bits(same);
    const int32_t end = of < 0 ? int32_t(kEndObject) : lights.ends[size_t(of)];
    LobeFactors factors;
    if (of >= 0) factors = {lights.diffuse[size_t(of)], lights.specular[size_t(of)]};
    record_emission(*round.worker.lpe, same, vint<W>(end), L, factors);
  }
}

// Adds all recorded contributions, multiplied by `weight`, path by path, so that the sums do not depend on the lane count.
template <int W>
PRIMRAY_RARE void add_recorded(Round& round, const PathLanes<W>& p, const vvec3<W>& weight) {
  LpeStore& store = *round.worker.lpe;
  const vint<W> sum = sum_of(round, p.slot, p.depth) & vint<W>(kSumMask);
  for (int i = 0; i < W; ++i)
    for (const RecordedLight& light : store.recorded) {
      if (!(light.lanes >> i & 1)) continue;
      const float share[3] = {p.diffuse_share.x[i], p.diffuse_share.y[i], p.diffuse_share.z[i]};
      LpeLight r{p.lpe_diffuse[i], p.lpe_other[i], same_ends(light.end[i]), {}};
      for (int c = 0; c < 3; ++c) r.share[c] = share_of(share[c] * light.diffuse, (1 - share[c]) * light.specular);
      store.add(sum[i], 0, r, weight.x[i] * light.L[0][i]), store.add(sum[i], 1, r, weight.y[i] * light.L[1][i]);
      store.add(sum[i], 2, r, weight.z[i] * light.L[2][i]);
    }
  store.recorded.clear();
}

// Stores the light path states of light samples that are about to be queued; lanes `special` go to the queue of special
// shadows.
template <int W, class Lobes>
PRIMRAY_RARE void put_shadow_lpe_states(Round& round, vbool<W> special, vbool<W> other, const PathLanes<W>& p,
                                        const BsdfEval<W>& f, vbool<W> beyond, vint<W> light) {
  Worker& w = round.worker;
  LpeStore& store = *w.lpe;
  const LightTable& lights = round.scene.lights;
  const auto put = [&](vbool<W> m, ShadowLpeStates& to, int at) {
    for (uint32_t b = bits(m); b; b &= b - 1, ++at) {
      const int i = __builtin_ctz(b);
      const float* row = lights.row(light[i]);
      to.put(at, sampled_lpe<Lobes::kInMedium>(store.tables, p, f, beyond[i], row[kDiffuseFactor], row[kSpecularFactor],
                                               lights.end_of(light[i]), i));
    }
  };
  if (w.special_shadows) put(special, store.special_shadows, w.special_shadows->rays.count);
  put(other, store.shadows, w.shadows.count);
}

// Stores the light path states of rays `n` in lanes `m` that are about to be queued as shadow rays towards all domes. Each
// colour channel is attributed to one dome, drawn in proportion to the domes' radiance.
template <int W>
PRIMRAY_RARE void put_sky_lpe_states(Round& round, vbool<W> m, const PathLanes<W>& n) {
  LpeStore& store = *round.worker.lpe;
  record_domes(round, m, n);
  const vfloat<W> u = n.sampler.single(n.vertex, Purpose::kFilm);
  int at = round.worker.shadows.count;
  for (uint32_t b = bits(m); b; b &= b - 1, ++at) {
    const int i = __builtin_ctz(b);
    LpeLight r{n.lpe_diffuse[i], n.lpe_other[i], 0, {}};
    for (int c = 0; c < 3; ++c) {
      float sum = 0;
      for (const RecordedLight& light : store.recorded) sum += light.lanes >> i & 1 ? light.L[c][i] : 0.0f;
      float left = u[i] * sum;
      const RecordedLight* chosen = nullptr;
      for (const RecordedLight& light : store.recorded) {
        if (!(light.lanes >> i & 1) || light.L[c][i] == 0) continue;
        chosen = &light;
        if ((left -= light.L[c][i]) < 0) break;
      }
      if (!chosen) continue;
      const float share = (c == 0 ? n.diffuse_share.x : c == 1 ? n.diffuse_share.y : n.diffuse_share.z)[i];
      r.ends |= chosen->end[i] << (10 * c);
      r.share[c] = share_of(share * chosen->diffuse, (1 - share) * chosen->specular);
    }
    store.shadows.put(at, r);
  }
  store.recorded.clear();
}

}  // namespace primray
