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
//
// Segments are tasks: a lane whose segment ends takes the next one, so that lanes stay busy however long segments are.
#pragma once

#include "math/transcendental.hpp"
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

// Greatest value that is followed, for the greatest extinction `most` per unit of a value: steps have a mean of at least 2^-20
// voxels, and of two roundings of the distance. Shorter ones would not advance, and what has greater values is opaque.
template <int W>
PRIMRAY_INLINE vfloat<W> greatest_value(const GridSegment<W>& s, vfloat<W> most) {
  const vfloat<W> by_voxel = sqrt(dot(s.d, s.d)) * 0x1p20f, by_distance = 0x1p22f / max(abs(s.to), 1e-30f);
  return min(by_voxel, by_distance) / max(most, 1e-30f);
}

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
  // Those for a voxel of velocities.
  PRIMRAY_INLINE vvec3<W> velocity() const { return {(*this)(5), (*this)(6), (*this)(7)}; }
};

// Events of segments that end at the first collision.
template <int W>
struct CollisionEvents {
  using F = vfloat<W>;
  using B = vbool<W>;
  vvec3<W> k{F(0.0f)};  // extinction per unit of the grid's values and of distance
  F most{0.0f};         // its largest channel
  F greatest{0.0f};     // value that is followed
  B is_gray{true};
  vvec3<W> beta{F(0.0f)};  // throughput of the path, before the albedo of a collision
  B happens{false};        // before the segment's end, at `t`
  F t{0.0f};
  vint<W> voxel[3] = {vint<W>(0), vint<W>(0), vint<W>(0)};  // which the collision is with

  PRIMRAY_INLINE void begin(B fresh, const GridSegment<W>& s, const vvec3<W>& throughput) {
    k = select(fresh, s.extinction, k), beta = select(fresh, throughput, beta);
    most = max_component(k), greatest = select(fresh, greatest_value(s, most), greatest);
    is_gray = (k.x == most) & (k.y == most) & (k.z == most);
    happens &= !fresh, t = select(fresh, s.to, t);
  }
  PRIMRAY_INLINE CellSizes<W> cell_sizes() const { return CellSizes<W>::by_depth(most); }
  PRIMRAY_INLINE F rate(const CellWalk<W>& walk) const { return high(walk) * most; }
  // Returns the lanes of `event` that end at distance `at`.
  PRIMRAY_INLINE B at_event(const GridRows<W>& grid, const CellWalk<W>& walk, const EventNumbers<W>& numbers, B event, F at) {
    const F choice = numbers(1) * high(walk);
    const VoxelChoice<W> near = grid.voxel_at(walk.in_cell(at), numbers.voxel(), [&] { return numbers.velocity(); });
    B real = event & is_gray & (choice < walk.low);
    if (const B reads = event & !real; any(reads)) {
      const F value = grid.value(near.x, near.y, near.z);
      real |= reads & is_gray & (choice < value);
      if (const B colored = reads & !is_gray; any(colored))
        real |= collides_colored(colored, min(value / max(high(walk), 1e-30f), F(1.0f)), numbers(1));
    }
    happens |= real, t = select(real, at, t);
    voxel[0] = select(real, near.x, voxel[0]), voxel[1] = select(real, near.y, voxel[1]);
    voxel[2] = select(real, near.z, voxel[2]);
    return real;
  }
  PRIMRAY_INLINE void pass(B, const CellWalk<W>&, F) {}

 private:
  PRIMRAY_INLINE F high(const CellWalk<W>& walk) const { return min(walk.high, greatest); }
  // Chooses by the throughput of all channels whether an event with the share `share` of the majorant is a collision.
  PRIMRAY_INLINE B collides_colored(B colored, F share, F u) {
    const vvec3<W> hit = beta * k * (share * (1.0f / most)), passed = beta - hit;
    const F chance = (hit.x + hit.y + hit.z) / max(beta.x + beta.y + beta.z, 1e-30f);
    const B hits = colored & (u < chance);
    const vvec3<W> after = select(hits, hit * (1.0f / max(chance, 1e-30f)), passed * (1.0f / max(1.0f - chance, 1e-30f)));
    beta = select(colored, after, beta);
    return hits;
  }
};

// Events of segments whose transmittance is estimated: unbiased, and at most a few times 1.
template <int W>
struct TransmittanceEvents {
  using F = vfloat<W>;
  using B = vbool<W>;
  vvec3<W> k{F(0.0f)}, share{F(0.0f)};  // extinction, and its channels by the largest
  F most{0.0f}, greatest{0.0f};
  vvec3<W> ratio{F(1.0f)};
  F control{0.0f};  // integral of the cells' least values

