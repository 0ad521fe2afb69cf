// Traversal of interleaved.hpp with AVX-512: a node's 8 children are 8 lanes, a leaf's 4 pairs have 16 corners.
#include "bvh/interleaved.hpp"

#include "base/error.hpp"

#if PRIMRAY_MAX_LANES >= 16

#include <immintrin.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace primray {
namespace {

using Bvh = TriangleBvh;

constexpr uint32_t kRays = 24;  // in turns; 16 to 32 take as long within 3 %
// A node leaves 7 more entries on the stack than it takes; compressed vectors are stored whole.
constexpr uint32_t kStack = 7 * (Bvh::kMaxDepth + 1) + 1 + 8;

constexpr float kLeastDirection = 1e-18f;  // so that inverses times coordinates stay finite
// Rounding of a plane's distance: of the part from the ray's origin, where it does not depend on the box, and of the whole.
constexpr float kOriginRounding = 0x1p-22f, kFarRounding = 1 + 0x1p-21f;

// By octant and axis, the order of a node's planes: first the 8 through which a ray of that octant enters, then those through
// which it leaves, of the children in an order that begins with the farthest along it.
struct PlaneOrder {
  alignas(64) int32_t from[8][3][16];
  constexpr PlaneOrder() : from{} {
    for (int octant = 0; octant < 8; ++octant)
      for (int axis = 0; axis < 3; ++axis)
        for (int i = 0; i < 16; ++i) {
          const bool up = octant >> axis & 1, upper = (i >= 8) == up;
          from[octant][axis][i] = ((i ^ octant) & 7) + (upper ? 8 : 0);
        }
  }
};
constexpr PlaneOrder kPlaneOrder;

struct alignas(64) RayState {
  // Transform of a node's planes p after PlaneOrder: p * scale + offset is -t where the ray enters, t where it leaves; likewise
  // for the ray's own ends.
  float scale[3][16], offset[3][16], ends[16];
  const int32_t (*order)[16];
  uint32_t current, depth, index;
  float tnear, tfar;
  float origin[3], shear[2], per_z;  // along axes axis[0], axis[1], and axis[2], along which the ray is longest
  uint32_t axis[3];
  float u, v, sum;  // of the hit: barycentrics times their sum
  int32_t prim;     // -1: none yet
  alignas(64) uint32_t stack[kStack];
  float entry[kStack];  // -t at which the ray enters the entries of the stack
};

inline __m512 all_16(const float& x) { return _mm512_set1_ps(x); }
inline __m256 upper_half(__m512 x) { return _mm512_extractf32x8_ps(x, 1); }
inline __m256 halves_swapped(__m256 x) { return _mm256_permute2f128_ps(x, x, 1); }

class Interleaved {
 public:
  Interleaved(const Bvh& bvh, const RayColumns& rays) : memory_(bvh.memory.get()), root_(bvh.root), rays_(rays) {}

  // Traces `count` rays: their nearest hits, or with kAny whether there are any. Calls `done(state)` for each, in any order.
  template <bool kAny, class Done>
  void follow(uint32_t count, const Done& done) {
    // Indices of the rays at a node, at a leaf, and at their end; the counts are kept in the bytes of one number. A ray's next
    // list is found by additions, not by branches.
    uint32_t list[3][32];  // not bytes, which for the compiler may alias anything: 1.5 to 2 times as slow
    uint64_t counts = 0;
    const auto many = [&](Bvh::Kind kind) { return uint32_t(counts >> (8 * kind) & 255); };
    const auto put = [&](uint32_t k) {
      const uint32_t kind = Bvh::kind_of(states_[k].current);
      list[kind][counts >> (8 * kind) & 255] = k;
      counts += uint64_t(1) << (8 * kind);
    };
    const auto take_all = [&](Bvh::Kind kind) { counts &= ~(uint64_t(255) << (8 * kind)); };
    // Entries put back into a list that is being read do not overlap those still to be read.
    const auto each = [&](Bvh::Kind kind, const auto& turn) {
      const uint32_t n = many(kind);
      take_all(kind);
      for (uint32_t i = 0; i < n; ++i) turn(list[kind][i]);
    };
    uint32_t next = 0;
    for (; next < std::min(count, kRays); ++next) begin(states_[next], next), put(next);
    while (counts != 0) {
      each(Bvh::kNode, [&](uint32_t k) { step<kAny>(states_[k]), put(k); });
      each(Bvh::kLeaf, [&](uint32_t k) { meet_leaf<kAny>(states_[k]), put(k); });
      each(Bvh::kEnd, [&](uint32_t k) {
        done(states_[k]);
        if (next < count) begin(states_[k], next++), put(k);
      });
    }
  }

