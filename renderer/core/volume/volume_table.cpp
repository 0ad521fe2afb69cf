// Construction of the table of volumes, of the hierarchies over their instances, and of the cells by which emission is sampled.
#include "volume/volume_table.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <unordered_map>

#include "base/error.hpp"

namespace primray {
namespace {

constexpr int kMostInLeaf = 2;
// Events on a ray through an emission's box, if all of its part there had the greatest value. In a flame a ray has few of them.
constexpr double kEvents = 16;
// Share of the diagonal of an emission's box below which parts of rays have fewer events.
constexpr double kLeastPart = 1.0 / 1024;

// Corner of the box of a grid's positions with other values than 0.
dvec3 corner_of(const GridTable::Row& row, int corner) {
  const auto at = [&](int a) { return double(corner >> a & 1 ? row.high[a] : row.low[a]); };
  return {at(0), at(1), at(2)};
}

void add_mapped(const GridTable::Row& row, const daffine& m, Box& box) {
  for (int corner = 0; corner < 8; ++corner) {
    const dvec3 p = m.point(corner_of(row, corner));
    box.add(vec3{float(p.x), float(p.y), float(p.z)});
  }
}

// Number of parts of a segment over which instances turn, whose ends are bounded.
constexpr int kTurnParts = 32;

// Adds the path of a grid's box over one segment, in which it turns. Corners leave the chords between the ends of parts by at
// most an eighth of their greatest acceleration, times the part's length squared; for a rotation R at the rate w, and a stretch
// S that changes by D, the acceleration of R S c is at most w^2 |S c| + 2 w |D c|.
void add_turned(const GridTable::Row& row, const PoseSegment& a, const PoseSegment& b, const daffine& index_from_grid,
                Box& box) {
  const double w = 2 * a.half_angle;
  double acceleration = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const dvec3 c = index_from_grid.point(corner_of(row, corner));
    const auto stretched = [&](const PoseSegment& s) { return s.stretch[0] * c.x + s.stretch[1] * c.y + s.stretch[2] * c.z; };
    const dvec3 first = stretched(a), last = stretched(b);
    acceleration = std::max(acceleration, w * w * std::max(length(first), length(last)) + 2 * w * length(last - first));
  }
  const float off = float(acceleration / (8 * kTurnParts * kTurnParts));
  Box parts;
  for (int k = 0; k <= kTurnParts; ++k) add_mapped(row, between(a, b, double(k) / kTurnParts) * index_from_grid, parts);
  box.add(parts.low - vec3(off)), box.add(parts.high + vec3(off));
}

// Enlarges a box by more than rounding makes of its corners.
Box widened(Box box) {
  for (float vec3::* a : {&vec3::x, &vec3::y, &vec3::z}) {
    const float slack = 1e-6f * std::max(std::fabs(box.low.*a), std::fabs(box.high.*a));
    box.low.*a -= slack, box.high.*a += slack;
  }
  return box;
}

}  // namespace

daffine VolumePlacements::add(int32_t row, int32_t grid_number, const GridTable::Row& bounds, const VolumePath& path,
                              CameraVisibility seen) {
  camera.add(of.size(), seen);
  Box box;
  daffine middle = path.core_from_index.front() * path.index_from_grid;
  if (!path.clock) {
    add_mapped(bounds, middle, box);
  } else {
    const size_t times = path.core_from_index.size();
    MovingInstances m{int32_t(of.size()),
                      1,
                      motion.clock_of(*path.clock),
                      path.turns,
                      path.turns ? motion.turning.size() : motion.linear.size() / 12,
                      path.index_from_grid};
    if (path.turns) {
      motion.turning.resize(m.base + times);
      make_pose_segments(path.core_from_index.data(), times, &motion.turning[m.base]);
      for (size_t k = m.base; k + 1 < m.base + times; ++k)
        add_turned(bounds, motion.turning[k], motion.turning[k + 1], path.index_from_grid, box);
    } else {
      for (const daffine& at : path.core_from_index) {
        motion.linear.resize(motion.linear.size() + 12);
        put_columns(at * path.index_from_grid, &motion.linear[motion.linear.size() - 12]);
        add_mapped(bounds, at * path.index_from_grid, box);
      }
    }
    motion.instances.push_back(m), motion.any_instances = true;
    middle = motion.at(m, 0, 0.5f);
  }
  of.push_back(row), grid.push_back(grid_number), boxes.push_back(widened(box));
  index_from_core.resize(index_from_core.size() + 12);
  put_columns(inverse(middle), &index_from_core[index_from_core.size() - 12]);
  return middle;
}

