// Distance sampling and transmittance in a grid, by null collisions with the range of values in each cell.
//
// Distances: delta tracking (Woodcock 1965), in which a cell's least value is accepted without a read (decomposition tracking;
// Kutz et al. 2017, "Spectral and Decomposition Tracking for Rendering Heterogeneous Volumes"). Where extinction is coloured
// the kind of an event is sampled by the mean over the channels, each by its share of the path's throughput (Miller, Georgiev
// and Jarosz 2019, "A null-scattering path integral formulation of light transport"): the sum of the channels stays what it
// was.
//
// Transmittance: residual ratio tracking with a cell's least value as control (Novak et al. 2014, "Residual Ratio Tracking for
// Estimating Attenuation in Participating Media"), exact where a cell has one value.
//
// Random numbers are a function of the path and the number of the event, so that neither lanes nor the order of paths show.
#pragma once

#include "math/transcendental.hpp"
#include "medium/medium.hpp"
#include "sampler/sampler.hpp"
#include "volume/cell_walk.hpp"

namespace primray {

// A ray's segment in one grid: in the grid's coordinates, with distances of the world.
template <int W>
struct GridSegment {
  vvec3<W> o, d;
  vfloat<W> from, to;
  vvec3<W> extinction;  // per unit of the grid's values and of distance
};

// Random numbers in [0, 1) of a path's events in a grid.
template <int W>
struct EventNumbers {
  vuint<W> seed;
  vint<W> event{0};
  static constexpr int kPerEvent = 8;

