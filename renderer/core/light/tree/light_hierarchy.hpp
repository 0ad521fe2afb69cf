// Bounding volume hierarchy over the lights that rays can hit, for scenes with too many lights to test each. It only culls
// lights that a ray cannot hit: hits and their MIS weights are computed light by light (integrator/emission.hpp).
//
// Nodes are visited in one order whatever the ray, and each lane follows only the nodes that its own ray enters, so that a lane
// adds up the same lights in the same order whatever the other lanes do.
#pragma once

#include <cstdint>
#include <vector>

#include "math/vec3.hpp"

namespace primray {

struct LightBox {
  float low[3], high[3];
};

struct LightHierarchy {
  struct Node {
    LightBox box;
    float radius;          // radius of the largest light in the node
    int32_t next;          // next node after this node's subtree
    int32_t first, count;  // lights of a leaf; count 0: inner node
  };
  std::vector<Node> nodes;      // in depth-first order
  std::vector<int32_t> lights;  // ordered by leaf
  std::vector<int32_t> far;     // lights at infinity, which any ray may hit
  std::vector<float> radius;    // bounding sphere radius of each light's box; 0: not in the tree
  static constexpr int kLeaf = 4;

  bool empty() const { return nodes.empty() && far.empty(); }
};

// Builds the tree over the lights `numbers` and their boxes; `radius` must be set before.
void build_light_hierarchy(LightHierarchy& tree, std::vector<int32_t> numbers, const std::vector<LightBox>& boxes);

// Returns the lanes of `m` whose ray o + t d enters the box before `end`.
template <int W>
PRIMRAY_INLINE vbool<W> enters(const LightBox& box, vbool<W> m, const vvec3<W>& o, const vvec3<W>& inverse, vfloat<W> end) {
  using F = vfloat<W>;
  // Slab test: Kay and Kajiya 1986, "Ray Tracing Complex Scenes".
  const F x0 = (F(box.low[0]) - o.x) * inverse.x, x1 = (F(box.high[0]) - o.x) * inverse.x;
  const F y0 = (F(box.low[1]) - o.y) * inverse.y, y1 = (F(box.high[1]) - o.y) * inverse.y;
  const F z0 = (F(box.low[2]) - o.z) * inverse.z, z1 = (F(box.high[2]) - o.z) * inverse.z;
  const F near = max(max(min(x0, x1), min(y0, y1)), min(z0, z1)), far = min(min(max(x0, x1), max(y0, y1)), max(z0, z1));
  // Margins exceed the rounding errors of the slabs.
  return m & (near <= far * 1.00001f) & (far >= F(0.0f)) & (near * 0.9999f <= end);
}

// Calls visit(light, lanes) for every light whose box the rays o + t d, t <= end, enter; `lanes` are those that do. Lights of
// radius r are skipped beyond distance r times `reach`.
template <int W, class Visit>
PRIMRAY_INLINE void visit_lights(const LightHierarchy& tree, vbool<W> active, const vvec3<W>& o, const vvec3<W>& d,
                                 vfloat<W> end, vfloat<W> reach, const Visit& visit) {
  for (const int32_t light : tree.far) visit(light, active);
  // Avoid zero components, so that no slab evaluates 0 times infinity.
  const auto inverse_of = [](vfloat<W> x) { return 1.0f / copysign(max(abs(x), 1e-20f), x); };
  const vvec3<W> inverse{inverse_of(d.x), inverse_of(d.y), inverse_of(d.z)};
  struct Entered {
    int32_t end;  // end of the subtree
    vbool<W> lanes;
  };
  // Halving 2^31 lights goes no deeper.
  Entered path[40];
  int depth = 0;
  path[0] = {int32_t(tree.nodes.size()), active};
  for (int32_t at = 0; at < int32_t(tree.nodes.size());) {
    while (at >= path[depth].end) --depth;
    const LightHierarchy::Node& node = tree.nodes[at];
    const vbool<W> lanes = enters(node.box, path[depth].lanes, o, inverse, min(end, reach * node.radius));
    if (!any(lanes)) {
      at = node.next;
      continue;
    }
    for (int32_t i = node.first; i < node.first + node.count; ++i) visit(tree.lights[i], lanes);
    if (node.count == 0) path[++depth] = {node.next, lanes};
    ++at;
  }
}

}  // namespace primray