int64_t VolumeTable::memory_bytes() const {
  const auto bytes = [](const auto&... v) { return int64_t((0 + ... + (v.capacity() * sizeof(v[0])))); };
  int64_t total = bytes(grids.node_of, grids.node_ranges, grids.leaf_of, grids.leaf_ranges, grids.floats, grids.halves, cells,
                        cell_cdf, events_per_value, relative_density, least_part, light_of, core_from_grid, instance_of_light);
  for (const VolumePlacements* p : {&in_media, &in_emissions})
    total += bytes(p->of, p->grid, p->index_from_core, p->boxes, p->nodes, p->order, p->motion.linear, p->motion.turning,
                   p->motion.instances);
  return total;
}

int VolumeTable::add_grid(GridInput grid) {
  // Grids far from their origin are moved by whole nodes, so that positions in them keep their precision.
  std::vector<int32_t> origins(grid.leaf_origins.begin(), grid.leaf_origins.end()), tiles(grid.tiles.begin(), grid.tiles.end());
  int32_t lowest[3] = {INT32_MAX, INT32_MAX, INT32_MAX};
  for (size_t i = 0; i < origins.size(); ++i) lowest[i % 3] = std::min(lowest[i % 3], origins[i]);
  for (size_t i = 0; i < tiles.size(); ++i)
    if (i % 4 < 3) lowest[i % 4] = std::min(lowest[i % 4], tiles[i]);
  for (int32_t& low : lowest) low = low == INT32_MAX ? 0 : low & -4096;
  for (size_t i = 0; i < origins.size(); ++i) origins[i] -= lowest[i % 3];
  for (size_t i = 0; i < tiles.size(); ++i)
    if (i % 4 < 3) tiles[i] -= lowest[i % 4];
  grid.leaf_origins = origins, grid.tiles = tiles;
  first_voxels.push_back({double(lowest[0]), double(lowest[1]), double(lowest[2])});
  return grids.add(grid);
}

int VolumeTable::add_blurred_grid(int grid, int velocity, double frame) {
  if (grid < 0 || velocity < 0 || size_t(std::max(grid, velocity)) >= grids.rows.size())
    throw Error("internal", "a blurred grid refers to a grid that does not exist");
  const dvec3 first = first_voxels[size_t(grid)], shift = first - first_voxels[size_t(velocity)];
  first_voxels.push_back(first);
  return grids.add_blurred({grid, velocity, {int32_t(shift.x), int32_t(shift.y), int32_t(shift.z)}, float(frame)});
}

namespace {

void put(const vec3& v, double factor, float* to) {
  to[0] = float(v.x * factor), to[1] = float(v.y * factor), to[2] = float(v.z * factor);
}

// Calls f(path) for each instance; returns those whose matrix is singular or not finite. `first`: voxel at the origin of the
// grid's coordinates.
template <class F>
std::vector<int64_t> for_instances(const VolumeInstances& instances, const daffine& core_from_world, const dvec3& first,
                                   const F& f) {
  std::vector<int64_t> left_out;
  const size_t times = std::max<size_t>(instances.times.size(), 1), count = instances.world_from_index.size() / (12 * times);
  const MotionClock clock = clock_of_times(instances.times);
  VolumePath path{std::vector<daffine>(times), {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, first}};
  path.clock = instances.times.empty() ? nullptr : &clock, path.turns = instances.turns;
  for (size_t i = 0; i < count; ++i) {
    bool regular = true;
    for (size_t k = 0; k < times; ++k) {
      path.core_from_index[k] = core_from_world * affine_from_rows(&instances.world_from_index[12 * (k * count + i)]);
      regular &= is_regular(path.core_from_index[k]);
    }
    if (regular)
      f(path);
    else
      left_out.push_back(int64_t(i));
  }
  return left_out;
}

}  // namespace