 private:
  void begin(RayState& s, uint32_t i) const {
    const __m128 o = _mm_setr_ps(rays_.ox[i], rays_.oy[i], rays_.oz[i], 0),
                 d = _mm_setr_ps(rays_.dx[i], rays_.dy[i], rays_.dz[i], 0);
    const __m128 sign = _mm_set1_ps(-0.0f), least = _mm_set1_ps(kLeastDirection);
    const __m128 inverse =
        _mm_div_ps(_mm_set1_ps(1), _mm_or_ps(_mm_and_ps(sign, d), _mm_max_ps(_mm_andnot_ps(sign, d), least)));
    const __m128 start = _mm_mul_ps(o, inverse), around = _mm_mul_ps(_mm_andnot_ps(sign, start), _mm_set1_ps(kOriginRounding));
    // Expands 16 numbers to vectors in which each half repeats one.
    const __m256 scales = _mm256_set_m128(inverse, _mm_xor_ps(sign, inverse));
    const __m256 offsets = _mm256_set_m128(_mm_sub_ps(around, start), _mm_add_ps(around, start));
    const __m512i halves = _mm512_setr_epi32(0, 0, 0, 0, 0, 0, 0, 0, 4, 4, 4, 4, 4, 4, 4, 4);
    for (int k = 0; k < 3; ++k) {
      const __m512i from = _mm512_add_epi32(halves, _mm512_set1_epi32(k));
      _mm512_store_ps(s.scale[k], _mm512_permutexvar_ps(from, _mm512_castps256_ps512(scales)));
      _mm512_store_ps(s.offset[k], _mm512_permutexvar_ps(from, _mm512_castps256_ps512(offsets)));
    }
    s.order = kPlaneOrder.from[~_mm_movemask_ps(inverse) & 7];
    s.tnear = rays_.tnear ? rays_.tnear[i] : 0.0f;
    _mm256_store_ps(s.ends, _mm256_set1_ps(-s.tnear));
    set_far(s, rays_.tfar[i]);
    const float x = std::abs(rays_.dx[i]), y = std::abs(rays_.dy[i]), z = std::abs(rays_.dz[i]);
    const uint32_t main = x > y ? (x > z ? 0 : 2) : (y > z ? 1 : 2);
    s.axis[2] = main, s.axis[0] = main == 2 ? 0 : main + 1, s.axis[1] = main == 0 ? 2 : main - 1;
    alignas(16) float from[4], way[4];
    _mm_store_ps(from, o), _mm_store_ps(way, d);
    for (int k = 0; k < 3; ++k) s.origin[k] = from[s.axis[k]];
    s.per_z = 1 / way[main], s.shear[0] = way[s.axis[0]] * s.per_z, s.shear[1] = way[s.axis[1]] * s.per_z;
    s.prim = -1, s.u = s.v = 0, s.sum = 1, s.index = i;
    s.stack[0] = Bvh::kEnd, s.entry[0] = std::numeric_limits<float>::infinity(), s.depth = 1;
    s.current = root_;
  }
  static void set_far(RayState& s, float t) {
    s.tfar = t;
    _mm256_store_ps(s.ends + 8, _mm256_set1_ps(t));
  }

  // Prefetches data for the next round.
  void go_to(RayState& s, uint32_t id) const {
    s.current = id;
    const char* const at = memory_ + Bvh::offset_of(id);
    for (uint32_t line = 0; line < sizeof(Bvh::Node); line += 64) _mm_prefetch(at + line, _MM_HINT_T0);
  }

