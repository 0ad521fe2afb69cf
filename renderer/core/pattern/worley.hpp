// Worley noise: distances to the nearest of feature points, one in each cell, or the cell value of the nearest.
#pragma once

#include "pattern/noise.hpp"

namespace primray::pattern {

// Nearest feature points in the surrounding cells.
template <int N, int W>
struct Nearest {
  vfloat<W> square[3];  // squared distances, the least first
  vfloat<W> offset[N];  // from here to the nearest
};

template <int N, int W>
PRIMRAY_INLINE Nearest<N, W> nearest_points(const vfloat<W>* p, vfloat<W> jitter) {
  using F = vfloat<W>;
  Cell<N, W> home;
  F local[N];
  for (int k = 0; k < N; ++k) home.at[k] = floor_to_int(p[k]), local[k] = p[k] - to_float(home.at[k]);
  Nearest<N, W> r;
  for (F& s : r.square) s = F(1e6f);
  for (F& o : r.offset) o = F(0.0f);
  constexpr int kCells = N == 2 ? 9 : 27;
  for (int i = 0; i < kCells; ++i) {
    // The last coordinate varies fastest: of equally near points the first is kept.
    const int step[3] = {N == 2 ? i / 3 - 1 : i / 9 - 1, N == 2 ? i % 3 - 1 : i / 3 % 3 - 1, i % 3 - 1};
    Cell<N, W> cell;
    for (int k = 0; k < N; ++k) cell.at[k] = home.at[k] + vint<W>(step[k]);
    F to[N], square(0.0f);
    for (int k = 0; k < N; ++k) {
      to[k] = (fraction(cell.hash(uint32_t(k))) - 0.5f) * jitter + 0.5f + float(step[k]) - local[k];
      square += to[k] * to[k];
    }
    const vbool<W> first = square < r.square[0], second = square < r.square[1], third = square < r.square[2];
    r.square[2] = select(second, r.square[1], select(third, square, r.square[2]));
    r.square[1] = select(first, r.square[0], select(second, square, r.square[1]));
    r.square[0] = select(first, square, r.square[0]);
    for (int k = 0; k < N; ++k) r.offset[k] = select(first, to[k], r.offset[k]);
  }
  return r;
}

template <int N, int W>
PRIMRAY_INLINE void worley_distances(const vfloat<W>* p, vfloat<W> jitter, int count, vfloat<W>* out) {
  const Nearest<N, W> found = nearest_points<N>(p, jitter);
  for (int i = 0; i < count; ++i) out[i] = sqrt(found.square[i]);
}

// One, two or three numbers in [0, 1] for the cell of the nearest feature point.
template <int N, int W>
PRIMRAY_INLINE void worley_cells(const vfloat<W>* p, vfloat<W> jitter, int count, vfloat<W>* out) {
  const Nearest<N, W> found = nearest_points<N>(p, jitter);
  Cell<N, W> cell;
  for (int k = 0; k < N; ++k) cell.at[k] = floor_to_int(p[k] + found.offset[k]);
  for (int i = 0; i < count; ++i) out[i] = fraction(count == 1 ? cell.hash() : cell.hash(uint32_t(i)));
}

}  // namespace primray::pattern
