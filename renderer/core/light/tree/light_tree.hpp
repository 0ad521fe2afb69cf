// Light tree for scenes with too many lights to weigh each: Conty Estevez and Kulla 2018, "Importance Sampling of Many Lights
// with Adaptive Tree Splitting". This file has its data; tree_choice.hpp samples it.
//
// A node holds up to kMostSlots lights and clusters of lights, or up to kLastSlots single lights, in blocks of kBlock that are
// weighed together: each path traverses the tree alone, and the lanes of a vector are the slots of a node. Wide nodes take few
// steps, and compare many small clusters where a binary tree would compare two large ones. Slots are weighed from the data in
// the block, except for lights that only their own row can weigh well (`exact`).
#pragma once

#include <cstdint>
#include <vector>

namespace primray {

struct LightTree {
  static constexpr int kBlock = 16, kMostSlots = 2 * kBlock, kLastSlots = 4 * kBlock;

  struct alignas(64) Block {
    // Mean position of the lights, weighted by intensity, or the unit direction to a light at infinity (`near` is then 0
    // instead of 1); all of them are within `half` of it.
    float center[3][kBlock], half[3][kBlock], near[kBlock];
    float intensity[kBlock];  // irradiance times distance^2; 0: no light
    float least2[kBlock];     // lower limit of squared distances
    // Cone of the lights' directions of emission: `axis`, angles up to that of cos_axis, and the angle off them beyond which
    // nothing is emitted (cos_end; -2: emits all around). The weight falls off with the cosine, down to `floor`. `radius`: of
    // the bounding sphere; 0 if the angle off the axis is the same for all points of a light.
    float axis[3][kBlock], cos_axis[kBlock], sin_axis[kBlock], cos_end[kBlock], floor[kBlock], radius[kBlock];
    int32_t child[kBlock];  // node, or ~light
    // Bit masks of slots: weighed by their rows; with a cone; with a cone that is wider than a direction; of several lights.
    uint32_t exact, directed, wide, clusters;
  };
  struct Node {
    int32_t block, blocks;        // first block, and number of blocks
    int32_t parent, parent_slot;  // -1: root
  };
  // Position of a light in the tree: slots are counted from the first of its node, block by block.
  struct Place {
    int32_t node, slot;
  };

  std::vector<Node> nodes;
  std::vector<Block> blocks;
  std::vector<Place> places;  // by light, in the tree of all lights, whose root is node 0
  float scale = 1;            // intensities are relative to the largest; light_weight is multiplied by this

  bool empty() const { return nodes.empty(); }
};

// Bounds of one light for the tree; its fields are those of a slot.
struct LightBounds {
  float low[3], high[3], center[3];
  float intensity, least2;
  float axis[3];
  float cos_end = -2, floor = 1, radius = 0;
  bool exact = false, far = false;
  bool directed() const { return cos_end > -1.5f; }
};

// Adds a tree over the lights `numbers`, whose bounds are at the same index of `bounds`, with intensities of at most 1; returns
// its root. `places` receives their positions, in the order of `numbers`.
int32_t add_light_tree(LightTree& tree, const std::vector<LightBounds>& bounds, const std::vector<int32_t>& numbers,
                       std::vector<LightTree::Place>& places);

}  // namespace primray
