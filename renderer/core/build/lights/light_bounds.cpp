// Computation of bounds of lights, and construction of light trees.

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>

#include "build/lights/lights.hpp"
#include "math/matrix.hpp"

namespace primray {

// Construction of light trees.

namespace {

// Lower limit of a light's weight relative to the strongest, so that none is lost to underflow.
constexpr double kWeakest = 1e-20;

// Builds one tree for each set of lights that illuminate a row of the LinkTable; none if they would be too large.
void build_linked_lights(LightTable& table, const std::vector<LightBounds>& bounds) {
  LinkedLights linked;
  std::map<std::vector<int32_t>, int> known;  // by the row's bits
  for (int row = 0; row < table.links.rows; ++row) {
    const auto bits = table.links.bits.begin() + ptrdiff_t(row) * table.links.words;
    const auto [same, added] = known.try_emplace(std::vector<int32_t>(bits, bits + table.links.words), row);
    if (!added) {
      const size_t r = size_t(same->second);
      linked.first.push_back(linked.first[r]), linked.count.push_back(linked.count[r]), linked.root.push_back(linked.root[r]);
      continue;
    }
    std::vector<int32_t> lights;
    for (int i = 0; i < table.count; ++i)
      if (table.links.holds(row, table.light_link[size_t(i)])) lights.push_back(i);
    if (linked.lights.size() + lights.size() > LinkedLights::kMost) return;
    std::vector<LightTree::Place> places;
    linked.first.push_back(int32_t(linked.lights.size())), linked.count.push_back(int32_t(lights.size()));
    linked.root.push_back(lights.empty() ? -1 : add_light_tree(table.tree, bounds, lights, places));
    linked.longest = std::max(linked.longest, int(lights.size()));
    linked.lights.insert(linked.lights.end(), lights.begin(), lights.end());
    linked.places.insert(linked.places.end(), places.begin(), places.end());
  }
  linked.lights.push_back(0);  // lanes without a light read this entry
  table.linked = std::move(linked);
}

}  // namespace

void build_light_choice(LightTable& table) {
  table.tree = {}, table.linked = {};
  if (!table.by_tree()) return;
  std::vector<LightBounds> bounds;
  bounds.reserve(size_t(table.count));
  double strongest = 0;
  for (int i = 0; i < table.count; ++i) {
    bounds.push_back(light_bounds(table, table.row(i)));
    strongest = std::max(strongest, double(bounds.back().intensity));
  }
  const double scale = strongest > 0 ? 1 / strongest : 1;
  for (LightBounds& b : bounds) b.intensity = float(std::max(b.intensity * scale, kWeakest));
  table.tree.scale = float(scale);
  std::vector<int32_t> all(bounds.size());
  std::iota(all.begin(), all.end(), 0);
  add_light_tree(table.tree, bounds, all, table.tree.places);
  if (table.links.any()) build_linked_lights(table, bounds);
}

namespace {

// Squares of distances must remain floats.
constexpr float kLeast2 = 1e-24f;
void put_far(LightBounds& b, const dvec3& direction, double reach) {
  put(b.center, 0, direction);
  put(b.low, 0, direction - dvec3(reach)), put(b.high, 0, direction + dvec3(reach));
  b.far = true, b.least2 = 1;
}

}  // namespace

LightBox light_box(const float* row) {
  LightBox box;
  with_light_type(row, [&]<class T>(T) {
    for (int a = 0; a < 3; ++a) {
      const double reach = T::half_extent(row, a), center = row[T::kCenter + a], more = reach * 1e-5 + std::fabs(center) * 4e-6;
      box.low[a] = float(center - reach - more), box.high[a] = float(center + reach + more);
    }
  });
  return box;
}

// Bounds of a light that moves: its whole path, emitting in all directions.
static LightBounds path_light_bounds(const LightPath& path, LightBounds b) {
  if (!(path.radius > 0)) {
    put_far(b, dvec3{0, 0, 1}, 2.0);
    return b;
  }
  for (int a = 0; a < 3; ++a) {
    const float center = float(component(path.center, size_t(a)));
    b.low[a] = center - path.radius, b.high[a] = center + path.radius;
  }
  put(b.center, 0, dvec3(path.center));
  b.intensity = b.intensity * path.spread, b.least2 = std::max(float(path.radius * path.radius), kLeast2);
  return b;
}

LightBounds light_bounds(const LightTable& table, const float* row) {
  const double power = row[kImportance];
  LightBounds b;
  b.intensity = float(power);
  if (const int32_t path = table.motion.row(int((row - table.rows.data()) / kLightFields)); path >= 0)
    return path_light_bounds(table.motion.paths[size_t(path)], b);
  TreeBounds spread;
  with_light_type(row, [&]<class T>(T) {
    if constexpr (requires { T::far_direction(row); })
      put_far(b, T::far_direction(row), T::far_half_extent(row));
    else
      spread = T::tree_bounds(row, b);
  });
  if (b.far) return b;
  const LightBox box = light_box(row);
  for (int a = 0; a < 3; ++a) b.low[a] = box.low[a], b.high[a] = box.high[a];
  put(b.center, 0, light_vector(row, light_center(row)));
  double intensity = power * spread.factor;
  if (const int shaping = int_at(row, kShaping); shaping != 0 && !(int_at(row, kLightFlags) & kMoving)) {
    const float* shaped = table.shaping.row(shaping);
    b.exact = true;
    const double reach = std::min(shaped[kReach] + 2e-3, std::numbers::pi);
    // Its mean over all directions, concentrated on the part that it reaches.
    intensity *= shaped[kMean] / std::max(0.5 * (1 - std::cos(reach)), 1e-6);
    if (reach < 3.1 && !b.directed()) {
      put(b.axis, 0, light_vector(shaped, kShapedAxis));
      b.cos_end = float(std::cos(reach)), b.floor = 1, b.radius = shaped[kReachRadius];
    }
  }
  b.intensity = float(intensity), b.least2 = std::max(float(spread.least2), kLeast2);
  return b;
}

}  // namespace primray
