// The volumes that rays cross, one after the other, by the distance at which the ray enters the grid's box.
#pragma once

#include "volume/volume_table.hpp"

namespace primray {

// Rays in the arrays of their owner, by path: of the path pool, or of a queue of shadow rays.
struct VolumeRays {
  const float *ox, *oy, *oz, *dx, *dy, *dz;
  const float* begin;  // null: all rays begin at 0
  const float* end;
  const uint32_t* number;          // seeds of random numbers
  const float* time;               // null: nothing moves
  const int32_t* depth = nullptr;  // scattering events before; null: no ray comes from the camera

  template <int W>
  PRIMRAY_INLINE vfloat<W> time_of(vint<W> ray) const {
    return time ? gather<W>(time, ray) : vfloat<W>(0.0f);
  }
  // Returns the lanes of `m` whose rays `ray` come straight from the camera.
  template <int W>
  PRIMRAY_INLINE vbool<W> from_camera(vbool<W> m, vint<W> ray) const {
    return depth ? m & (gather<W>(depth, select(m, ray, vint<W>(0))) == vint<W>(0)) : vbool<W>(false);
  }
};

// Instance that a ray enters next, and its part of the ray; -1: none.
template <int W>
struct NextVolume {
  vint<W> instance;
  vfloat<W> from, to;
};

// Returns the matrix to the grid of an instance that is at `core_from_grid`; one whose volume has vanished is out of all rays'
// reach.
inline daffine grid_from_core(const daffine& core_from_grid) {
  const dvec3 none(0.0);
  return is_regular(core_from_grid) ? inverse(core_from_grid) : daffine{none, none, none, dvec3(1e30)};
}

// Rays `m` in the coordinates of a grid, at their times.
template <int W>
struct GridRays {
  vvec3<W> o, d;
  PRIMRAY_INLINE GridRays(const VolumePlacements& placed, vbool<W> m, vint<W> instance, const vvec3<W>& origin,
                          const vvec3<W>& direction, vfloat<W> time) {
    AffineLanes<W> to(placed.index_from_core.data(), instance * vint<W>(12));
    if (placed.motion.any_instances) move_instances(placed.motion, m, instance, time, to, grid_from_core);
    o = to.vector(origin) + to.o, d = to.vector(direction);
  }
};

// Where the grids of emitting instances are at the times of lanes `m`, and the densities of their light samples (see
// VolumeTable::relative_density).
template <int W>
struct EmissionPlaces {
  AffineLanes<W> core_from_grid;
  vfloat<W> relative_density;
  PRIMRAY_INLINE EmissionPlaces(const VolumeTable& v, vbool<W> m, vint<W> instance, vfloat<W> time)
      : core_from_grid(v.core_from_grid.data(), instance * vint<W>(12)),
        relative_density(gather<W>(v.relative_density.data(), instance)) {
    if (v.in_emissions.motion.any_instances) move(v, m, instance, time);
  }

