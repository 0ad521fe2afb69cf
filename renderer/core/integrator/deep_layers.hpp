// Layers of samples, for deep pictures (film/deep_film.hpp): which part of each sample's light and coverage belongs to which
// depth.
//
// A path belongs to the first event at which it does not continue straight: a surface, or a collision in a volume. Its slot
// (PathPool::slot) carries that event's cell, so that all light that the path finds later, and its shadow rays, is added there.
// What passes straight through a surface takes its share of the coverage along, to the event behind.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "film/deep_film.hpp"
#include "math/lanes.hpp"

namespace primray {

// Bits of a slot: the index of a sum (tile_task.hpp); whether the path has scattered, so that its event is final; its key.
constexpr int32_t kSumMask = (1 << 14) - 1, kSettled = 1 << 14;
constexpr int kKeyShift = 15;
static_assert(int64_t(kFarKey + 1) << kKeyShift <= int64_t(1) << 31);

inline int32_t key_of(int32_t slot) { return slot >> kKeyShift; }
inline int32_t with_key(int32_t slot, int32_t key) { return (slot & ((1 << kKeyShift) - 1)) | key << kKeyShift; }

class DeepLayers {
 public:
  struct Layer {
    int32_t key;
    float nearest, farthest;
    float color[3], alpha;
    int next;  // of the same sample; -1: none
  };
  const DepthCells cells;

  DeepLayers(const DeepFilm& film, int slots) : cells(film.cells), first_(size_t(slots), -1) {}

  void clear(int slots) {
    std::fill_n(first_.begin(), slots, -1);
    layers_.clear();
  }
  // Adds light to the layer that `slot` names, if any.
  PRIMRAY_RARE void add_light(int32_t slot, float r, float g, float b) {
    if (key_of(slot) == 0) return;
    Layer& layer = at(slot, kFarDepth);
    layer.color[0] += r, layer.color[1] += g, layer.color[2] += b;
  }
  PRIMRAY_RARE void cover(int32_t slot, float alpha) {
    if (key_of(slot) != 0) at(slot, kFarDepth).alpha += alpha;
  }
  // Returns `slot` with the key of an event at `depth`, which takes the part `alpha` of the coverage from the event before; of
  // a path's first event, all.
  PRIMRAY_RARE int32_t placed(int32_t slot, float depth, bool in_volume, float alpha) {
    return moved(slot, cells.key(depth, in_volume), depth, alpha);
  }
  // Returns `slot` with the key of what is behind everything.
  PRIMRAY_RARE int32_t placed_far(int32_t slot, float alpha) { return moved(slot, kFarKey, kFarDepth, alpha); }
  // Returns `slot` with the key of light at `depth` that covers nothing.
  PRIMRAY_RARE int32_t lit(int32_t slot, float depth, bool in_volume) {
    const int32_t to = with_key(slot, cells.key(depth, in_volume));
    at(to, depth);
    return to;
  }

  // Adds the layers of sample `slot` to a pixel: the parts of its light and its coverage. What was taken from the sample's
  // light after it was gathered (the lens's weight, clamped light, caustics) is taken from all layers in proportion.
  PRIMRAY_RARE void add_to(DeepFilm& film, size_t pixel, int slot, const float (&light)[3], float alpha, int64_t full) {
    int fullest = first_[size_t(slot)];
    if (fullest < 0) return;
    float sums[4] = {};
    for (int i = first_[size_t(slot)]; i >= 0; i = layers_[size_t(i)].next) {
      const Layer& layer = layers_[size_t(i)];
      for (int c = 0; c < 3; ++c) sums[c] += layer.color[c];
      sums[3] += layer.alpha;
      if (layer.alpha > layers_[size_t(fullest)].alpha) fullest = i;
    }
    for (int i = first_[size_t(slot)]; i >= 0; i = layers_[size_t(i)].next) {
      Layer& layer = layers_[size_t(i)];
      if (i == fullest) layer.alpha += alpha - sums[3];
      DeepSum term;
      term.key = layer.key, term.nearest = layer.nearest, term.farthest = layer.farthest;
      bool is_empty = layer.alpha == 0;
      for (int c = 0; c < 3; ++c) {
        float own = layer.color[c];
        if (sums[c] != light[c]) own = sums[c] != 0 && std::isfinite(sums[c]) ? own * (light[c] / sums[c]) : 0.0f;
        if (i == fullest && sums[c] == 0) own = light[c];
        if (!std::isfinite(own)) own = 0;
        is_empty &= own == 0;
        term.add_color(c, exact_sum(&own, 1));
      }
      if (is_empty) continue;
      term.covered = int64_t(layer.alpha * float(full));
      film.add(pixel, term);
    }
  }

 private:
  std::vector<int> first_;  // by slot
  std::vector<Layer> layers_;

  // Returns a sample's layer, new ones at `depth`.
  Layer& at(int32_t slot, float depth) {
    const int32_t key = key_of(slot);
    int* link = &first_[size_t(slot & (kSumMask >> 1))];
    while (*link >= 0) {
      Layer& layer = layers_[size_t(*link)];
      if (layer.key == key) {
        if (depth < kFarDepth) layer.nearest = std::min(layer.nearest, depth), layer.farthest = std::max(layer.farthest, depth);
        return layer;
      }
      link = &layer.next;
    }
    *link = int(layers_.size());
    return layers_.emplace_back(Layer{key, depth, depth, {0, 0, 0}, 0, -1});
  }
  int32_t moved(int32_t slot, int32_t key, float depth, float alpha) {
    if (key_of(slot) != 0) at(slot, kFarDepth).alpha -= alpha;
    const int32_t to = with_key(slot, key);
    at(to, depth).alpha += key_of(slot) != 0 ? alpha : key == kFarKey ? 0.0f : 1.0f;
    return to;
  }
};

}  // namespace primray
