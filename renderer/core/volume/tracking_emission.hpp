// Emission along rays through grids. Events occur at a rate that is proportional to the greatest value of the cell, and each
// adds the emission there by the rate: the mean of the sum is the integral along the ray. Where light sampling could have found
// the point, events are weighted by MIS: their density per solid angle and length is that of the ray's direction times the
// rate, the light sample's is c r^2 times the rate (light/sampler/volume_point.hpp), so the cell's part of the rate cancels.
//
// Where it could not, as on camera rays, the least value of a cell is integrated, and events are of the rest alone.
#pragma once

#include "volume/tracking.hpp"

namespace primray {

// `Around`: the medium that the ray is in beside volumes, with a transmittance up to a distance.
template <int W, class Around>
struct EmissionEvents {
  using F = vfloat<W>;
  using B = vbool<W>;
  vvec3<W> radiance{F(0.0f)};  // per unit of value and length
  Around around;
  F per_value{0.0f};      // rate of events by the cell's greatest value
  F scattered_pdf{0.0f};  // of the ray's direction
  F relative{0.0f};       // density of light samples by squared distance, relative to that of events; 0: there are none
  F travelled{0.0f};      // distance from the vertex that samples lights to the ray's origin
  vvec3<W> sum{F(0.0f)};

  PRIMRAY_INLINE CellSizes<W> cell_sizes() const { return CellSizes<W>::leaves(); }
  PRIMRAY_INLINE void begin(B fresh, const TrackingTask<W>&) { sum = select(fresh, vvec3<W>(F(0.0f)), sum); }
  PRIMRAY_INLINE F rate(const CellWalk<W>& walk) const { return (walk.high - least(walk)) * per_value; }
  PRIMRAY_INLINE B at_event(const GridRows<W>& grid, const CellWalk<W>& walk, const EventNumbers<W>& numbers, B event, F at) {
    const VoxelChoice<W> near = grid.voxel_at(walk.in_cell(at), numbers.voxel(), [&] { return numbers.velocity(); });
    const F low = least(walk), r = travelled + at, other = relative * r * r / max(scattered_pdf, 1e-30f);
    const F weight = select(relative > F(0.0f), 1.0f / (1.0f + other * other), F(1.0f));
    const vvec3<W> value = grid.color(near.x, near.y, near.z) - vvec3<W>(low);
    const F scale = weight / max((walk.high - low) * per_value, 1e-30f);
    sum = select(event, sum + radiance * value * around.transmittance(at) * scale, sum);
    return B(false);
  }
  PRIMRAY_INLINE void pass(B lanes, const CellWalk<W>& walk, F to) {
    sum = select(lanes, sum + radiance * (least(walk) * (to - walk.t)), sum);
  }

 private:
  // Value that is integrated.
  PRIMRAY_INLINE F least(const CellWalk<W>& walk) const {
    return select((relative > F(0.0f)) | around.exists(), F(0.0f), walk.low);
  }
};

// Events that also choose one distance of each segment, with a probability in proportion to the emission there: deep pictures
// show all of it at that distance.
template <int W, class Around>
struct PlacedEmissionEvents : EmissionEvents<W, Around> {
  using F = vfloat<W>;
  using B = vbool<W>;
  F chosen{0.0f}, found{0.0f};  // the distance, and the emission so far
  vuint<W> number{0u};          // of the choice

  PRIMRAY_INLINE void begin(B fresh, const TrackingTask<W>& task) {
    EmissionEvents<W, Around>::begin(fresh, task);
    chosen = select(fresh, task.segment.from, chosen), found = select(fresh, F(0.0f), found);
    number = select(fresh, mix(task.seed ^ vuint<W>(0x1b873593u)), number);
  }
  PRIMRAY_INLINE B at_event(const GridRows<W>& grid, const CellWalk<W>& walk, const EventNumbers<W>& numbers, B event, F at) {
    const B ends = EmissionEvents<W, Around>::at_event(grid, walk, numbers, event, at);
    choose(event, at);
    return ends;
  }
  PRIMRAY_INLINE void pass(B lanes, const CellWalk<W>& walk, F to) {
    EmissionEvents<W, Around>::pass(lanes, walk, to);
    number = select(lanes, mix(number), number);
    choose(lanes, walk.t + (to - walk.t) * unit_float(number));
  }

 private:
  // Chooses `at` for what was added to the sum.
  PRIMRAY_INLINE void choose(B lanes, F at) {
    const F all = this->sum.x + this->sum.y + this->sum.z, own = all - found;
    number = select(lanes, mix(number), number);
    const B takes = lanes & (own > F(0.0f)) & (unit_float(number) * all < own);
    chosen = select(takes, at, chosen), found = select(lanes, all, found);
  }
};

}  // namespace primray
