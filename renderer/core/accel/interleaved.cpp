// See interleaved.hpp. AVX-512: a node's 8 children are 8 lanes, a leaf's 4 pairs have 16 corners.
#include "accel/interleaved.hpp"

#include "scene/error.hpp"

#if PRIMRAY_MAX_LANES >= 16

#include <immintrin.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace primray {
namespace {

using Bvh = TriangleBvh;

constexpr uint32_t kRays = 24;  // by turns: 16 take 1.05 times as long, 32 1.04
// A node leaves 7 more entries on the stack than it takes; compressed vectors are stored whole.
constexpr uint32_t kStack = 7 * (Bvh::kMaxDepth + 1) + 1 + 8;

constexpr float kLeastDirection = 1e-18f;  // so that inverses times coordinates stay finite
// Of a plane's distance: of the part that is the ray's origin, where rounding does not depend on the box, and of the whole.
constexpr float kOriginRounding = 0x1p-22f, kFarRounding = 1 + 0x1p-21f;
// Of the products that an edge's side is the difference of: what rounding may do to it, and a little.
constexpr float kEdgeRounding = 0x1p-22f;

struct alignas(64) RayState {
  __m256i order;                                    // of a node's slots: first what lies farthest along the ray
  float inverse[3], low_offset[3], high_offset[3];  // a plane p along an axis is at p * inverse + offset
  float tnear, tfar;
  uint32_t low_plane[3], high_plane[3];  // of a node's bounds, those where the ray enters and leaves, in bytes
  uint32_t current, depth, index;
  float origin[3], shear[2], scale;  // along axes axis[0], axis[1], and axis[2], along which the ray goes farthest
  uint32_t axis[3];
  float u, v;
  int32_t prim;  // -1: none yet
  alignas(64) uint32_t stack[kStack];
  float entry[kStack];  // where the ray enters what is on the stack
};

inline __m256 all_8(const float& x) { return _mm256_broadcast_ss(&x); }
inline __m128 absolute(__m128 x) { return _mm_andnot_ps(_mm_set1_ps(-0.0f), x); }

class Interleaved {
 public:
  Interleaved(const Bvh& bvh, const RayColumns& rays) : memory_(bvh.memory.get()), root_(bvh.root), rays_(rays) {}

  // Follows `count` rays: the nearest hits, or with kAny whether there are any. `done(state, met)` for each, in any order.
  template <bool kAny, class Done>
  void follow(uint32_t count, const Done& done) {
    uint32_t at_node[kRays + 1], at_leaf[kRays + 1], unused[kRays + 1];
    uint32_t nodes = 0, leaves = 0, spare = 0, next = 0;
    for (uint32_t k = std::min(count, kRays); k-- > 0;) unused[spare++] = k;
    // Where rays go next is told by additions, not by branches.
    uint32_t kept = 0;
    const auto sort_in = [&](uint32_t k, uint32_t (&here)[kRays + 1], uint32_t (&other)[kRays + 1], uint32_t& there,
                             Bvh::Kind own, Bvh::Kind others) {
      const Bvh::Kind kind = Bvh::kind_of(states_[k].current);
      here[kept] = k, other[there] = k, unused[spare] = k;
      kept += kind == own, there += kind == others, spare += kind == Bvh::kEnd;
      if (kind == Bvh::kEnd) done(states_[k], false);
    };
    for (uint32_t busy = 0;;) {
      for (; spare > 0 && next < count; ++busy) begin(states_[at_node[nodes++] = unused[--spare]], next++);
      if (busy == 0) return;
      const uint32_t before = spare;
      kept = 0;
      for (uint32_t i = 0; i < nodes; ++i) {
        step(states_[at_node[i]]);
        sort_in(at_node[i], at_node, at_leaf, leaves, Bvh::kNode, Bvh::kLeaf);
      }
      nodes = kept, kept = 0;
      for (uint32_t i = 0; i < leaves; ++i) {
        RayState& s = states_[at_leaf[i]];
        if (meets_leaf<kAny>(s)) {
          if (kAny) {
            unused[spare++] = at_leaf[i];
            done(s, true);
            continue;
          }
          forget_farther(s);
        }
        go_to(s, s.stack[--s.depth]);
        sort_in(at_leaf[i], at_leaf, at_node, nodes, Bvh::kLeaf, Bvh::kNode);
      }
      leaves = kept, busy -= spare - before;
    }
  }

