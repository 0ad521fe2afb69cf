// The paths that a thread has under way: structures of arrays, kept dense, so that every lane of every step has a path.
#pragma once

#include <memory>

#include "accel/trace.hpp"

namespace primray {

constexpr int kPool = 512;
constexpr int kPadded = kPool + 16;  // whole vectors are stored at any position

// One path between two vertices: its ray, and what it needs to go on.
struct PathPool {
  alignas(64) float ox[kPadded], oy[kPadded], oz[kPadded], dx[kPadded], dy[kPadded], dz[kPadded], tnear[kPadded], tfar[kPadded];
  alignas(64) float beta_r[kPadded], beta_g[kPadded], beta_b[kPadded];
  alignas(64) float bsdf_pdf[kPadded];          // density of the ray's direction; 0: camera or delta
  alignas(64) int32_t slot[kPadded];            // where its radiance is summed
  alignas(64) uint32_t reversed_index[kPadded], seed[kPadded];
  alignas(64) int32_t depth[kPadded];           // scatterings so far
  int count = 0;

  // Hits of the current rays.
  alignas(64) float t[kPadded], ngx[kPadded], ngy[kPadded], ngz[kPadded], u[kPadded], v[kPadded];
  alignas(64) int32_t prim[kPadded], geom[kPadded], inst[kPadded], inst_prim[kPadded];

  template <int W>
  PRIMRAY_INLINE Rays<W> rays(int at) const {
    return {{load<W>(ox + at), load<W>(oy + at), load<W>(oz + at)}, {load<W>(dx + at), load<W>(dy + at), load<W>(dz + at)}, load<W>(tnear + at), load<W>(tfar + at)};
  }
  template <int W>
  PRIMRAY_INLINE Hits<W> hits(int at) const {
    return {load<W>(t + at), {load<W>(ngx + at), load<W>(ngy + at), load<W>(ngz + at)}, load<W>(u + at), load<W>(v + at),
            load<W>(prim + at), load<W>(geom + at), load<W>(inst + at), load<W>(inst_prim + at)};
  }
  template <int W>
  PRIMRAY_INLINE void set_hits(int at, const Hits<W>& h) {
    store(t + at, h.t), store(ngx + at, h.ng.x), store(ngy + at, h.ng.y), store(ngz + at, h.ng.z), store(u + at, h.u), store(v + at, h.v);
    store(prim + at, h.prim), store(geom + at, h.geom), store(inst + at, h.inst), store(inst_prim + at, h.inst_prim);
  }
};

// Shadow rays with what they carry if nothing blocks them.
struct ShadowQueue {
  alignas(64) float ox[kPadded], oy[kPadded], oz[kPadded], dx[kPadded], dy[kPadded], dz[kPadded], tfar[kPadded];
  alignas(64) float r[kPadded], g[kPadded], b[kPadded];
  alignas(64) int32_t slot[kPadded];
  int count = 0;

  template <int W>
  PRIMRAY_INLINE Rays<W> rays(int at) const {
    return {{load<W>(ox + at), load<W>(oy + at), load<W>(oz + at)}, {load<W>(dx + at), load<W>(dy + at), load<W>(dz + at)}, vfloat<W>(0.0f), load<W>(tfar + at)};
  }
};

// Lanes of `m` in order, then others: for permute(); and their number.
template <int W>
struct Compaction {
  vint<W> from;
  int count;
  PRIMRAY_INLINE explicit Compaction(vbool<W> m) : from(0), count(0) {
    alignas(64) int32_t order[W] = {};
    for (uint32_t b = bits(m); b; b &= b - 1) order[count++] = __builtin_ctz(b);
    from = load<W>(order);
  }
  template <class T>
  PRIMRAY_INLINE void append(T* p, Vector<T, W> a) const {
    store(p, permute(a, from));
  }
};

}  // namespace primray
