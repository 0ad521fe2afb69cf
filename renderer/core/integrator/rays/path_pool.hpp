// Pool of a thread's paths in flight: structure of arrays, kept dense, so that every lane has a path in every step.
#pragma once

#include <cstring>
#include <type_traits>

#include "base/integrator_settings.hpp"
#include "bvh/interleaved.hpp"
#include "light/tree/linking.hpp"
#include "math/lane_checks.hpp"
#include "ray/ray.hpp"

namespace primray {

constexpr int kPool = 512;
constexpr int kPadded = kPool + 16;  // room to store whole vectors at any position

// Indices of the set bits of every mask of 8 lanes, in order, one byte each.
struct CompactionTable {
  uint64_t order[256];
  constexpr CompactionTable() : order{} {
    for (int m = 0; m < 256; ++m) {
      int n = 0;
      for (int i = 0; i < 8; ++i)
        if (m >> i & 1) order[m] |= uint64_t(i) << (8 * n++);
    }
  }
};
inline constexpr CompactionTable kCompaction;

// Permutation that moves the lanes of `m` to the front, in order, and their number.
template <int W>
struct Compaction {
  vint<W> from;
  int count;
  PRIMRAY_INLINE explicit Compaction(vbool<W> m) : from(0), count(__builtin_popcount(bits(m))) {
    const uint32_t b = bits(m);
#if defined(__AVX512F__)
    if constexpr (W == 16) {
      from = vint<16>((vint<16>::Raw)_mm512_maskz_compress_epi32(__mmask16(b), (__m512i)lane_numbers<16>().v));
      return;
    }
#endif
#if defined(__AVX2__)
    if constexpr (W == 8) {
      from = vint<8>((vint<8>::Raw)_mm256_cvtepu8_epi32(_mm_cvtsi64_si128(int64_t(kCompaction.order[b]))));
      return;
    }
#endif
    alignas(64) int32_t order[W] = {};
    int n = 0;
    for (uint32_t rest = b; rest; rest &= rest - 1) order[n++] = __builtin_ctz(rest);
    from = load<W>(order);
  }
  template <class T>
  PRIMRAY_INLINE void append(T* p, Vector<T, W> a) const {
    store(p, permute(a, from));
  }
};

// Puts the first `count` values of a column in another order: at i, what was at order[i]. Padding of `order` holds indices too.
template <class T>
__attribute__((noinline)) void reorder_column(T (&column)[kPadded], const int32_t* order, int count) {
#if defined(__AVX512F__)
  constexpr int W = 16;
#else
  constexpr int W = 8;
#endif
  using Number = std::conditional_t<std::is_same_v<T, float>, float, int32_t>;
  static_assert(sizeof(T) == sizeof(Number));
  const auto from = reinterpret_cast<const Number*>(column);
  alignas(64) Number after[kPadded];
  for (int i = 0; i < count; i += W) store(after + i, gather<W>(from, load<W>(order + i)));
  std::memcpy(column, after, sizeof(T) * size_t(count));
}

// Path state between two vertices: the ray, and what the next vertex needs.
struct PathPool {
  alignas(64) float ox[kPadded], oy[kPadded], oz[kPadded], dx[kPadded], dy[kPadded], dz[kPadded], tnear[kPadded], tfar[kPadded];
  alignas(64) float beta_r[kPadded], beta_g[kPadded], beta_b[kPadded];
  alignas(64) float bsdf_pdf[kPadded];  // solid-angle density of the ray's direction; 0: camera ray or delta lobe
  alignas(64) int32_t slot[kPadded];    // sample whose radiance this is
  alignas(64) uint32_t reversed_index[kPadded], seed[kPadded];
  alignas(64) int32_t depth[kPadded];   // scattering events so far; passing straight through a surface is none
  alignas(64) int32_t vertex[kPadded];  // surfaces hit so far, which selects the next sample dimensions
  alignas(64) float splits[kPadded];    // number of parts that this path's sample was split into
  // Present if a surface lets light pass straight through: distance from the ray's origin back to the vertex that `bsdf_pdf`
  // belongs to.
  alignas(64) float travelled[kPadded];
  // Present if surfaces have varying inputs: ray cone, its width at the origin and its growth per unit of distance.
  alignas(64) float cone_width[kPadded], cone_spread[kPadded];
  // Present if lights have lobe factors, and for light path expressions: diffuse share of f_cos at the last scattering event.
  alignas(64) float diffuse_share_r[kPadded], diffuse_share_g[kPadded], diffuse_share_b[kPadded];
  // Present if the shutter interval is not empty.
  alignas(64) float time[kPadded];
  // Present if lights, or triangles of mesh lights, are chosen by a tree: shading normal at the last scattering event, on the
  // lit side.
  alignas(64) float nx[kPadded], ny[kPadded], nz[kPadded];
  // Present with a guide: radiance received at the first surface in the guide; see expected_light().
  alignas(64) float first_received[kPadded];
  // Present if lights are linked: link row of the surface that scattered last, or kUnlinkedRow.
  alignas(64) int32_t link[kPadded];
  // Present for light path expressions: automaton states of the path's channels if it left the last vertex by a diffuse lobe
  // (probability diffuse_share), and otherwise.
  alignas(64) int32_t lpe_diffuse[kPadded], lpe_other[kPadded];
  int count = 0;

