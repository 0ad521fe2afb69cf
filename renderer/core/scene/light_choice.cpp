// See light_choice.hpp.
#include "scene/light_choice.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <span>

namespace primray {
namespace {

struct Power {
  double amount;
  bool far;  // infinitely far: its power has no common measure with the rest
};

Power plain_power(const float* row) {
  const double s0 = row[kSize0], s1 = row[kSize1], e = std::max(double(row[kImportance]), 1e-30);
  switch (LightType(int(row[kType]))) {
    case LightType::kPoint:
      return {4 * std::numbers::pi * e, false};
    case LightType::kSphere:
      return {4 * std::numbers::pi * s0 * s0 * std::numbers::pi * e, false};
    case LightType::kDisk:
      return {std::numbers::pi * s0 * s0 * std::numbers::pi * e, false};
    case LightType::kRect:
      return {4 * s0 * s1 * std::numbers::pi * e, false};
    case LightType::kCylinder:
      return {4 * std::numbers::pi * s0 * s1 * std::numbers::pi * e, false};
    case LightType::kMesh:
      return {2 * std::numbers::pi * e, false};
    case LightType::kLine:
      return {std::numbers::pi * std::numbers::pi * 2 * s1 * e, false};
    case LightType::kDistant:
    case LightType::kDome:
      return {e, true};
  }
  return {0, false};
}

Power power_of(const LightTable& table, const float* row) {
  Power power = plain_power(row);
  if (row[kShaping] != 0) power.amount *= table.shaping.row(int(row[kShaping]))[kMean];
  return power;
}

// Adds 0 and the cumulative probabilities of `lights`: by power, but half of the choices for what is infinitely far, where
// there is any. In whole multiples of 2^-24, which is what the sampler's numbers are, at least one each: every light is then
// chosen with exactly the probability that is read off here.
void add_probabilities(const std::vector<Power>& powers, std::span<const int32_t> lights, std::vector<float>& cdf) {
  double near = 0, far = 0;
  for (const int32_t i : lights) (powers[size_t(i)].far ? far : near) += powers[size_t(i)].amount;
  constexpr double whole = 0x1p24;
  const double count = double(lights.size()), ones = count < whole / 2 ? 1.0 : 0.0;
  double run = 0;
  cdf.push_back(0.0f);
  for (size_t k = 0; k < lights.size(); ++k) {
    const Power& power = powers[size_t(lights[k])];
    const double share = near > 0 && far > 0 ? 0.5 : 1.0;
    run += share * power.amount / (power.far ? far : near);
    const double units = ones * double(k + 1) + std::round(std::min(run, 1.0) * (whole - ones * count));
    cdf.push_back(k + 1 == lights.size() ? 1.0f : float(units / whole));
  }
}

// One list for each row of the LinkTable; none where they would be too long.
void build_linked_lights(LightTable& table, const std::vector<Power>& powers) {
  LinkedLights linked;
  linked.first.push_back(0);
  for (int row = 0; row < table.links.rows; ++row) {
    for (int i = 0; i < table.count; ++i)
      if (table.links.holds(row, table.light_link[size_t(i)])) linked.lights.push_back(i);
    if (linked.lights.size() > LinkedLights::kMost) return;
    const size_t first = size_t(linked.first.back());
    linked.first.push_back(int32_t(linked.lights.size()));
    linked.longest = std::max(linked.longest, int(linked.lights.size() - first));
    add_probabilities(powers, std::span(linked.lights).subspan(first), linked.cdf);
  }
  linked.lights.push_back(0), linked.cdf.push_back(1.0f);  // lanes without a light read here
  table.linked = std::move(linked);
}

}  // namespace

void build_light_choice(LightTable& table) {
  if (table.count <= LightTable::kWeighed) return;
  std::vector<Power> powers;
  for (int i = 0; i < table.count; ++i) powers.push_back(power_of(table, table.row(i)));
  std::vector<int32_t> all(size_t(table.count));
  std::iota(all.begin(), all.end(), 0);
  table.power_cdf.clear();
  add_probabilities(powers, all, table.power_cdf);
  if (table.links.any()) build_linked_lights(table, powers);
}

}  // namespace primray