  PRIMRAY_INLINE void begin(B fresh, const GridSegment<W>& s) {
    k = select(fresh, s.extinction, k), most = max_component(k), share = k * (1.0f / max(most, 1e-30f));
    greatest = select(fresh, greatest_value(s, most), greatest);
    ratio = select(fresh, vvec3<W>(F(1.0f)), ratio), control = select(fresh, F(0.0f), control);
  }
  PRIMRAY_INLINE CellSizes<W> cell_sizes() const { return CellSizes<W>::by_depth(most); }
  PRIMRAY_INLINE F rate(const CellWalk<W>& walk) const { return span(walk) * most; }
  PRIMRAY_INLINE B at_event(const GridRows<W>& grid, const CellWalk<W>& walk, const EventNumbers<W>& numbers, B event, F at) {
    const VoxelChoice<W> near = grid.voxel_at(walk.in_cell(at), numbers.voxel(), [&] { return numbers.velocity(); });
    const F value = grid.value(near.x, near.y, near.z);
    const F part = min(max((value - walk.low) / max(span(walk), 1e-30f), 0.0f), F(1.0f));
    ratio = select(event, ratio * (vvec3<W>(F(1.0f)) - share * part), ratio);
    // Little light is left: most such segments end, the others stand for them.
    const F left = max_component(ratio) * exp_of_minus(min(min(k.x, k.y), k.z) * control);
    const B faint = event & (left < F(kFaint)), ends = faint & (numbers(1) >= F(kFaintKeep));
    ratio = select(ends, vvec3<W>(F(0.0f)), select(faint, ratio * (1.0f / kFaintKeep), ratio));
    return event & (ends | !(max_component(ratio) > F(0.0f)));
  }
  PRIMRAY_INLINE void pass(B lanes, const CellWalk<W>& walk, F to) {
    control += select(lanes, walk.low * (to - walk.t), F(0.0f));
  }
  PRIMRAY_INLINE vvec3<W> transmittance() const {
    return ratio * vvec3<W>(exp_of_minus(k.x * control), exp_of_minus(k.y * control), exp_of_minus(k.z * control));
  }

 private:
  PRIMRAY_INLINE F span(const CellWalk<W>& walk) const { return min(walk.high - walk.low, greatest); }
  static constexpr float kFaint = 0.05f, kFaintKeep = 0.25f;
};

// What a task follows.
template <int W>
struct TrackingTask {
  vint<W> grid{0};
  GridSegment<W> segment;
  vuint<W> seed{0u};
  vfloat<W> time{0.0f};
};

// Number of steps of all lanes, and of those that had a segment.
struct LaneSteps {
  int64_t all = 0, busy = 0;
};

// Follows the segments of tasks [0, count) through their cells. `load(fresh, numbers, events)` returns the tasks of lanes
// `fresh` and begins their events; `store(done, numbers, events)` receives those that have ended.
template <int W, class Events, class Load, class Store>
PRIMRAY_INLINE LaneSteps follow_segments(const GridTable& table, int count, const Load& load, const Store& store) {
  using F = vfloat<W>;
  using B = vbool<W>;
  using I = vint<W>;
  constexpr int kIdle = W > 1 ? W / 4 : 1;  // number of idle lanes for which tasks are loaded
  Events events;
  CellWalk<W> walk;
  EventNumbers<W> numbers{vuint<W>(0u)};
  GridRows<W> grid(table, I(0));
  I task(0), grid_number(0);
  F depth(0.0f);  // optical depth up to the next event
  F time(0.0f);
  B active(false);
  int next = 0;
  LaneSteps steps;
  while (true) {
    // Load tasks into idle lanes
    if (const uint32_t idle = bits(!active); next < count && __builtin_popcount(idle) >= kIdle) {
      alignas(64) int32_t of[W];
      std::fill_n(of, W, -1);
      for (uint32_t b = idle; b && next < count; b &= b - 1) of[__builtin_ctz(b)] = next++;
      const I loaded = primray::load<W>(of);
      const B fresh = loaded >= I(0);
      task = select(fresh, loaded, task);
      const TrackingTask<W> t = load(fresh, task, events);
      grid_number = select(fresh, t.grid, grid_number);
      time = select(fresh, t.time, time);
      grid = GridRows<W>(table, grid_number, time);
      numbers.seed = select(fresh, t.seed, numbers.seed), numbers.event = select(fresh, I(0), numbers.event);
      walk.begin(grid, fresh, t.segment.o, t.segment.d, t.segment.from, t.segment.to, events.cell_sizes());
      depth = select(fresh, numbers.exponential(), depth);
      const B empty = fresh & !(walk.end > walk.t);
      if (any(empty)) store(empty, task, events);
      active |= fresh & !empty;
    }
    if (!any(active)) {
      if (next >= count) return steps;
      continue;
    }
    ++steps.all, steps.busy += __builtin_popcount(bits(active));

    // Take each to its next event, or to the cell's end
    const F rate = events.rate(walk), across = rate * (walk.next - walk.t);
    const B event = active & (depth < across), leaves = active & !event;
    B ends(false);
    if (any(event)) {
      const F t = min(walk.t + depth / max(rate, 1e-30f), walk.next);
      ends = events.at_event(grid, walk, numbers, event, t);
      events.pass(event, walk, t);
      walk.t = select(event, t, walk.t);
      numbers.event += select(event, I(1), I(0));
      depth = select(event, numbers.exponential(), depth);
    }
    events.pass(leaves, walk, walk.next);
    depth = select(leaves, depth - across, depth);
    const B goes = leaves & (walk.next < walk.end);
    ends |= leaves & !goes;
    if (any(ends)) store(ends, task, events);
    active &= !ends;
    if (any(goes)) walk.advance(grid, goes);
  }
}

}  // namespace primray