  // Hits of the current rays.
  alignas(64) float t[kPadded], ngx[kPadded], ngy[kPadded], ngz[kPadded], u[kPadded], v[kPadded];
  alignas(64) int32_t prim[kPadded], geom[kPadded], inst[kPadded], inst_prim[kPadded];

  template <int W>
  PRIMRAY_INLINE Rays<W> rays(int at) const {
    return {{load<W>(ox + at), load<W>(oy + at), load<W>(oz + at)},
            {load<W>(dx + at), load<W>(dy + at), load<W>(dz + at)},
            load<W>(tnear + at),
            load<W>(tfar + at)};
  }
  RayColumns ray_columns() const { return {ox, oy, oz, dx, dy, dz, tnear, tfar}; }
  HitColumns hit_columns() { return {t, u, v, prim, geom}; }
  template <int W>
  PRIMRAY_INLINE PathLanes<W> paths(int at, PathNeeds needs) const {
    PathLanes<W> p;
    p.ray = rays<W>(at);
    p.beta = {load<W>(beta_r + at), load<W>(beta_g + at), load<W>(beta_b + at)};
    p.bsdf_pdf = load<W>(bsdf_pdf + at), p.splits = load<W>(splits + at);
    p.travelled = needs.travelled ? load<W>(travelled + at) : vfloat<W>(0.0f);
    p.cone_width = p.cone_spread = vfloat<W>(0.0f);
    if (needs.cones) p.cone_width = load<W>(cone_width + at), p.cone_spread = load<W>(cone_spread + at);
    p.diffuse_share = vvec3<W>(vfloat<W>(0.0f));
    if (needs.diffuse_shares)
      p.diffuse_share = {load<W>(diffuse_share_r + at), load<W>(diffuse_share_g + at), load<W>(diffuse_share_b + at)};
    if (needs.time) p.ray.time = load<W>(time + at);
    p.normal = vvec3<W>(vfloat<W>(0.0f));
    if (needs.normals) p.normal = {load<W>(nx + at), load<W>(ny + at), load<W>(nz + at)};
    p.first_received = needs.first_received ? load<W>(first_received + at) : vfloat<W>(0.0f);
    p.link = needs.links ? load<W>(link + at) : vint<W>(kUnlinkedRow);
    p.lpe_diffuse = p.lpe_other = vint<W>(0);
    if (needs.lpe) p.lpe_diffuse = load<W>(lpe_diffuse + at), p.lpe_other = load<W>(lpe_other + at);
    p.slot = load<W>(slot + at), p.depth = load<W>(depth + at), p.vertex = load<W>(vertex + at);
    p.sampler = {load<W>(reversed_index + at), load<W>(seed + at)};
    return p;
  }
  // Appends the lanes that `c` selects.
  template <int W>
  PRIMRAY_INLINE void append(const Compaction<W>& c, const PathLanes<W>& p, PathNeeds needs) {
    PRIMRAY_ASSERT(count + c.count <= kPool);
    PRIMRAY_ASSERT(are_unit(lane_numbers<W>() < vint<W>(c.count), permute(p.ray.d, c.from)));
    PRIMRAY_ASSERT(are_finite(lane_numbers<W>() < vint<W>(c.count), permute(p.ray.o, c.from)));
    PRIMRAY_ASSERT(are_weights(lane_numbers<W>() < vint<W>(c.count), permute(p.beta, c.from)));
    PRIMRAY_ASSERT(are_weights(lane_numbers<W>() < vint<W>(c.count), permute(p.bsdf_pdf, c.from)));
    const int at = count;
    c.append(ox + at, p.ray.o.x), c.append(oy + at, p.ray.o.y), c.append(oz + at, p.ray.o.z);
    c.append(dx + at, p.ray.d.x), c.append(dy + at, p.ray.d.y), c.append(dz + at, p.ray.d.z);
    c.append(tnear + at, p.ray.tnear), c.append(tfar + at, p.ray.tfar);
    c.append(beta_r + at, p.beta.x), c.append(beta_g + at, p.beta.y), c.append(beta_b + at, p.beta.z);
    c.append(bsdf_pdf + at, p.bsdf_pdf), c.append(splits + at, p.splits);
    if (needs.travelled) c.append(travelled + at, p.travelled);
    if (needs.cones) c.append(cone_width + at, p.cone_width), c.append(cone_spread + at, p.cone_spread);
    if (needs.diffuse_shares)
      c.append(diffuse_share_r + at, p.diffuse_share.x), c.append(diffuse_share_g + at, p.diffuse_share.y),
          c.append(diffuse_share_b + at, p.diffuse_share.z);
    if (needs.time) c.append(time + at, p.ray.time);
    if (needs.links) c.append(link + at, p.link);
    if (needs.normals) c.append(nx + at, p.normal.x), c.append(ny + at, p.normal.y), c.append(nz + at, p.normal.z);
    if (needs.first_received) c.append(first_received + at, p.first_received);
    if (needs.lpe) c.append(lpe_diffuse + at, p.lpe_diffuse), c.append(lpe_other + at, p.lpe_other);
    c.append(slot + at, p.slot), c.append(depth + at, p.depth), c.append(vertex + at, p.vertex);
    c.append(reversed_index + at, p.sampler.reversed_index), c.append(seed + at, p.sampler.seed);
    count += c.count;
  }
  // Puts the paths and their hits in another order: at i, what was at order[i]. `plain`: all hits are on triangles of the
  // world.
  void reorder(const int32_t* order, PathNeeds needs, bool plain) {
    const auto move = [&](auto&... columns) { (reorder_column(columns, order, count), ...); };
    move(ox, oy, oz, dx, dy, dz, tnear, tfar, beta_r, beta_g, beta_b, bsdf_pdf, slot, reversed_index, seed, depth, vertex,
         splits);
    if (needs.travelled) move(travelled);
    if (needs.cones) move(cone_width, cone_spread);
    if (needs.diffuse_shares) move(diffuse_share_r, diffuse_share_g, diffuse_share_b);
    if (needs.time) move(time);
    if (needs.normals) move(nx, ny, nz);
    if (needs.first_received) move(first_received);
    if (needs.links) move(link);
    if (needs.lpe) move(lpe_diffuse, lpe_other);
    move(t, u, v, prim, geom);
    if (!plain) move(ngx, ngy, ngz, inst, inst_prim);
  }
  template <int W>
  PRIMRAY_INLINE Hits<W> hits(int at) const {
    return {load<W>(t + at),    {load<W>(ngx + at), load<W>(ngy + at), load<W>(ngz + at)},
            load<W>(u + at),    load<W>(v + at),
            load<W>(prim + at), load<W>(geom + at),
            load<W>(inst + at), load<W>(inst_prim + at)};
  }
  template <int W>
  PRIMRAY_INLINE void set_hits(int at, const Hits<W>& h) {
    store(t + at, h.t), store(ngx + at, h.ng.x), store(ngy + at, h.ng.y), store(ngz + at, h.ng.z), store(u + at, h.u),
        store(v + at, h.v);
    store(prim + at, h.prim), store(geom + at, h.geom), store(inst + at, h.inst), store(inst_prim + at, h.inst_prim);
  }
};

// Stores at `at` the hits of the lanes that `c` selects.
template <int W>
PRIMRAY_INLINE void put_hits(PathPool& pool, int at, const Compaction<W>& c, const Hits<W>& h) {
  c.append(pool.t + at, h.t), c.append(pool.ngx + at, h.ng.x), c.append(pool.ngy + at, h.ng.y), c.append(pool.ngz + at, h.ng.z);
  c.append(pool.u + at, h.u), c.append(pool.v + at, h.v), c.append(pool.prim + at, h.prim), c.append(pool.geom + at, h.geom);
  c.append(pool.inst + at, h.inst), c.append(pool.inst_prim + at, h.inst_prim);
}

// Queue of shadow rays with the radiance that each carries if it is not blocked. A vertex sends up to kMostLightSamples towards
// lights, and one towards the domes in place of its last scattered ray; the parts of a split path share the pool's room.
struct ShadowQueue {
  static constexpr int kSize = (kMostLightSamples + 1) * kPool + 16;
  alignas(64) float ox[kSize], oy[kSize], oz[kSize], dx[kSize], dy[kSize], dz[kSize], tfar[kSize];
  alignas(64) float r[kSize], g[kSize], b[kSize];
  alignas(64) int32_t slot[kSize];
  alignas(64) float time[kSize];       // present if the shutter interval is not empty
  alignas(64) uint32_t number[kSize];  // seeds of random numbers; present if there are volumes
  int count = 0;