 private:
  PRIMRAY_RARE void move(const VolumeTable& v, vbool<W> m, vint<W> instance, vfloat<W> time) {
    move_instances(v.in_emissions.motion, m, instance, time, core_from_grid);
    const vfloat<W> size = abs(dot(cross(core_from_grid.x, core_from_grid.y), core_from_grid.z));
    for (uint32_t b = bits(m); b; b &= b - 1)
      if (const int i = __builtin_ctz(b); v.in_emissions.motion.find(instance[i]))
        relative_density.set(i, relative_density[i] / std::max(size[i], 1e-30f));
  }
};

// Returns the rays of `m` that cross the box around an instance's path.
template <int W>
PRIMRAY_INLINE vbool<W> near_path(const Box& box, vbool<W> m, const vvec3<W>& o, const vvec3<W>& d, vfloat<W> begin,
                                  vfloat<W> end) {
  using F = vfloat<W>;
  const auto clip = [&](F origin, F way, float low, float high) {
    const F inverse = 1.0f / select(abs(way) < F(1e-18f), copysign(F(1e-18f), way), way);
    const F a = (low - origin) * inverse, b = (high - origin) * inverse;
    begin = max(begin, min(a, b)), end = min(end, max(a, b));
  };
  clip(o.x, d.x, box.low.x, box.high.x), clip(o.y, d.y, box.low.y, box.high.y), clip(o.z, d.z, box.low.z, box.high.z);
  return m & (begin <= end);
}

// Length over which events of emission on rays from vertices `o` are spread: that of the ray's part in the box of the grid, as
// if nothing were in its way. So events are as many on rays across a thin sheet as along it, and light samples, which know the
// vertex and the direction alone, find the same density.
template <int W>
PRIMRAY_RARE vfloat<W> emitting_part(const VolumeTable& v, vbool<W> m, vint<W> instance, const vvec3<W>& o, const vvec3<W>& d,
                                     vfloat<W> time) {
  using F = vfloat<W>;
  const GridRays<W> ray(v.in_emissions, m, instance, o, d, time);
  constexpr int kNumbers = sizeof(GridTable::Row) / sizeof(float);
  const vint<W> row = gather<W>(v.in_emissions.grid.data(), instance) * vint<W>(kNumbers);
  const F origin[3] = {ray.o.x, ray.o.y, ray.o.z}, way[3] = {ray.d.x, ray.d.y, ray.d.z};
  F from(0.0f), to(kInfinity);
  for (int a = 0; a < 3; ++a) {
    const F inverse = 1.0f / select(abs(way[a]) < F(1e-18f), copysign(F(1e-18f), way[a]), way[a]);
    const F low = (gather<W>(&v.grids.rows[0].low[a], row) - origin[a]) * inverse;
    const F high = (gather<W>(&v.grids.rows[0].high[a], row) - origin[a]) * inverse;
    from = max(from, min(low, high)), to = min(to, max(low, high));
  }
  return max(to - from, gather<W>(v.least_part.data(), instance));
}

// Clips rays to the box of a grid: `from` and `to` become those of the part inside, which is empty where from >= to.
template <int W>
PRIMRAY_INLINE void clip_to_grid(const GridTable::Row& row, const GridRays<W>& ray, vfloat<W>& from, vfloat<W>& to) {
  using F = vfloat<W>;
  const F o[3] = {ray.o.x, ray.o.y, ray.o.z}, d[3] = {ray.d.x, ray.d.y, ray.d.z};
  for (int a = 0; a < 3; ++a) {
    const F inverse = 1.0f / select(abs(d[a]) < F(1e-18f), copysign(F(1e-18f), d[a]), d[a]);
    const F low = (row.low[a] - o[a]) * inverse, high = (row.high[a] - o[a]) * inverse;
    from = max(from, min(low, high)), to = min(to, max(low, high));
  }
}

// Number of volumes that one traversal of the hierarchy finds: by the first one for a ray, which may collide in one of them,
// and by later ones at most; each finds four times as many as the one before. Traversals that began again after each volume
// would take time with the square of the number of volumes that overlap.
constexpr int kFirstFound = 4, kMostFound = 64;

// Volume that one ray enters.
struct EnteredVolume {
  int32_t instance;
  float from, to;

