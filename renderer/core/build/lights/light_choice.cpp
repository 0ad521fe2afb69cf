// Construction of light trees.
#include "build/lights/light_choice.hpp"

#include <algorithm>
#include <map>
#include <numeric>

#include "build/lights/light_bounds.hpp"

namespace primray {
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

}  // namespace primray