  template <int W>
  PRIMRAY_INLINE Rays<W> rays(int at) const {
    return {{load<W>(ox + at), load<W>(oy + at), load<W>(oz + at)},
            {load<W>(dx + at), load<W>(dy + at), load<W>(dz + at)},
            vfloat<W>(0.0f),
            load<W>(tfar + at)};
  }
  RayColumns ray_columns() const { return {ox, oy, oz, dx, dy, dz, nullptr, tfar}; }
  template <int W>
  PRIMRAY_INLINE void append(vbool<W> m, const vvec3<W>& o, const vvec3<W>& d, vfloat<W> end, const vvec3<W>& carried,
                             vint<W> to_slot, vfloat<W> at_time, PathNeeds needs) {
    const Compaction<W> c(m);
    PRIMRAY_ASSERT(count + c.count + W <= kSize);
    PRIMRAY_ASSERT(are_unit(m, d) && are_finite(m, o));
    const int at = count;
    c.append(ox + at, o.x), c.append(oy + at, o.y), c.append(oz + at, o.z);
    c.append(dx + at, d.x), c.append(dy + at, d.y), c.append(dz + at, d.z), c.append(tfar + at, end);
    c.append(r + at, carried.x), c.append(g + at, carried.y), c.append(b + at, carried.z), c.append(slot + at, to_slot);
    if (needs.time) c.append(time + at, at_time);
    count += c.count;
  }
};

// Queue of shadow rays towards special lights, with the light of each.
struct SpecialShadowQueue {
  ShadowQueue rays;
  alignas(64) int32_t light[ShadowQueue::kSize];

  template <int W>
  PRIMRAY_INLINE void append(vbool<W> m, const vvec3<W>& o, const vvec3<W>& d, vfloat<W> end, const vvec3<W>& carried,
                             vint<W> to_slot, vint<W> to_light, vfloat<W> at_time, PathNeeds needs) {
    Compaction<W>(m).append(light + rays.count, to_light);
    rays.append(m, o, d, end, carried, to_slot, at_time, needs);
  }
};

}  // namespace primray