  template <bool kAny>
  void step(RayState& s) const {
    const Bvh::Node& node = *reinterpret_cast<const Bvh::Node*>(memory_ + Bvh::offset_of(s.current));
    const auto order = [&](int k) { return _mm512_load_si512(s.order[k]); };
    const auto distances = [&](int k) {
      return _mm512_fmadd_ps(_mm512_permutexvar_ps(order(k), _mm512_load_ps(node.bounds[k])), _mm512_load_ps(s.scale[k]),
                             _mm512_load_ps(s.offset[k]));
    };
    const __m512 ends =
        _mm512_min_ps(_mm512_min_ps(distances(0), distances(1)), _mm512_min_ps(distances(2), _mm512_load_ps(s.ends)));
    const __m256 entry = _mm512_castps512_ps256(ends);
    const __m256 inside = _mm256_fmadd_ps(upper_half(ends), _mm256_set1_ps(kFarRounding), entry);
    const __mmask8 hit = _mm256_cmp_ps_mask(inside, _mm256_setzero_ps(), _CMP_GE_OQ);
    const __m256i children = _mm256_permutevar8x32_epi32(_mm256_load_si256(reinterpret_cast<const __m256i*>(node.child)),
                                                         _mm512_castsi512_si256(order(0)));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(s.stack + s.depth), _mm256_maskz_compress_epi32(hit, children));
    if (!kAny) _mm256_storeu_ps(s.entry + s.depth, _mm256_maskz_compress_ps(hit, entry));
    s.depth += uint32_t(__builtin_popcount(hit)) - 1;
    go_to(s, s.stack[s.depth]);
  }

  // Pops entries of the stack that are beyond the hit.
  static void forget_farther(RayState& s) {
    const __m256 far = _mm256_set1_ps(-s.tfar);
    uint32_t kept = 0;
    for (uint32_t i = 0; i < s.depth; i += 8) {
      const __m256 entry = _mm256_loadu_ps(s.entry + i);
      const __m256i ids = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(s.stack + i));
      __mmask8 near = _mm256_cmp_ps_mask(entry, far, _CMP_GE_OQ);
      if (s.depth - i < 8) near &= __mmask8((1u << (s.depth - i)) - 1);
      _mm256_storeu_ps(s.entry + kept, _mm256_maskz_compress_ps(near, entry));
      _mm256_storeu_si256(reinterpret_cast<__m256i*>(s.stack + kept), _mm256_maskz_compress_epi32(near, ids));
      kept += uint32_t(__builtin_popcount(near));
    }
    s.depth = kept;
  }

  // Chooses among the triangles `hit` and the previous hit: at equal distance the lowest index, so that the layout, which
  // depends on the builder's threads, does not change the result.
  static void take_nearest(RayState& s, const Bvh::Leaf& leaf, uint32_t hit, __m256 t, __m256 p, __m256 q, __m256 r) {
    alignas(32) float ts[8], weights[3][8];
    _mm256_store_ps(ts, t), _mm256_store_ps(weights[0], p), _mm256_store_ps(weights[1], q), _mm256_store_ps(weights[2], r);
    float nearest = s.tfar;
    int32_t number = s.prim;
    int best = -1;
    for (; hit; hit &= hit - 1) {
      const int i = __builtin_ctz(hit);
      const int32_t n = int32_t(leaf.first[i % Bvh::kLeafPairs]) + i / Bvh::kLeafPairs;
      if (ts[i] < nearest || (ts[i] == nearest && n < number)) nearest = ts[i], number = n, best = i;
    }
    if (best < 0) return;
    set_far(s, nearest);
    s.prim = number;
    // The group's triangles are (a, c, d) and (a, b, c): u belongs to the second corner, v to the third.
    const bool second = best >= Bvh::kLeafPairs;
    s.u = weights[second ? 0 : 2][best], s.v = weights[second ? 1 : 0][best];
    s.sum = weights[0][best] + weights[1][best] + weights[2][best];
    forget_farther(s);
  }

  // Corners d, b, c, a of 4 pairs in 4 blocks of 4 lanes, likewise their outer edges da, bc, cd, ab; then in 8 lanes triangles
  // (d, a, c), and after them (b, c, a).
  template <bool kAny>
  void meet_leaf(RayState& s) const {
    const Bvh::Leaf& leaf = *reinterpret_cast<const Bvh::Leaf*>(memory_ + Bvh::offset_of(s.current));
    const auto from_origin = [&](int k) { return _mm512_sub_ps(_mm512_load_ps(leaf.at[s.axis[k]]), all_16(s.origin[k])); };
    const __m512 z = from_origin(2);
    const __m512 x = _mm512_fnmadd_ps(all_16(s.shear[0]), z, from_origin(0));
    const __m512 y = _mm512_fnmadd_ps(all_16(s.shear[1]), z, from_origin(1));
    // Side on which an edge passes the ray: the difference of two rounded products, so that the edge's other triangle, which
    // has it in the opposite direction, gets the exact opposite.
    constexpr int kNextCorner = 3 | 2 << 2 | 0 << 4 | 1 << 6;
    const __m512 next_x = _mm512_shuffle_f32x4(x, x, kNextCorner), next_y = _mm512_shuffle_f32x4(y, y, kNextCorner);
    const __m512 outer = _mm512_sub_ps(_mm512_mul_ps(x, next_y), _mm512_mul_ps(y, next_x));
    const __m256 cx = upper_half(x), cy = upper_half(y), ax = halves_swapped(cx), ay = halves_swapped(cy);
    // Weights of corners d and b, a and c, c and a: the sides of the opposite edges.
    const __m256 p = _mm256_sub_ps(_mm256_mul_ps(ax, cy), _mm256_mul_ps(ay, cx));
    const __m256 q = upper_half(outer), r = _mm512_castps512_ps256(outer);
    const __m256 zp = _mm512_castps512_ps256(z), zr = upper_half(z), zq = halves_swapped(zr);
    const __m256 zero = _mm256_setzero_ps();
    const __mmask8 left = _mm256_cmp_ps_mask(_mm256_min_ps(_mm256_min_ps(p, q), r), zero, _CMP_GE_OQ);
    const __mmask8 right = _mm256_cmp_ps_mask(_mm256_max_ps(_mm256_max_ps(p, q), r), zero, _CMP_LE_OQ);
    const __m256 sum = _mm256_add_ps(_mm256_add_ps(p, q), r);
    const __m256 weighed = _mm256_fmadd_ps(p, zp, _mm256_fmadd_ps(q, zq, _mm256_mul_ps(r, zr)));
    // For triangles seen edge-on, sides are mostly rounding errors: clamp the hit to the triangle's extent.
    const __m256 nearest = _mm256_min_ps(_mm256_min_ps(zp, zq), zr), farthest = _mm256_max_ps(_mm256_max_ps(zp, zq), zr);
    const __m256 depth = _mm256_min_ps(_mm256_max_ps(_mm256_div_ps(weighed, sum), nearest), farthest);
    const __m256 t = _mm256_mul_ps(depth, _mm256_set1_ps(s.per_z));
    __mmask8 hit = __mmask8((left | right) & leaf.there);
    hit = _mm256_mask_cmp_ps_mask(hit, sum, zero, _CMP_NEQ_OQ);
    hit = _mm256_mask_cmp_ps_mask(hit, t, _mm256_set1_ps(s.tnear), _CMP_GT_OQ);
    const __m256 far = _mm256_set1_ps(s.tfar);
    if (kAny) {
      hit = _mm256_mask_cmp_ps_mask(hit, t, far, _CMP_LT_OQ);
      s.prim = hit ? 0 : -1;
      return go_to(s, s.stack[s.depth = hit ? 0 : s.depth - 1]);
    }
    hit = _mm256_mask_cmp_ps_mask(hit, t, far, _CMP_LE_OQ);
    if (hit) take_nearest(s, leaf, hit, t, p, q, r);
    go_to(s, s.stack[--s.depth]);
  }

  const char* const memory_;
  const uint32_t root_;
  const RayColumns& rays_;
  RayState states_[kRays];
};

}  // namespace