  // Order along rays: by distance, then by instance.
  bool is_before(const EnteredVolume& other) const {
    return from < other.from || (from == other.from && instance < other.instance);
  }
};

// Finds the volumes that one ray enters after `last` (null: from `begin` on) and before `end`: the nearest `most` of them, in
// order. Returns their number.
inline int find_in_hierarchy(const GridTable& grids, const VolumePlacements& placed, const vvec3<1>& o, const vvec3<1>& d,
                             float begin, float end, float time, const EnteredVolume* last, int most, EnteredVolume* found) {
  const float origin[3] = {o.x[0], o.y[0], o.z[0]}, way[3] = {d.x[0], d.y[0], d.z[0]};
  float inverse[3];
  for (int a = 0; a < 3; ++a) inverse[a] = 1.0f / (std::fabs(way[a]) < 1e-18f ? std::copysign(1e-18f, way[a]) : way[a]);
  int count = 0;
  // Returns where the ray enters a node, or infinity if it misses it or if enough volumes are nearer.
  const auto entry = [&](const VolumePlacements::Node& node) {
    float from = begin, to = count == most ? found[most - 1].from : end;
    for (int a = 0; a < 3; ++a) {
      const float low = (node.low[a] - origin[a]) * inverse[a], high = (node.high[a] - origin[a]) * inverse[a];
      from = std::max(from, std::min(low, high)), to = std::min(to, std::max(low, high));
    }
    // Boxes are a little larger than what they hold, but the distances to them are rounded too.
    return from <= to * 1.00001f ? from : INFINITY;
  };
  struct Entry {
    int32_t node;
    float from;
  } stack[64];
  int size = 0;
  if (const float from = entry(placed.nodes[0]); from < INFINITY) stack[size++] = {0, from};
  while (size > 0) {
    const Entry at = stack[--size];
    if (count == most && !(at.from <= found[most - 1].from * 1.00001f)) continue;
    const VolumePlacements::Node& node = placed.nodes[size_t(at.node)];
    if (node.count == 0) {
      Entry near{node.first, entry(placed.nodes[size_t(node.first)])};
      Entry far{node.first + 1, entry(placed.nodes[size_t(node.first) + 1])};
      if (far.from < near.from) std::swap(near, far);
      if (far.from < INFINITY) stack[size++] = far;
      if (near.from < INFINITY) stack[size++] = near;
      continue;
    }
    for (int32_t k = node.first; k < node.first + node.count; ++k) {
      const int32_t i = placed.order[size_t(k)];
      const GridTable::Row& row = grids.rows[size_t(placed.grid[size_t(i)])];
      vfloat<1> enters(begin), leaves(end);
      clip_to_grid(row, GridRays<1>(placed, vbool<1>(true), vint<1>(i), o, d, vfloat<1>(time)), enters, leaves);
      const EnteredVolume volume{i, enters[0], leaves[0]};
      if (!(volume.from < volume.to) || (last && !last->is_before(volume))) continue;
      if (count == most && !volume.is_before(found[most - 1])) continue;
      int place = count < most ? count++ : most - 1;
      for (; place > 0 && volume.is_before(found[place - 1]); --place) found[place] = found[place - 1];
      found[place] = volume;
    }
  }
  return count;
}

// Finds the volumes that rays of lanes `m` enter after `last` and before `end`, of a few volumes.
template <int W>
PRIMRAY_RARE NextVolume<W> next_volume(const GridTable& grids, const VolumePlacements& placed, vbool<W> m, const vvec3<W>& o,
                                       const vvec3<W>& d, vfloat<W> begin, vfloat<W> end, vfloat<W> time,
                                       const NextVolume<W>& last) {
  using F = vfloat<W>;
  using I = vint<W>;
  NextVolume<W> found{I(-1), end, end};
  for (int32_t i = 0; i < int32_t(placed.size()); ++i) {
    const GridTable::Row& row = grids.rows[size_t(placed.grid[size_t(i)])];
    vbool<W> near = m;
    if (placed.motion.any_instances && !any(near = near_path(placed.boxes[size_t(i)], m, o, d, begin, end))) continue;
    F from = begin, to = end;
    clip_to_grid(row, GridRays<W>(placed, near, I(i), o, d, time), from, to);
    const vbool<W> after = (last.instance < I(0)) | (from > last.from) | ((from == last.from) & (I(i) > last.instance));
    const vbool<W> is = near & (from < to) & after & (from < found.from);
    found.instance = select(is, I(i), found.instance), found.from = select(is, from, found.from);
    found.to = select(is, to, found.to);
  }
  return found;
}

}  // namespace primray
