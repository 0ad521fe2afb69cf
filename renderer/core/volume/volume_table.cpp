// Construction of the table of volumes, and of the hierarchy over their instances.
#include "volume/volume_table.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/error.hpp"

namespace primray {
namespace {

constexpr int kMostInLeaf = 2;

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

int64_t VolumeTable::memory_bytes() const {
  return int64_t(4 * (grids.node_of.size() + grids.node_ranges.size() + grids.leaf_of.size() + grids.leaf_ranges.size() +
                      grids.floats.size() + index_from_core.size() + medium_of.size() + order.size()) +
                 2 * grids.halves.size() + sizeof(Node) * nodes.size());
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

std::vector<int64_t> VolumeTable::add_medium(const MediumInput& input, const daffine& core_from_world, double scale) {
  if (input.grid < 0 || size_t(input.grid) >= grids.rows.size() || input.albedo_grid >= int(grids.rows.size()))
    throw Error("internal", "a medium refers to a grid that does not exist");
  const dvec3 first = first_voxels[size_t(input.grid)];
  Medium medium{};
  medium.grid = input.grid, medium.albedo_grid = input.albedo_grid, medium.anisotropy = input.anisotropy;
  const auto put = [](const vec3& v, double factor, float* to) {
    to[0] = float(v.x * factor), to[1] = float(v.y * factor), to[2] = float(v.z * factor);
  };
  put(input.extinction, 1.0 / scale, medium.extinction), put(input.albedo, 1.0, medium.albedo);
  if (input.albedo_grid >= 0) {
    const dvec3 shift = first - first_voxels[size_t(input.albedo_grid)];
    medium.albedo_shift[0] = int32_t(shift.x), medium.albedo_shift[1] = int32_t(shift.y),
    medium.albedo_shift[2] = int32_t(shift.z);
  }
  const GridTable::Row& row = grids.rows[size_t(input.grid)];
  std::vector<int64_t> left_out;
  for (size_t i = 0; i < input.world_from_index.size() / 12; ++i) {
    const daffine core_from_index = core_from_world * affine_from_rows(&input.world_from_index[12 * i]);
    if (!is_regular(core_from_index)) {
      left_out.push_back(int64_t(i));
      continue;
    }
    if (!(row.most > 0)) continue;
    const daffine core_from_grid = core_from_index * daffine{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, first};
    index_from_core.resize(index_from_core.size() + 12);
    put_columns(inverse(core_from_grid), &index_from_core[index_from_core.size() - 12]);
    medium_of.push_back(int32_t(media.size()));
    boxes_.push_back(mapped_box(row, core_from_grid));
  }
  media.push_back(medium);
  return left_out;
}

void VolumeTable::finish() {
  nodes.clear(), order.resize(boxes_.size());
  std::iota(order.begin(), order.end(), 0);
  if (order.empty()) return;
  // Halve at the median of the centres along the longest axis.
  nodes.push_back({{}, {}, 0, int32_t(order.size())});
  for (size_t n = 0; n < nodes.size(); ++n) {
    const int32_t first = nodes[n].first, count = nodes[n].count;
    Box box, centres;
    const auto centre = [&](int32_t i) { return (boxes_[size_t(i)].low + boxes_[size_t(i)].high) * 0.5f; };
    for (int32_t k = first; k < first + count; ++k)
      box.add(boxes_[size_t(order[size_t(k)])]), centres.add(centre(order[size_t(k)]));
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