void intersect_interleaved(const TriangleBvh& bvh, uint32_t count, const RayColumns& rays, const HitColumns& hits) {
  Interleaved(bvh, rays).follow<false>(count, [&](const RayState& s) {
    const uint32_t i = s.index;
    hits.t[i] = s.tfar, hits.prim[i] = s.prim, hits.geom[i] = s.prim < 0 ? -1 : 0;
    hits.u[i] = std::clamp(s.u / s.sum, 0.0f, 1.0f), hits.v[i] = std::clamp(s.v / s.sum, 0.0f, 1.0f);
  });
}

void occluded_interleaved(const TriangleBvh& bvh, uint32_t count, const RayColumns& rays, int32_t* blocked) {
  Interleaved(bvh, rays).follow<true>(count, [&](const RayState& s) { blocked[s.index] = s.prim >= 0; });
}

}  // namespace primray

#else

namespace primray {

void intersect_interleaved(const TriangleBvh&, uint32_t, const RayColumns&, const HitColumns&) {
  throw Error("bug", "the triangle hierarchy needs AVX-512");
}
void occluded_interleaved(const TriangleBvh&, uint32_t, const RayColumns&, int32_t*) {
  throw Error("bug", "the triangle hierarchy needs AVX-512");
}

}  // namespace primray

#endif
