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
// Events on a ray along the diagonal of an emission's box, if all of it had the greatest value. In a flame a ray has few of
// them.
constexpr double kEvents = 16;

// Returns the box of a grid's positions with other values than 0, mapped by `m`; slightly larger than rounding makes it.
Box mapped_box(const GridTable::Row& row, const daffine& m) {
  Box box;
  for (int corner = 0; corner < 8; ++corner) {
    const auto at = [&](int a) { return double(corner >> a & 1 ? row.high[a] : row.low[a]); };
    const dvec3 p = m.point({at(0), at(1), at(2)});
    box.add(vec3{float(p.x), float(p.y), float(p.z)});
  }
  for (float vec3::* a : {&vec3::x, &vec3::y, &vec3::z}) {
    const float slack = 1e-6f * std::max(std::fabs(box.low.*a), std::fabs(box.high.*a));
    box.low.*a -= slack, box.high.*a += slack;
  }
  return box;
}

}  // namespace

void VolumePlacements::add(int32_t row, int32_t grid_number, const GridTable::Row& bounds, const daffine& core_from_grid) {
  of.push_back(row), grid.push_back(grid_number);
  index_from_core.resize(index_from_core.size() + 12);
  put_columns(inverse(core_from_grid), &index_from_core[index_from_core.size() - 12]);
  boxes.push_back(mapped_box(bounds, core_from_grid));
}

int64_t VolumeTable::memory_bytes() const {
  const auto bytes = [](const auto&... v) { return int64_t((0 + ... + (v.capacity() * sizeof(v[0])))); };
  int64_t total = bytes(grids.node_of, grids.node_ranges, grids.leaf_of, grids.leaf_ranges, grids.floats, grids.halves, cells,
                        cell_cdf, event_rate, relative_density, light_of, core_from_grid, instance_of_light);
  for (const VolumePlacements* p : {&in_media, &in_emissions})
    total += bytes(p->of, p->grid, p->index_from_core, p->boxes, p->nodes, p->order);
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

namespace {

void put(const vec3& v, double factor, float* to) {
  to[0] = float(v.x * factor), to[1] = float(v.y * factor), to[2] = float(v.z * factor);
}

// Calls f(core_from_grid) for each instance; returns those whose matrix is singular or not finite. `first`: voxel at the origin
// of the grid's coordinates.
template <class F>
std::vector<int64_t> for_instances(std::span<const double> world_from_index, const daffine& core_from_world, const dvec3& first,
                                   const F& f) {
  std::vector<int64_t> left_out;
  for (size_t i = 0; i < world_from_index.size() / 12; ++i) {
    const daffine core_from_index = core_from_world * affine_from_rows(&world_from_index[12 * i]);
    if (is_regular(core_from_index))
      f(core_from_index * daffine{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, first});
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
  medium.grid = input.grid, medium.albedo_grid = input.albedo_grid, medium.anisotropy = input.anisotropy;
  put(input.extinction, 1.0 / scale, medium.extinction), put(input.albedo, 1.0, medium.albedo);
  if (input.albedo_grid >= 0) {
    const dvec3 shift = first - first_voxels[size_t(input.albedo_grid)];
    medium.albedo_shift[0] = int32_t(shift.x), medium.albedo_shift[1] = int32_t(shift.y);
    medium.albedo_shift[2] = int32_t(shift.z);
  }
  const GridTable::Row& row = grids.rows[size_t(input.grid)];
  media.push_back(medium);
  return for_instances(input.world_from_index, core_from_world, first, [&](const daffine& core_from_grid) {
    if (row.most > 0 && std::max({medium.extinction[0], medium.extinction[1], medium.extinction[2]}) > 0)
      in_media.add(int32_t(media.size()) - 1, medium.grid, row, core_from_grid);
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
  const auto place = [&](const daffine& core_from_grid) {
    if (!shines) return;
    in_emissions.add(int32_t(emissions.size()) - 1, emission.grid, row, core_from_grid);
    const Box& box = in_emissions.boxes.back();
    event_rate.push_back(float(kEvents / (row.most * std::max(double(length(box.high - box.low)), 1e-30))));
    relative_density.push_back(float(1 / (event_rate.back() * weight * std::fabs(core_from_grid.determinant()))));
    light_of.push_back(-1);
    this->core_from_grid.resize(this->core_from_grid.size() + 12);
    put_columns(core_from_grid, &this->core_from_grid[this->core_from_grid.size() - 12]);
  };
  return for_instances(input.world_from_index, core_from_world, first_voxels[size_t(input.grid)], place);
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
