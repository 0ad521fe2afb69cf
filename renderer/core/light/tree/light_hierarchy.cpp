// Construction of the light hierarchy: the lights of a node are split at the median of their centres along its longest side.
#include "light/tree/light_hierarchy.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace primray {
namespace {

struct Build {
  LightHierarchy& tree;
  const std::vector<int32_t>& numbers;
  const std::vector<LightBox>& boxes;  // by index into tree.lights before any is moved
  std::vector<int32_t> order;

  float center(int32_t i, int axis) const { return 0.5f * boxes[i].low[axis] + 0.5f * boxes[i].high[axis]; }

  void add(int32_t first, int32_t end) {
    constexpr float inf = std::numeric_limits<float>::infinity();
    LightBox box{{inf, inf, inf}, {-inf, -inf, -inf}};
    float low[3] = {inf, inf, inf}, high[3] = {-inf, -inf, -inf};  // bounds of the centres
    for (int32_t i = first; i < end; ++i) {
      for (int a = 0; a < 3; ++a) {
        box.low[a] = std::min(box.low[a], boxes[order[i]].low[a]), box.high[a] = std::max(box.high[a], boxes[order[i]].high[a]);
        const float c = center(order[i], a);
        low[a] = std::min(low[a], c), high[a] = std::max(high[a], c);
      }
    }
    const size_t at = tree.nodes.size();
    const bool leaf = end - first <= LightHierarchy::kLeaf;
    float radius = 0;
    for (int32_t i = first; i < end; ++i) radius = std::max(radius, tree.radius[size_t(numbers[size_t(order[i])])]);
    tree.nodes.push_back({box, radius, 0, first, leaf ? end - first : 0});
    if (leaf) {
      std::sort(order.begin() + first, order.begin() + end);
    } else {
      int axis = 0;
      for (int a = 1; a < 3; ++a)
        if (high[a] - low[a] > high[axis] - low[axis]) axis = a;
      const int32_t middle = first + (end - first) / 2;
      std::nth_element(order.begin() + first, order.begin() + middle, order.begin() + end, [&](int32_t i, int32_t j) {
        const float x = center(i, axis), y = center(j, axis);
        return x != y ? x < y : i < j;  // the same order with every standard library
      });
      add(first, middle);
      add(middle, end);
    }
    tree.nodes[at].next = int32_t(tree.nodes.size());
  }
};

}  // namespace

void build_light_hierarchy(LightHierarchy& tree, std::vector<int32_t> numbers, const std::vector<LightBox>& boxes) {
  if (numbers.empty()) return;
  Build build{tree, numbers, boxes, std::vector<int32_t>(numbers.size())};
  for (size_t i = 0; i < numbers.size(); ++i) build.order[i] = int32_t(i);
  build.add(0, int32_t(numbers.size()));
  for (const int32_t i : build.order) tree.lights.push_back(numbers[i]);
}

}  // namespace primray