std::vector<int64_t> VolumeTable::add_medium(const MediumInput& input, const daffine& core_from_world, double scale) {
  if (input.grid < 0 || size_t(input.grid) >= grids.rows.size() || input.albedo_grid >= int(grids.rows.size()))
    throw Error("internal", "a medium refers to a grid that does not exist");
  const dvec3 first = first_voxels[size_t(input.grid)];
  Medium medium{};
  medium.grid = input.grid, medium.albedo_grid = input.albedo_grid, medium.phase = input.phase;
  put(input.extinction, 1.0 / scale, medium.extinction), put(input.albedo, 1.0, medium.albedo);
  if (input.albedo_grid >= 0) {
    const dvec3 shift = first - first_voxels[size_t(input.albedo_grid)];
    medium.albedo_shift[0] = int32_t(shift.x), medium.albedo_shift[1] = int32_t(shift.y);
    medium.albedo_shift[2] = int32_t(shift.z);
  }
  const GridTable::Row& row = grids.rows[size_t(input.grid)];
  media.push_back(medium);
  return for_instances(input.instances, core_from_world, first, [&](const VolumePath& path) {
    if (row.most > 0 && std::max({medium.extinction[0], medium.extinction[1], medium.extinction[2]}) > 0)
      in_media.add(int32_t(media.size()) - 1, medium.grid, row, path, input.camera);
  });
}

std::vector<int64_t> VolumeTable::add_emission(const VolumeEmissionInput& input, const daffine& core_from_world, double scale) {
  if (input.grid < 0 || size_t(input.grid) >= grids.rows.size())
    throw Error("internal", "an emission refers to a grid that does not exist");
  const GridTable::Row& row = grids.rows[size_t(input.grid)];
  Emission emission{};
  emission.grid = input.grid;
  put(input.emission, 1.0 / scale, emission.radiance);
  const bool shines = row.most > 0 && std::max({emission.radiance[0], emission.radiance[1], emission.radiance[2]}) > 0;
  if (shines) list_cells(emission);
  double weight = 0;
  for (int32_t k = emission.first_cell; k < emission.first_cell + emission.cells; ++k)
    weight += double(cells[size_t(k)].most) * std::pow(double(cells[size_t(k)].side), 3);
  emissions.push_back(emission);
  const auto place = [&](const VolumePath& path) {
    if (!shines) return;
    const daffine core_from_grid = in_emissions.add(int32_t(emissions.size()) - 1, emission.grid, row, path, input.camera);
    const Box& box = in_emissions.boxes.back();
    events_per_value.push_back(float(kEvents / row.most));
    least_part.push_back(float(std::max(kLeastPart * double(length(box.high - box.low)), 1e-30)));
    const double size = path.clock ? 1 : std::fabs(core_from_grid.determinant());
    relative_density.push_back(float(1 / (events_per_value.back() * weight * size)));
    light_of.push_back(-1);
    this->core_from_grid.resize(this->core_from_grid.size() + 12);
    put_columns(core_from_grid, &this->core_from_grid[this->core_from_grid.size() - 12]);
  };
  return for_instances(input.instances, core_from_world, first_voxels[size_t(input.grid)], place);
}

// Lists the cells that a walk through leaves finds (cell_walk.hpp): nodes with one value, and leaves of other nodes.
void VolumeTable::list_cells(Emission& emission) {
  const GridTable::Row& row = grids.rows[size_t(emission.grid)];
  emission.first_cell = int32_t(cells.size());
  double sum = 0;
  std::vector<double> sums;
  const auto add = [&](int32_t x, int32_t y, int32_t z, int32_t side, float most) {
    if (!(most > 0)) return;
    cells.push_back({{x, y, z}, side, most});
    sums.push_back(sum += double(most) * side * side * side);
  };
  size_t at = size_t(row.node_base);
  for (int32_t x = 0; x < row.nodes_along[0]; ++x)
    for (int32_t y = 0; y < row.nodes_along[1]; ++y)
      for (int32_t z = 0; z < row.nodes_along[2]; ++z) {
        const size_t node = size_t(grids.node_of[at++]);
        const int32_t low[3] = {(row.first_node[0] + x) * kNodeSide, (row.first_node[1] + y) * kNodeSide,
                                (row.first_node[2] + z) * kNodeSide};
        const float most = grids.node_ranges[2 * node + 1];
        if (node == 0 || !(most > grids.node_ranges[2 * node])) {
          add(low[0], low[1], low[2], kNodeSide, node == 0 ? 0.0f : most);
          continue;
        }
        for (int32_t k = 0; k < kNodeEntries; ++k)
          add(low[0] + k / 256 * kLeafSide, low[1] + k / 16 % 16 * kLeafSide, low[2] + k % 16 * kLeafSide, kLeafSide,
              grids.leaf_ranges[2 * (node * kNodeEntries + size_t(k)) + 1]);
      }
  emission.cells = int32_t(cells.size()) - emission.first_cell;
  for (const double s : sums) cell_cdf.push_back(float(s / sum));
  if (!sums.empty()) cell_cdf.back() = 1;
}

