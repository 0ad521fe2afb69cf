// Light table: all lights as rows of floats, and the functions that apply to every type. Each type is a file in light/types/.
#pragma once

#include <algorithm>
#include <vector>

#include "light/dome/dome.hpp"
#include "light/pivot.hpp"
#include "light/shaping/shaping.hpp"
#include "light/tree/light_hierarchy.hpp"
#include "light/tree/light_tree.hpp"
#include "light/tree/linking.hpp"
#include "light/types/light_types.hpp"
#include "light/types/textured_rect.hpp"
#include "lpe/automaton.hpp"
#include "motion/light_motion.hpp"

namespace primray {

// Multipliers of a light for the diffuse and specular response of surfaces (UsdLux inputs:diffuse, inputs:specular).
struct LobeFactors {
  float diffuse = 1, specular = 1;
};

// Further properties of a dome, sampled or not.
struct DomeTraits {
  int link = 0;
  bool hidden = false, special = false;  // see LightFlag
  int32_t end = kEndDome;                // see LightTable::ends
};

struct LightTable {
  std::vector<float> rows;  // rows of the lights that are sampled
  int count = 0;
  int analytic_count = 0;       // lights before geometry lights, which rays hit as shapes of the scene
  std::vector<Dome> domes;      // all domes, sampled or not
  std::vector<int> dome_light;  // by dome: its row, or -1
  std::vector<LobeFactors> dome_factors;
  std::vector<DomeTraits> dome_traits;
  std::vector<LightImage> images;  // of rectangle lights; several may share one
  std::vector<LightTable>
      portals;                  // by dome: rectangles of radiance 1 that guide its samples (light/sampler/portal.hpp); or empty
  LightTree tree;               // for choosing among lights, where there are too many to weigh each
  LightHierarchy hierarchy;     // of the lights that rays can hit, where there are many
  PivotTable pivots;            // lights that are sampled along rays through media
  bool needs_hit_test = false;  // some light has area or a cone that BSDF-sampled rays can hit
  bool camera_sees_area = false;
  Fact<built::kLobeFactors> lobe_factors = false;  // some light's diffuse or specular factor is not 1
  // Light linking; all empty where nothing is linked. By row: the collection that the light illuminates.
  LinkTable links;
  std::vector<int32_t> light_link;
  LinkedLights linked;
  std::vector<int32_t> ends;       // by row: the kind of end for light path expressions (lpe/); may be shorter: the rest are
                                   // objects
  std::vector<float> shadow_rows;  // kShadowFields per row, where some light is special; otherwise empty
  ShapingTable shaping;
  Fact<built::kShaping> has_shaping = false;  // some light's emission depends on its direction (UsdLux ShapingAPI)
  LightMotion motion;
  // Maximum number of lights that are weighed at every vertex; beyond, the tree, which takes the surface's orientation into
  // account, is worth its cost. Portals are few as a rule, and weighed such that none is chosen where none is visible.
  static constexpr int kWeighed = 3, kWeighedPortals = 16;
  int weighed = kWeighed;