 private:
  void begin(RayState& s, uint32_t i) const {
    const float o[3] = {rays_.ox[i], rays_.oy[i], rays_.oz[i]}, d[3] = {rays_.dx[i], rays_.dy[i], rays_.dz[i]};
    uint32_t octant = 0;
    for (uint32_t k = 0; k < 3; ++k) {
      s.inverse[k] = 1 / (std::abs(d[k]) < kLeastDirection ? std::copysign(kLeastDirection, d[k]) : d[k]);
      const float start = o[k] * s.inverse[k], around = std::abs(start) * kOriginRounding;
      s.low_offset[k] = -start - around, s.high_offset[k] = -start + around;
      const bool up = s.inverse[k] > 0;
      constexpr uint32_t kAxis = sizeof(Bvh::Node::bounds[0][0]), kSide = sizeof(Bvh::Node::bounds[0]);
      s.low_plane[k] = kAxis * k + (up ? 0 : kSide), s.high_plane[k] = kAxis * k + (up ? kSide : 0);
      octant |= uint32_t(up) << k, s.origin[k] = o[k];
    }
    s.order = _mm256_xor_si256(_mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7), _mm256_set1_epi32(int(octant)));
    const float x = std::abs(d[0]), y = std::abs(d[1]), z = std::abs(d[2]);
    s.axis[2] = x > y ? (x > z ? 0 : 2) : (y > z ? 1 : 2);
    s.axis[0] = (s.axis[2] + 1) % 3, s.axis[1] = (s.axis[2] + 2) % 3;
    s.scale = 1 / d[s.axis[2]], s.shear[0] = d[s.axis[0]] * s.scale, s.shear[1] = d[s.axis[1]] * s.scale;
    s.tnear = rays_.tnear ? rays_.tnear[i] : 0.0f, s.tfar = rays_.tfar[i];
    s.prim = -1, s.u = s.v = 0, s.index = i;
    s.stack[0] = Bvh::kEnd, s.entry[0] = -std::numeric_limits<float>::infinity(), s.depth = 1;
    s.current = root_;
  }

  // What is looked at next round is fetched in this one.
  void go_to(RayState& s, uint32_t id) const {
    s.current = id;
    const char* const at = memory_ + Bvh::offset_of(id);
    for (uint32_t line = 0; line < sizeof(Bvh::Node); line += 64) _mm_prefetch(at + line, _MM_HINT_T0);
  }

