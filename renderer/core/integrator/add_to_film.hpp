// Output of a block's samples: removes the light that the image leaves out, and adds the rest to the film as exact sums, so
// that the order in which blocks finish does not matter.
#pragma once

#include <algorithm>
#include <cmath>

#include "film/exact_sum.hpp"
#include "integrator/tile_task.hpp"

namespace primray {

// Light that the image leaves out at the user's request: caustics, and what the clamp on indirect light takes. The film sums
// both (film/film.hpp), so that the bias of an image is known.

// Splits the sums of samples [0, slots) into the part that the image keeps and caustics, which are summed in `w.caustics`. Sums
// are rebuilt from the classes of light paths: subtracting a bright caustic would leave rounding errors.
inline void leave_out_caustics(Worker& w, int slots, bool clamps) {
  LpeStore& lpe = *w.lpe;
  const int classes = int(lpe.tables.members.size());
  float* const colors[] = {w.r, w.g, w.b};
  for (int c = 0; c < 3; ++c) {
    float* const out = w.caustics.data() + size_t(c) * Worker::kSlots;
    std::fill_n(out, slots, 0.0f);
    for (int first = 0; first <= (clamps ? Worker::kSlots : 0); first += Worker::kSlots) {
      float* const sum = colors[c] + first;
      std::fill_n(sum, slots, 0.0f);
      for (int k = 0; k < classes; ++k) {
        float* const into = lpe.tables.is_left_out(k) ? out : sum;
        for (int s = 0; s < slots; ++s) {
          float& part = lpe.at(k, c, first + s);
          into[s] += part;
          if (into == out) part = 0;
        }
      }
    }
    // A sample whose caustics are not finite stays invalid, as it would have been with them.
    for (int s = 0; s < slots; ++s)
      if (!std::isfinite(out[s])) colors[c][s] = out[s];
  }
}

// Adds the indirect light (two scattering events and more) to samples [0, slots), scaled so that its largest channel is at most
// `most`; light path expressions are scaled alike. The part that was removed remains in the sums of indirect light.
inline void clamp_indirect(Worker& w, int slots, float most) {
  float* const colors[] = {w.r, w.g, w.b};
  for (int s = 0; s < slots; ++s) {
    const int indirect = Worker::kSlots + s;
    const float largest = std::max({std::abs(w.r[indirect]), std::abs(w.g[indirect]), std::abs(w.b[indirect])});
    if (largest == 0) continue;
    const float factor = largest > most ? most / largest : 1.0f;
    for (float* const color : colors) {
      const float clamped = color[indirect] * factor;
      color[s] += clamped, color[indirect] -= clamped;
    }
    if (!w.lpe) continue;
    for (int k = 0; k < int(w.lpe->tables.members.size()); ++k)
      for (int c = 0; c < 3; ++c) w.lpe->at(k, c, s) += w.lpe->at(k, c, indirect) * factor;
  }
}

// Compacts the finite ones of samples [slot, slot + count) to the front and returns how many there are.
inline int drop_invalid(Worker& w, int slot, int count, const Film& film) {
  int valid = slot;
  for (int s = slot; s < slot + count; ++s) {
    if (!std::isfinite(w.r[s]) || !std::isfinite(w.g[s]) || !std::isfinite(w.b[s])) continue;
    w.r[valid] = w.r[s], w.g[valid] = w.g[s], w.b[valid] = w.b[s], w.a[valid] = w.a[s];
    if (film.removed[kClamped].any())
      for (float* const color : {w.r, w.g, w.b}) color[Worker::kSlots + valid] = color[Worker::kSlots + s];
    if (film.removed[kCaustics].any())
      for (size_t c = 0; c < 3; ++c)
        w.caustics[c * Worker::kSlots + size_t(valid)] = w.caustics[c * Worker::kSlots + size_t(s)];
    ++valid;
  }
  return valid - slot;
}

// Adds the contributions of samples [slot, slot + count) of pixel `p` to the light path expressions that they match. Each
// sample is held as an integer by the exact sums; its classes take their parts of that integer, and the largest class takes
// what rounding leaves, so that the parts add up to the sample.
inline void add_lpe_light(LpeStore& lpe, const Worker& w, int slot, int count, size_t p, Film& film) {
  const int classes = int(lpe.tables.members.size());
  struct Parts {
    int64_t high, low;
  };
  Parts of_class[256];  // as many as are used are set
  std::array<ExactSum, LpeAutomaton::kMostExpressions> terms;
  const float* const colors[] = {w.r, w.g, w.b};
  const auto is_valid = [&](int s) { return std::isfinite(w.r[s]) && std::isfinite(w.g[s]) && std::isfinite(w.b[s]); };
  for (int c = 0; c < Film::kColors; ++c) {
    uint32_t largest = 0;
    for (int s = slot; s < slot + count; ++s)
      if (is_valid(s)) largest = std::max(largest, std::bit_cast<uint32_t>(colors[c][s]) & 0x7fffffffu);
    const int bin = bin_of(std::bit_cast<float>(largest));
    const double scale = unit_of(1 - bin);
    for (int k = 0; k < classes; ++k) of_class[k] = {0, 0};
    for (int s = slot; s < slot + count; ++s) {
      if (!is_valid(s)) continue;
      ExactSum left{0, 0, bin};
      add_cut(colors[c][s], scale, left.high, left.low);
      int most = 0;
      float most_light = -1;
      for (int k = 0; k < classes; ++k) {
        const float part = lpe.at(k, c, s);
        if (part == 0 || !std::isfinite(part)) continue;
        ExactSum cut{0, 0, bin};
        add_cut(part, scale, cut.high, cut.low);
        of_class[k].high += cut.high, of_class[k].low += cut.low;
        left.high -= cut.high, left.low -= cut.low;
        if (part > most_light) most = k, most_light = part;
      }
      of_class[most].high += left.high, of_class[most].low += left.low;
    }
    for (int e = 0; e < film.expressions; ++e) terms[size_t(e)] = {0, 0, bin};
    for (int k = 0; k < classes; ++k)
      for (uint32_t members = lpe.tables.members[size_t(k)]; members; members &= members - 1) {
        ExactSum& term = terms[size_t(std::countr_zero(members))];
        term.high += of_class[k].high, term.low += of_class[k].low;
      }
    film.add_lpe_sums(p, c, terms.data());
  }
}

// Adds the layers of samples [slot, slot + count) to the deep picture.
PRIMRAY_RARE void add_layers(Worker& w, int slot, int count, size_t pixel, Film& film) {
  for (int s = slot; s < slot + count; ++s) {
    if (!std::isfinite(w.r[s]) || !std::isfinite(w.g[s]) || !std::isfinite(w.b[s])) continue;
    w.deep->add_to(*film.deep, pixel, s, {w.r[s], w.g[s], w.b[s]}, finished_coverage(w.a[s]), Film::kCovered);
  }
}

// Adds the light of samples [slot, slot + count) of pixel `p` that the image leaves out.
inline void add_removed(PixelSums& removed, size_t p, const float* const (&colors)[3], int slot, int count) {
  for (size_t c = 0; c < 3; ++c) removed.add(p * Film::kColors + c, exact_sum(colors[c] + slot, count));
}

// Adds the samples of the block's `pixels` (`samples` per pixel, both replicates together) and its ray counts to the film, and
// resets the counts.
inline void add_to_film(const TileBlock& block, Worker& w, int pixels, int samples, Film& film) {
  const int tile = block.film_y / kTile * film.tiles_x + block.film_x / kTile;
  const std::lock_guard lock(film.lock_of(tile));
  const float* const clamped[] = {w.r + Worker::kSlots, w.g + Worker::kSlots, w.b + Worker::kSlots};
  const float* const left_out = w.caustics.data();
  const float* const caustics[] = {left_out, left_out + Worker::kSlots, left_out + 2 * Worker::kSlots};
  int64_t invalid = 0;
  for (int i = 0; i < pixels; ++i) {
    int slot = i * samples;
    for (int replicate = 0; replicate < kReplicates; slot += block.count[replicate++]) {
      const size_t p = film.at(replicate, block.film_x + w.pixel_x[i], block.film_y + w.pixel_y[i]);
      if (film.deep) add_layers(w, slot, block.count[replicate], p % film.pixels(), film);
      if (film.expressions > 0) add_lpe_light(*w.lpe, w, slot, block.count[replicate], p, film);
      const int taken = block.count[replicate], valid = drop_invalid(w, slot, taken, film);
      if (valid > 0) {
        film.add(p, 0, exact_sum(w.r + slot, valid)), film.add(p, 1, exact_sum(w.g + slot, valid));
        film.add(p, 2, exact_sum(w.b + slot, valid));
      }
      if (film.removed[kClamped].any() && valid > 0) add_removed(film.removed[kClamped], p, clamped, slot, valid);
      if (film.removed[kCaustics].any() && valid > 0) add_removed(film.removed[kCaustics], p, caustics, slot, valid);
      film.counts[p] += uint32_t(valid);
      for (int s = slot; s < slot + valid; ++s) film.covered[p] += int64_t(finished_coverage(w.a[s]) * float(Film::kCovered));
      invalid += taken - valid;
    }
  }
  for (int r = 0; r < kReplicates; ++r) film.next[size_t(r) * film.tiles() + tile] += uint32_t(block.count[r]);
  film.tile_rays[tile] += w.camera_rays + w.scattered_rays + w.shadow_rays;
  film.invalid_samples += invalid;
  film.samples += int64_t(pixels) * samples;
  film.camera_rays += w.camera_rays, film.scattered_rays += w.scattered_rays, film.shadow_rays += w.shadow_rays;
  w.camera_rays = w.scattered_rays = w.shadow_rays = 0;
  if (!w.unseen_walks.empty()) film.note_unseen(w.unseen_walks), w.unseen_walks.clear();
}

}  // namespace primray