dvec3 VolumeTable::emitted_intensity(size_t instance) const {
  const Emission& emission = emissions[size_t(in_emissions.of[instance])];
  const GridTable::Row& row = grids.rows[size_t(emission.grid)];
  // Each voxel of a block stands for its own volume.
  dvec3 sum(0.0);
  std::unordered_map<int32_t, dvec3> of_block;
  const int channels = row.channels;
  const auto number = [&](size_t at) { return row.is_half ? double(as_float(grids.halves[at])) : double(grids.floats[at]); };
  for (int32_t i = 0; i < row.nodes_along[0] * row.nodes_along[1] * row.nodes_along[2]; ++i) {
    const size_t node = size_t(grids.node_of[size_t(row.node_base + i)]);
    if (node == 0) continue;
    for (size_t k = 0; k < size_t(kNodeEntries); ++k) {
      const int32_t block = grids.leaf_of[node * kNodeEntries + k];
      if (block == 0) continue;
      const auto [found, is_new] = of_block.try_emplace(block, dvec3(0.0));
      if (is_new)
        for (size_t v = 0; v < size_t(kLeafVoxels); ++v) {
          const size_t first = size_t(block) * kLeafVoxels + v * size_t(channels);
          const double r = number(first);
          found->second = found->second + (channels == 1 ? dvec3(r) : dvec3{r, number(first + 1), number(first + 2)});
        }
      sum = sum + found->second;
    }
  }
  const daffine m = affine_from_columns(&core_from_grid[12 * instance]);
  return sum * dvec3{emission.radiance[0], emission.radiance[1], emission.radiance[2]} * std::fabs(m.determinant());
}

void VolumePlacements::finish() {
  nodes.clear(), order.resize(boxes.size());
  std::iota(order.begin(), order.end(), 0);
  if (order.empty()) return;
  // Halve at the median of the centres along the longest axis.
  nodes.push_back({{}, {}, 0, int32_t(order.size())});
  for (size_t n = 0; n < nodes.size(); ++n) {
    const int32_t first = nodes[n].first, count = nodes[n].count;
    Box box, centres;
    const auto centre = [&](int32_t i) { return (boxes[size_t(i)].low + boxes[size_t(i)].high) * 0.5f; };
    for (int32_t k = first; k < first + count; ++k)
      box.add(boxes[size_t(order[size_t(k)])]), centres.add(centre(order[size_t(k)]));
    const float lows[3] = {box.low.x, box.low.y, box.low.z}, highs[3] = {box.high.x, box.high.y, box.high.z};
    std::copy_n(lows, 3, nodes[n].low), std::copy_n(highs, 3, nodes[n].high);
    if (count <= kMostInLeaf) continue;
    const vec3 size = centres.high - centres.low;
    float vec3::* axis = size.x >= size.y && size.x >= size.z ? &vec3::x : size.y >= size.z ? &vec3::y : &vec3::z;
    std::nth_element(order.begin() + first, order.begin() + first + count / 2, order.begin() + first + count,
                     [&](int32_t a, int32_t b) { return std::pair(centre(a).*axis, a) < std::pair(centre(b).*axis, b); });
    nodes[n].first = int32_t(nodes.size()), nodes[n].count = 0;
    nodes.push_back({{}, {}, first, count / 2});
    nodes.push_back({{}, {}, first + count / 2, count - count / 2});
  }
}

}  // namespace primray