  void step(RayState& s) const {
    const char* const node = memory_ + Bvh::offset_of(s.current);
    const auto planes = [&](uint32_t at) { return _mm256_load_ps(reinterpret_cast<const float*>(node + at)); };
    const auto enter = [&](int k) {
      return _mm256_fmadd_ps(planes(s.low_plane[k]), all_8(s.inverse[k]), all_8(s.low_offset[k]));
    };
    const auto leave = [&](int k) {
      return _mm256_fmadd_ps(planes(s.high_plane[k]), all_8(s.inverse[k]), all_8(s.high_offset[k]));
    };
    const __m256 first = _mm256_max_ps(_mm256_max_ps(enter(0), enter(1)), _mm256_max_ps(enter(2), all_8(s.tnear)));
    const __m256 last = _mm256_min_ps(_mm256_min_ps(leave(0), leave(1)), _mm256_min_ps(leave(2), all_8(s.tfar)));
    const __m256 entry = _mm256_permutevar8x32_ps(first, s.order);
    const __m256 exit = _mm256_permutevar8x32_ps(_mm256_mul_ps(last, _mm256_set1_ps(kFarRounding)), s.order);
    const __m256i children = _mm256_load_si256(reinterpret_cast<const __m256i*>(node + offsetof(Bvh::Node, child)));
    const __mmask8 met = _mm256_cmp_ps_mask(entry, exit, _CMP_LE_OQ);
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(s.stack + s.depth),
                        _mm256_maskz_compress_epi32(met, _mm256_permutevar8x32_epi32(children, s.order)));
    _mm256_storeu_ps(s.entry + s.depth, _mm256_maskz_compress_ps(met, entry));
    s.depth += uint32_t(__builtin_popcount(met)) - 1;
    go_to(s, s.stack[s.depth]);
  }

  // Takes what lies beyond the hit off the stack.
  static void forget_farther(RayState& s) {
    uint32_t kept = 0;
    for (uint32_t i = 0; i < s.depth; i += 8) {
      const __m256 entry = _mm256_loadu_ps(s.entry + i);
      const __m256i ids = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(s.stack + i));
      __mmask8 near = _mm256_cmp_ps_mask(entry, all_8(s.tfar), _CMP_LE_OQ);
      if (s.depth - i < 8) near &= __mmask8((1u << (s.depth - i)) - 1);
      _mm256_storeu_ps(s.entry + kept, _mm256_maskz_compress_ps(near, entry));
      _mm256_storeu_si256(reinterpret_cast<__m256i*>(s.stack + kept), _mm256_maskz_compress_epi32(near, ids));
      kept += uint32_t(__builtin_popcount(near));
    }
    s.depth = kept;
  }

  // Corners d, a, b, c in 4 blocks of 4 lanes; outer edges da, ab, bc, cd likewise, and ac between the two triangles.
  template <bool kAny>
  bool meets_leaf(RayState& s) const {
    const Bvh::Leaf& leaf = *reinterpret_cast<const Bvh::Leaf*>(memory_ + Bvh::offset_of(s.current));
    const auto from_origin = [&](int k) {
      return _mm512_sub_ps(_mm512_load_ps(leaf.at[s.axis[k]]), _mm512_set1_ps(s.origin[s.axis[k]]));
    };
    const __m512 z = from_origin(2);
    const __m512 x = _mm512_fnmadd_ps(_mm512_set1_ps(s.shear[0]), z, from_origin(0));
    const __m512 y = _mm512_fnmadd_ps(_mm512_set1_ps(s.shear[1]), z, from_origin(1));
    constexpr int kNextBlock = 0x39;
    const __m512 next_x = _mm512_shuffle_f32x4(x, x, kNextBlock), next_y = _mm512_shuffle_f32x4(y, y, kNextBlock);
    const __m512 taken = _mm512_mul_ps(y, next_x), side = _mm512_fmsub_ps(x, next_y, taken);
    const __m512 room = _mm512_mul_ps(_mm512_abs_ps(taken), _mm512_set1_ps(kEdgeRounding));
    const uint32_t left = _mm512_cmp_ps_mask(_mm512_add_ps(side, room), _mm512_setzero_ps(), _CMP_GE_OQ);
    const uint32_t right = _mm512_cmp_ps_mask(side, room, _CMP_LE_OQ);
    const __m128 ax = _mm512_extractf32x4_ps(x, 1), ay = _mm512_extractf32x4_ps(y, 1);
    const __m128 cx = _mm512_extractf32x4_ps(x, 3), cy = _mm512_extractf32x4_ps(y, 3);
    const __m128 taken_ac = _mm_mul_ps(ay, cx), ac = _mm_fmsub_ps(ax, cy, taken_ac);
    const __m128 room_ac = _mm_mul_ps(absolute(taken_ac), _mm_set1_ps(kEdgeRounding));
    const uint32_t left_ac = _mm_cmp_ps_mask(_mm_add_ps(ac, room_ac), _mm_setzero_ps(), _CMP_GE_OQ);
    const uint32_t right_ac = _mm_cmp_ps_mask(ac, room_ac, _CMP_LE_OQ);
    // (d, a, c) has da, ac, cd; (b, c, a) has bc, ca, ab. Passed on one side by all edges, the ray is inside.
    const uint32_t first = ((left & (left >> 12) & left_ac) | (right & (right >> 12) & right_ac)) & 15;
    const uint32_t second = (((left >> 4) & (left >> 8) & right_ac) | ((right >> 4) & (right >> 8) & left_ac)) & leaf.two;
    if (!(first | second)) return false;
    const __m128 da = _mm512_castps512_ps128(side), ab = _mm512_extractf32x4_ps(side, 1);
    const __m128 bc = _mm512_extractf32x4_ps(side, 2), cd = _mm512_extractf32x4_ps(side, 3);
    const __m128 zd = _mm512_castps512_ps128(z), za = _mm512_extractf32x4_ps(z, 1);
    const __m128 zb = _mm512_extractf32x4_ps(z, 2), zc = _mm512_extractf32x4_ps(z, 3);
    bool nearer = false;
    // Corners p, q, r of triangles weigh by the sides of the edges across. Numbered as the group has them, from r's next corner
    // on: (a, c, d) for (d, a, c), (a, b, c) for (b, c, a); u is of `u_side`, v of `v_side`.
    const auto take = [&](uint32_t inside, __m128 p, __m128 q, __m128 r, __m128 zp, __m128 zq, __m128 zr, __m128 u_side,
                          __m128 v_side, uint32_t later) {
      const __m128 sum = _mm_add_ps(_mm_add_ps(p, q), r);
      const __m128 weighed = _mm_fmadd_ps(p, zp, _mm_fmadd_ps(q, zq, _mm_mul_ps(r, zr)));
      // Of triangles seen from their edge, sides are little but rounding: a hit stays where the triangle is.
      const __m128 least = _mm_min_ps(_mm_min_ps(zp, zq), zr), most = _mm_max_ps(_mm_max_ps(zp, zq), zr);
      const __m128 depth = _mm_min_ps(_mm_max_ps(_mm_div_ps(weighed, sum), least), most);
      const __m128 t = _mm_mul_ps(depth, _mm_set1_ps(s.scale));
      const uint32_t flat = _mm_cmp_ps_mask(sum, _mm_setzero_ps(), _CMP_EQ_UQ);
      const uint32_t between =
          _mm_cmp_ps_mask(t, _mm_set1_ps(s.tnear), _CMP_GT_OQ) & _mm_cmp_ps_mask(t, _mm_set1_ps(s.tfar), _CMP_LT_OQ);
      uint32_t m = inside & between & ~flat;
      if (!m) return;
      nearer = true;
      if (kAny) return;
      alignas(16) float ts[4], us[4], vs[4], sums[4];
      _mm_store_ps(ts, t), _mm_store_ps(us, u_side), _mm_store_ps(vs, v_side), _mm_store_ps(sums, sum);
      for (; m; m &= m - 1) {
        const int i = __builtin_ctz(m);
        if (!(ts[i] < s.tfar)) continue;
        s.tfar = ts[i], s.prim = int32_t(leaf.first[i] + later);
        s.u = std::clamp(us[i] / sums[i], 0.0f, 1.0f), s.v = std::clamp(vs[i] / sums[i], 0.0f, 1.0f);
      }
    };
    if (first) take(first, ac, cd, da, zd, za, zc, da, ac, 0);
    if (second) {
      const __m128 ca = _mm_sub_ps(_mm_setzero_ps(), ac);
      take(second, ca, ab, bc, zb, zc, za, ca, ab, 1);
    }
    return nearer;
  }

  const char* const memory_;
  const uint32_t root_;
  const RayColumns& rays_;
  RayState states_[kRays];
};

}  // namespace

void intersect_interleaved(const TriangleBvh& bvh, uint32_t count, const RayColumns& rays, const HitColumns& hits) {
  Interleaved(bvh, rays).follow<false>(count, [&](const RayState& s, bool) {
    const uint32_t i = s.index;
    hits.t[i] = s.tfar, hits.u[i] = s.u, hits.v[i] = s.v;
    hits.prim[i] = s.prim, hits.geom[i] = s.prim < 0 ? -1 : 0;
  });
}

void occluded_interleaved(const TriangleBvh& bvh, uint32_t count, const RayColumns& rays, int32_t* blocked) {
  Interleaved(bvh, rays).follow<true>(count, [&](const RayState& s, bool met) { blocked[s.index] = met; });
}

}  // namespace primray

#else

namespace primray {

void intersect_interleaved(const TriangleBvh&, uint32_t, const RayColumns&, const HitColumns&) {
  throw Error("bug", "no hierarchy is made without AVX-512");
}
void occluded_interleaved(const TriangleBvh&, uint32_t, const RayColumns&, int32_t*) {
  throw Error("bug", "no hierarchy is made without AVX-512");
}

}  // namespace primray

#endif