  PRIMRAY_INLINE vfloat<W> operator()(int k) const {
    const vint<W> number = (event << 3) + vint<W>(k);
    return unit_float(mix(seed ^ mix(bit_cast<vuint<W>>(number) + vuint<W>(0x9e3779b9u))));
  }
  // Distance to the next event, in units of the mean distance.
  PRIMRAY_INLINE vfloat<W> exponential() const {
    const vfloat<W> u = (*this)(0);
    return -0.693147181f * log2_cosine(1.0f - u, u * (2.0f - u));
  }
  PRIMRAY_INLINE vvec3<W> voxel() const { return {(*this)(2), (*this)(3), (*this)(4)}; }
};

template <int W>
PRIMRAY_INLINE vfloat<W> value_near(const GridRows<W>& grid, const CellWalk<W>& walk, vfloat<W> t,
                                    const EventNumbers<W>& numbers) {
  const VoxelChoice<W> voxel(walk.in_cell(t), numbers.voxel());
  return grid.value(voxel.x, voxel.y, voxel.z);
}

// Follows a segment through its cells, with events at the rate `rate_of(walk)`. `at_event(lanes, t)` returns the lanes that end
// there; `pass(lanes, t)` is told of each piece within a cell, up to `t`, at whose beginning the walk is.
template <int W, class Rate, class Event, class Pass>
PRIMRAY_INLINE void follow_segment(const GridRows<W>& grid, vbool<W> m, const GridSegment<W>& s, CellWalk<W>& walk,
                                   EventNumbers<W>& numbers, const Rate& rate_of, const Event& at_event, const Pass& pass) {
  using F = vfloat<W>;
  walk.begin(grid, m, s.o, s.d, s.from, s.to, max_component(s.extinction));
  F depth = numbers.exponential();
  vbool<W> active = m & (s.to > s.from);
  while (any(active)) {
    const F rate = rate_of(walk), across = rate * (walk.next - walk.t);
    const vbool<W> event = active & (depth < across), leaves = active & !event;
    if (any(event)) {
      const F t = min(walk.t + depth / max(rate, 1e-30f), walk.next);
      active &= !at_event(event, t);
      pass(event, t);
      walk.t = select(event, t, walk.t);
      numbers.event += select(event, vint<W>(1), vint<W>(0));
      depth = select(event, numbers.exponential(), depth);
    }
    pass(leaves, walk.next);
    depth = select(leaves, depth - across, depth);
    const vbool<W> goes = leaves & (walk.next < walk.end);
    active &= !(leaves & !goes);
    if (any(goes)) walk.advance(grid, goes);
  }
}

template <int W>
struct Collision {
  vbool<W> happens;  // before the segment's end, at `t`
  vfloat<W> t;
  vvec3<W> beta;  // throughput of the path from there on, before the albedo of a collision
};

// Samples the first collision on a segment, for paths with throughput `beta`.
template <int W>
PRIMRAY_RARE Collision<W> sample_collision(const GridTable& table, vbool<W> m, vint<W> grid_number, const GridSegment<W>& s,
                                           const vvec3<W>& beta, vuint<W> seed) {
  using F = vfloat<W>;
  using B = vbool<W>;
  const GridRows<W> grid(table, grid_number);
  const vvec3<W>& k = s.extinction;
  const F most = max_component(k);
  const B is_gray = (k.x == most) & (k.y == most) & (k.z == most);
  EventNumbers<W> numbers{seed};
  CellWalk<W> walk;
  Collision<W> found{B(false), s.to, beta};
  // Chooses by the throughput of all channels whether an event with the share `share` of the majorant is a collision.
  const auto collides_colored = [&](B colored, F share) {
    const vvec3<W>& b = found.beta;
    const vvec3<W> hit = b * k * (share * (1.0f / most)), passed = b - hit;
    const F chance = (hit.x + hit.y + hit.z) / max(b.x + b.y + b.z, 1e-30f);
    const B hits = colored & (numbers(1) < chance);
    const vvec3<W> after = select(hits, hit * (1.0f / max(chance, 1e-30f)), passed * (1.0f / max(1.0f - chance, 1e-30f)));
    found.beta = select(colored, after, b);
    return hits;
  };
  const auto at_event = [&](B event, F t) {
    const F choice = numbers(1) * walk.high;
    B real = event & is_gray & (choice < walk.low);
    if (const B reads = event & !real; any(reads)) {
      const F value = value_near(grid, walk, t, numbers);
      real |= reads & is_gray & (choice < value);
      if (const B colored = reads & !is_gray; any(colored)) real |= collides_colored(colored, value / max(walk.high, 1e-30f));
    }
    found.happens |= real;
    found.t = select(real, t, found.t);
    return real;
  };
  follow_segment(grid, m, s, walk, numbers, [&](const CellWalk<W>& w) { return w.high * most; }, at_event, [](B, F) {});
  return found;
}

// Estimates the transmittance of a segment: unbiased, and within [0, 1].
template <int W>
PRIMRAY_RARE vvec3<W> estimate_transmittance(const GridTable& table, vbool<W> m, vint<W> grid_number, const GridSegment<W>& s,
                                             vuint<W> seed) {
  using F = vfloat<W>;
  using B = vbool<W>;
  const GridRows<W> grid(table, grid_number);
  const vvec3<W>& k = s.extinction;
  const F most = max_component(k), one(1.0f);
  const vvec3<W> share = k * (1.0f / max(most, 1e-30f));
  EventNumbers<W> numbers{seed};
  CellWalk<W> walk;
  vvec3<W> ratio(one);
  F control(0.0f);  // integral of the cells' least values
  const auto at_event = [&](B event, F t) {
    const F value = value_near(grid, walk, t, numbers);
    const F part = min(max((value - walk.low) / max(walk.high - walk.low, 1e-30f), 0.0f), one);
    ratio = select(event, ratio * (vvec3<W>(one) - share * part), ratio);
    return event & !(max_component(ratio) > F(0.0f));
  };
  const auto pass = [&](B lanes, F t) { control += select(lanes, walk.low * (t - walk.t), F(0.0f)); };
  follow_segment(grid, m, s, walk, numbers, [&](const CellWalk<W>& w) { return (w.high - w.low) * most; }, at_event, pass);
  const vvec3<W> left{exp_of_minus(k.x * control), exp_of_minus(k.y * control), exp_of_minus(k.z * control)};
  return ratio * left;
}

}  // namespace primray
