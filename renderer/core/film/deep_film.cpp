// Sums of deep pictures, and the samples that they make.
#include "film/deep_film.hpp"

#include <algorithm>

namespace primray {

namespace {

int32_t key_at(int32_t key, int level) { return key == kFarKey ? kFarKey : ((key >> 1) >> level) << 1 | (key & 1); }

bool is_volume(const DeepSum& sum) { return sum.key & 1; }

// Adds `sum`, whose key is of the same level.
void add_sum(std::vector<DeepSum>& sums, const DeepSum& sum) {
  const auto at =
      std::lower_bound(sums.begin(), sums.end(), sum.key, [](const DeepSum& other, int32_t key) { return other.key < key; });
  if (at != sums.end() && at->key == sum.key)
    at->add(sum);
  else
    sums.insert(at, sum);
}

// Joins cells two by two.
void coarsen(DeepPixel& pixel) {
  ++pixel.level;
  std::vector<DeepSum> joined;
  for (DeepSum sum : pixel.sums) {
    sum.key = key_at(sum.key, 1);
    add_sum(joined, sum);
  }
  pixel.sums.swap(joined);
}

}  // namespace

void DeepFilm::add(size_t p, const DeepSum& term) {
  DeepPixel& pixel = pixels[p];
  DeepSum own = term;
  own.key = key_at(term.key, pixel.level);
  add_sum(pixel.sums, own);
  while (int(pixel.sums.size()) > most && pixel.level < 15) coarsen(pixel);
}

size_t DeepFilm::memory_bytes() const {
  size_t bytes = pixels.size() * sizeof(DeepPixel);
  for (const DeepPixel& pixel : pixels) bytes += pixel.sums.capacity() * sizeof(DeepSum);
  return bytes;
}

namespace {

// Sum on its way to a sample.
struct Layer {
  double z, z_back, color[3];
  int64_t covered;
  bool in_volume;
  int cell;

  void join(const Layer& other) {
    for (int c = 0; c < 3; ++c) color[c] += other.color[c];
    covered += other.covered;
  }
};

bool is_empty(const DeepSum& sum) {
  return sum.covered == 0 && sum.color(0).value() == 0 && sum.color(1).value() == 0 && sum.color(2).value() == 0;
}

std::vector<Layer> layers_of(const DeepPixel& pixel) {
  std::vector<Layer> layers;
  for (const DeepSum& sum : pixel.sums) {
    if (is_empty(sum)) continue;
    Layer layer{sum.nearest, sum.farthest, {}, sum.covered, is_volume(sum), sum.key >> 1};
    for (int c = 0; c < 3; ++c) layer.color[c] = sum.color(c).value();
    layers.push_back(layer);
  }
  return layers;
}

// Lets volumes in neighbouring cells touch: samples came as near to the cells' ends as their number allows.
void close_volumes(const DepthCells& cells, int level, std::vector<Layer>& layers) {
  Layer* before = nullptr;
  for (Layer& layer : layers) {
    if (!layer.in_volume) continue;
    if (before && before->cell + 1 == layer.cell) {
      const double edge = std::clamp(cells.begin(layer.cell << level), before->z_back, std::max(layer.z, before->z_back));
      before->z_back = layer.z = edge;
    }
    before = &layer;
  }
}

// Joins surfaces that are within the tolerance of each other, with no volume between: one surface may cross a cell's end.
void join_surfaces(double tolerance, std::vector<Layer>& layers) {
  std::vector<Layer> joined;
  for (const Layer& layer : layers) {
    Layer* const last = joined.empty() ? nullptr : &joined.back();
    if (last && !last->in_volume && !layer.in_volume && layer.cell != kFarCell && layer.z >= last->z &&
        layer.z_back - last->z <= tolerance * std::abs(last->z)) {
      last->z_back = layer.z_back;
      last->join(layer);
    } else {
      joined.push_back(layer);
    }
  }
  layers.swap(joined);
}

// Orders layers by depth without overlaps: surfaces are at one depth each, and a volume's extent ends, or begins, at a surface
// within it.
void separate(std::vector<Layer>& layers) {
  for (Layer& layer : layers)
    if (!layer.in_volume) layer.z = layer.z_back = 0.5 * (layer.z + layer.z_back);
  for (Layer& volume : layers) {
    if (!volume.in_volume) continue;
    for (const Layer& surface : layers) {
      if (surface.in_volume || !(surface.z > volume.z && surface.z < volume.z_back)) continue;
      (surface.z - volume.z >= volume.z_back - surface.z ? volume.z_back : volume.z) = surface.z;
    }
  }
  std::stable_sort(layers.begin(), layers.end(), [](const Layer& a, const Layer& b) {
    return a.z + a.z_back < b.z + b.z_back || (a.z + a.z_back == b.z + b.z_back && a.z_back < b.z_back);
  });
}

// Joins layers whose coverage is negative with those behind them, or in front of the last: light that passes straight through
// surfaces is chosen at random, and may exceed a sample now and then.
void join_negative(std::vector<Layer>& layers) {
  for (size_t k = 0; k < layers.size() && layers.size() > 1;) {
    if (layers[k].covered >= 0) {
      ++k;
      continue;
    }
    const bool is_last = k + 1 == layers.size();
    layers[is_last ? k - 1 : k + 1].join(layers[k]);
    layers.erase(layers.begin() + std::ptrdiff_t(k));
    if (is_last) --k;
  }
}

}  // namespace

void append_samples(const DeepFilm& film, size_t p, int64_t covered, uint32_t count, int64_t full, double exposure,
                    std::vector<DeepSample>& out) {
  const DeepPixel& pixel = film.pixels[p];
  std::vector<Layer> layers = layers_of(pixel);
  if (layers.empty() || count == 0) return;
  close_volumes(film.cells, pixel.level, layers);
  join_surfaces(film.tolerance, layers);
  separate(layers);

  // Give the layer that covers most what rounding to units left
  int64_t left = covered;
  for (const Layer& layer : layers) left -= layer.covered;
  std::max_element(layers.begin(), layers.end(), [](const Layer& a, const Layer& b) {
    return a.covered < b.covered;
  })->covered += left;
  join_negative(layers);

  // Divide by what is not covered in front
  const int64_t all = int64_t(count) * full;
  int64_t open = all;
  const size_t first = out.size();
  std::vector<Layer> shown;
  for (const Layer& layer : layers) {
    if (open <= 0 && !shown.empty()) {
      shown.back().join(layer);  // hidden: light that rounding, or chance, left behind an opaque layer
      continue;
    }
    shown.push_back(layer);
    open -= layer.covered;
  }
  open = all;
  for (const Layer& layer : shown) {
    const double share = double(open) / double(all);
    DeepSample sample{float(layer.z), float(layer.z_back), {}, 0};
    if (sample.z_back < sample.z) sample.z_back = sample.z;
    for (int c = 0; c < 3; ++c) sample.color[c] = float(layer.color[c] * exposure / double(count) / share);
    sample.alpha = float(std::clamp(double(layer.covered) / double(open), 0.0, 1.0));
    out.push_back(sample);
    open -= layer.covered;
  }
  // Rounding to floats keeps the order of the depths, but not that they differ.
  for (size_t k = first + 1; k < out.size(); ++k) {
    out[k].z = std::max(out[k].z, out[k - 1].z_back);
    out[k].z_back = std::max(out[k].z_back, out[k].z);
  }
}

}  // namespace primray
