// A tree over the lights, for scenes with too many of them to weigh each: Conty Estevez and Kulla 2018, "Importance Sampling of
// Many Lights with Adaptive Tree Splitting". Here its data; choices are made in tree_choice.hpp.
//
// A node holds up to kMostSlots lights and clusters of lights, or up to kLastSlots lights alone, in blocks of kBlock that are
// weighed side by side: a path goes down alone, and the lanes of a vector are the slots of a node. Wide nodes need few steps,
// and compare many small clusters where a binary tree would compare two big ones. Slots are weighed from numbers in the block
// alone, but for lights that only their own row can weigh well (`exact`).
#pragma once

#include <cstdint>
#include <vector>

namespace primray {

struct LightTree {
  static constexpr int kBlock = 16, kMostSlots = 2 * kBlock, kLastSlots = 4 * kBlock;

  struct alignas(64) Block {
    // About where: the mean of the lights, weighted by what they give, or the unit direction to a light that is infinitely far
    // (`near` 0 in place of 1); all lie within `half` of it.
    float center[3][kBlock], half[3][kBlock], near[kBlock];
    float intensity[kBlock];  // irradiance times distance^2; 0: no light
    float least2[kBlock];     // squares of distances are taken as no shorter
    // The cone of directions into which the lights look (`axis`, with angles up to that of cos_axis), and how far off theirs
    // they emit at all (cos_end; -2: all around). What is weighed falls with the cosine, to `floor` at least. `radius` of a
    // ball about the centre that holds them; 0 where the angle off the axis is the same for all of a light.
    float axis[3][kBlock], cos_axis[kBlock], sin_axis[kBlock], cos_end[kBlock], floor[kBlock], radius[kBlock];
    int32_t child[kBlock];  // a node, or ~light
    // Bits of slots: weighed by their rows; with a cone; with one that is wider than a direction; of several lights.
    uint32_t exact, directed, wide, clusters;
  };
  struct Node {
    int32_t block, blocks;        // first one, and how many
    int32_t parent, parent_slot;  // -1: root
  };
  // Where a light stands: slots are counted from the first of its node, block by block.
  struct Place {
    int32_t node, slot;
  };

  std::vector<Node> nodes;
  std::vector<Block> blocks;
  std::vector<Place> places;  // by light, in the tree of all lights, whose root is node 0
  float scale = 1;            // intensities are multiples of the largest one; light_weight is times this

  bool empty() const { return nodes.empty(); }
};

// One light, as the tree sees it; the fields are a slot's.
struct LightBounds {
  float low[3], high[3], center[3];
  float intensity, least2;
  float axis[3];
  float cos_end = -2, floor = 1, radius = 0;
  bool exact = false, far = false;
  bool directed() const { return cos_end > -1.5f; }
};

// Adds a tree over the lights `numbers`, whose bounds are at those places of `bounds`, with intensities of 1 at most; the root.
// `places` takes where they stand, in the order of `numbers`.
int32_t add_light_tree(LightTree& tree, const std::vector<LightBounds>& bounds, const std::vector<int32_t>& numbers,
                       std::vector<LightTree::Place>& places);

}  // namespace primray
