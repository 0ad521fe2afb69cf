// Light that the image leaves out at the user's request: caustics, and what the clamp on indirect light takes. The film sums
// both (film/film.hpp), so that the bias of an image is known.
#pragma once

#include <algorithm>
#include <cmath>

#include "path/tile_task.hpp"

namespace primray {

// Splits the sums of samples [0, slots) into the part that the image keeps and caustics, which are summed in `w.caustics`. Sums
// are rebuilt from the classes of light paths: subtracting a bright caustic would leave rounding errors.
inline void leave_out_caustics(Worker& w, int slots, bool clamps) {
  RouteStore& routes = *w.routes;
  const int classes = int(routes.tables.members.size());
  float* const colors[] = {w.r, w.g, w.b};
  for (int c = 0; c < 3; ++c) {
    float* const out = w.caustics.data() + size_t(c) * Worker::kSlots;
    std::fill_n(out, slots, 0.0f);
    for (int first = 0; first <= (clamps ? Worker::kSlots : 0); first += Worker::kSlots) {
      float* const sum = colors[c] + first;
      std::fill_n(sum, slots, 0.0f);
      for (int k = 0; k < classes; ++k) {
        float* const part = routes.column(k, c) + first;
        float* const into = routes.tables.is_left_out(k) ? out : sum;
        for (int s = 0; s < slots; ++s) into[s] += part[s];
        if (into == out) std::fill_n(part, slots, 0.0f);
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
      const float kept = color[indirect] * factor;
      color[s] += kept, color[indirect] -= kept;
    }
    if (!w.routes) continue;
    for (int k = 0; k < int(w.routes->tables.members.size()); ++k)
      for (int c = 0; c < 3; ++c) {
        float* const part = w.routes->column(k, c);
        part[s] += part[indirect] * factor;
      }
  }
}

}  // namespace primray