  bool any_moves() const {
    return motion.any() || std::any_of(portals.begin(), portals.end(), [](const LightTable& t) { return t.motion.any(); });
  }
  bool has_portals() const { return built::kPortals && !portals.empty(); }
  bool has_special() const { return built::kSpecialShadows && !shadow_rows.empty(); }
  bool has_images() const { return built::kLightImages && !images.empty(); }
  bool by_tree() const { return count > weighed; }
  int32_t end_of(int light) const { return size_t(light) < ends.size() ? ends[size_t(light)] : int32_t(kEndObject); }
  const float* row(int light) const { return rows.data() + light * kLightFields; }
};

// Shaping factor of the lights `row` in lanes `m`, for emission towards the origin of rays along wi; `now`: see
// shaping_factor().
template <int W>
PRIMRAY_INLINE vvec3<W> light_shaping(const LightTable& table, const LightRow<W>& row, vbool<W> m, const vvec3<W>& wi,
                                      const ShapedLanes<W>* now = nullptr) {
  const vint<W> number = select(m, row.integer(kShaping), vint<W>(0));
  const vbool<W> shaped = number != vint<W>(0);
  const vvec3<W> one(vfloat<W>(1.0f));
  if (!any(shaped)) return one;
  const vint<W> valid = select(shaped, number, vint<W>(number[__builtin_ctz(bits(shaped))]));
  return select(shaped, shaping_factor(table.shaping, valid, -wi, now), one);
}

// Shaping factor of one light that rays along wi hit.
template <int W>
PRIMRAY_INLINE vvec3<W> hit_shaping(const LightTable& table, const float* row, const vvec3<W>& wi) {
  const int number = int_at(row, kShaping);
  return number == 0 ? vvec3<W>(vfloat<W>(1.0f)) : shaping_factor(table.shaping, vint<W>(number), -wi);
}

// Redirects samples of rectangle lights with images to their bright parts. Other lights keep their samples.
template <int W>
PRIMRAY_INLINE void sample_images(const LightTable& table, const LightRow<W>& row, vbool<W> rects, const vvec3<W>& local,
                                  vfloat<W> u, vfloat<W> v, LocalSample<W>& s, vvec3<W>& L) {
  const vint<W> image = row.integer(kImage);
  const vfloat<W> size0 = row(kSize0), size1 = row(kSize1);
  for (vbool<W> left = rects & (image > vint<W>(0)); any(left);) {
    const int k = image[__builtin_ctz(bits(left))];
    const vbool<W> same = left & (image == vint<W>(k));
    left &= !same;
    vvec3<W> value;
    const LocalSample<W> n = textured_rect_sample(table.images[k - 1], local, size0, size1, u, v, value);
    s = {select(same, n.w, s.w), select(same, n.t, s.t), select(same, n.pdf, s.pdf)};
    L = select(same, L * value, L);
  }
}

// Samples the domes of lanes `domes`, each by its own image, in the frames of their rows; `number`: of the dome.
template <int W>
PRIMRAY_INLINE void sample_domes(const LightTable& table, vbool<W> domes, vint<W> number, vfloat<W> u, vfloat<W> v,
                                 LightSample<W>& r) {
  for (int k = 0; k < int(table.domes.size()); ++k) {
    const vbool<W> m = domes & (number == vint<W>(k));
    if (!table.domes[k].sampled || !any(m)) continue;
    const vvec3<W> w = dome_sample(table.domes[k], u, v);
    vfloat<W> pdf;
    const vvec3<W> L = dome_eval(table.domes[k], w, pdf);
    r.wi = select(m, w, r.wi), r.pdf = select(m, pdf, r.pdf), r.L = select(m, L, r.L);
  }
}

// Returns world directions in the orientation that dome number `k` had when its image was set up, if it moves.
template <int W>
PRIMRAY_INLINE vvec3<W> dome_direction(const LightTable& table, size_t k, const vvec3<W>& wi, vfloat<W> time) {
  const int32_t path = table.motion.any() ? table.motion.dome(k) : -1;
  return path < 0 ? wi : poses_of(table.motion.paths[size_t(path)], time).vector_to_row(wi);
}

// Transforms samples from the light's frame to world space, in lanes `active`.
template <int W>
PRIMRAY_INLINE void to_world(const LightRow<W>& row, vbool<W> active, const LocalSample<W>& s, LightSample<W>& r) {
  r.wi = row.to_world(s.w), r.t = s.t, r.pdf = s.pdf;
  const vbool<W> sheared = (row.flags() & vint<W>(kSheared)) != vint<W>(0);
  if (!any(sheared & active)) return;
  const vfloat<W> len = length(r.wi);
  r.wi = select(sheared, r.wi * (1.0f / len), r.wi);
  r.t = select(sheared, r.t * len, r.t);
  r.pdf = select(sheared, r.pdf * row(kInverseDet) * len * len * len, r.pdf);
}

// Samples a direction from point p towards `light`, as its row has it. The pdf excludes the choice of the light.
template <int W>
PRIMRAY_INLINE LightSample<W> row_sample(const LightTable& table, vint<W> light, vbool<W> active, const vvec3<W>& p,
                                         vfloat<W> u, vfloat<W> v) {
  const LightRow<W> row(table, light);
  const vint<W> type = select(active, row.type(), vint<W>(-1));
  const vvec3<W> local = row.to_light(p - row.vector(kOrigin));
  LocalSample<W> s{vvec3<W>(vfloat<W>(0.0f)), vfloat<W>(kInfinity), vfloat<W>(0.0f)};
  LightSample<W> r;
  r.light = light, r.L = row.vector(kRadiance), r.is_delta = vbool<W>(false);
  for_light_types([&]<class T>(T) {
    if constexpr (requires { T::sample(row, p, local, u, v); }) {
      const vbool<W> m = is_type(type, T::kType);
      if (!any(m)) return;
      const LocalSample<W> n = T::sample(row, p, local, u, v);
      s = {select(m, n.w, s.w), select(m, n.t, s.t), select(m, n.pdf, s.pdf)};
      if constexpr (requires { T::is_delta(row); }) r.is_delta |= m & T::is_delta(row);
    }
  });
  if (table.has_images()) sample_images(table, row, is_type(type, LightType::kRect), local, u, v, s, r.L);
  to_world(row, active, s, r);
  for_light_types([&]<class T>(T) {
    if constexpr (requires { T::sample_world(row, vbool<W>(true), p, u, r); }) {
      const vbool<W> m = is_type(type, T::kType);
      if (any(m)) T::sample_world(row, m, p, u, r);
    }
  });
  if (const vbool<W> dome = is_type(type, LightType::kDome); any(dome))
    sample_domes(table, dome, row.integer(kDomeIndex), u, v, r);
  if (table.has_shaping) r.L *= light_shaping(table, row, active & (r.pdf > vfloat<W>(0.0f)), r.wi);
  return r;
}

// Samples lights that may move, at `time`.
template <int W>
PRIMRAY_INLINE LightSample<W> light_sample(const LightTable& table, vint<W> light, vbool<W> active, const vvec3<W>& p,
                                           vfloat<W> u, vfloat<W> v, vfloat<W> time) {
  if (!table.motion.any()) return row_sample(table, light, active, p, u, v);
  const LightPoses<W> poses = poses_of(table.motion, active, light, time);
  LightSample<W> s = row_sample(table, light, active, poses.point_to_row(p), u, v);
  s.wi = poses.vector_to_world(s.wi);
  return s;
}

// Intersects the ray p + t wi (unit wi) with a light's row; the pdf excludes the choice of the light.
template <int W>
PRIMRAY_INLINE LocalHit<W> light_hit(const float* light, const vvec3<W>& p, const vvec3<W>& wi) {
  const LightRow<W> row(light);
  vvec3<W> w = row.to_light(wi);
  vfloat<W> len(1.0f);
  const bool sheared = int_at(light, kLightFlags) & kSheared;
  if (sheared) {
    len = length(w);
    w = w * (1.0f / len);
  }
  const vvec3<W> local = row.to_light(p - row.vector(kOrigin));
  LocalHit<W> h{vfloat<W>(kInfinity), vfloat<W>(0.0f)};
  with_light_type(light, [&]<class T>(T) {
    if constexpr (HittableLightType<T>) h = T::hit(row, p, local, w);
  });
  if (sheared) {
    h.t = h.t * (1.0f / len);
    h.pdf = h.pdf * light[kInverseDet] / (len * len * len);
  }
  return h;
}

// Intersects the ray with light number `i`, and multiplies its radiance L by its image at the hit.
template <int W>
PRIMRAY_INLINE LocalHit<W> light_hit(const LightTable& table, int i, const vvec3<W>& p, const vvec3<W>& wi, vvec3<W>& L) {
  const float* row = table.row(i);
  LocalHit<W> h = light_hit<W>(row, p, wi);
  const int image = table.has_images() ? int_at(row, kImage) : 0;
  if (image == 0 || !any(h.pdf > vfloat<W>(0.0f))) return h;
  const LightRow<W> light(table, vint<W>(i));
  const vvec3<W> local = light.to_light(p - light.vector(kOrigin));
  vvec3<W> w = light.to_light(wi);
  const vfloat<W> len = length(w);
  const bool sheared = int_at(row, kLightFlags) & kSheared;
  const vfloat<W> stretch = sheared ? row[kInverseDet] / (len * len * len) : vfloat<W>(1.0f);
  if (sheared) w = w * (1.0f / len);
  const vfloat<W> distance = sheared ? h.t * len : h.t;
  vvec3<W> value;
  const vfloat<W> pdf = textured_rect_hit(table.images[image - 1], local, w, vfloat<W>(row[kSize0]), vfloat<W>(row[kSize1]),
                                          distance, h.pdf / stretch, value);
  L *= value;
  h.pdf = select(h.pdf > vfloat<W>(0.0f), pdf * stretch, h.pdf);
  return h;
}

}  // namespace primray
