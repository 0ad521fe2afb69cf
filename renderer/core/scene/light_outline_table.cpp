// Lookup in light_outline_table.hpp.
#include "scene/light_outline_table.hpp"

#include <algorithm>

namespace primray {

std::span<const LightOutlines::Part> LightOutlines::at(int x, int y) const {
  if (y < 0 || size_t(y) + 1 >= rows.size()) return {};
  const auto first = parts.begin() + rows[size_t(y)], end = parts.begin() + rows[size_t(y) + 1];
  const auto [a, b] = std::equal_range(first, end, Part{x, 0, 0, 0, 0, 0}, [](auto& p, auto& q) { return p.x < q.x; });
  return {a, b};
}

}  // namespace primray
