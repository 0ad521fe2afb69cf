// Arrays of the test bindings: N rows in, N rows out, W at a time through the kernels' templates.
#pragma once

#include <algorithm>
#include <type_traits>
#include <vector>

#include "base/error.hpp"
#include "base/flush_denormals.hpp"
#include "bindings/arrays.hpp"
#include "scene/scene.hpp"

namespace primray {

// One output: N rows of `width` numbers.
template <class T>
class Column {
 public:
  explicit Column(size_t n, int width = 1) : n_(n), width_(width), data_(n * width) {}

  template <int W>
  void put(size_t first, Vector<T, W> a, int c = 0) {
    for (int i = 0; i < W && first + i < n_; ++i) data_[(first + i) * width_ + c] = a[i];
  }
  template <int W>
  void put(size_t first, const vvec3<W>& a) {
    put(first, a.x, 0), put(first, a.y, 1), put(first, a.z, 2);
  }
  template <int W>
  void put(size_t first, vbool<W> m) {
    put(first, select(m, Vector<T, W>(T(1)), Vector<T, W>(T(0))));
  }
  nb::object array() {
    if (width_ == 1) return nb::cast(to_numpy(std::move(data_), {n_}));
    return nb::cast(to_numpy(std::move(data_), {n_, size_t(width_)}));
  }

 private:
  size_t n_;
  int width_;
  std::vector<T> data_;
};

// Calls f.operator()<W>(first) for rows [first, first + W).
template <class F>
void for_rows(size_t n, int lanes, F&& f) {
  const FlushDenormals as_in_a_render;
  constexpr int kMost = PRIMRAY_MAX_LANES;
  if (lanes == 1) {
    for (size_t i = 0; i < n; ++i) f.template operator()<1>(i);
  } else {
    for (size_t i = 0; i < n; i += kMost) f.template operator()<kMost>(i);
  }
}

// One input of rows of `width` numbers; lanes past the last row read the last.
template <class T>
class Input {
 public:
  Input(const InArray<T>& a, size_t rows, int width) : data_(a.data()), n_(rows), width_(width) {
    if (a.size() != rows * width) throw Error("internal", "an array has the wrong shape");
  }
  T at(size_t row, int c) const { return data_[row * size_t(width_) + size_t(c)]; }
  template <int W>
  Vector<T, W> number(size_t first, int c = 0) const {
    Vector<T, W> r;
    for (int i = 0; i < W; ++i) r.set(i, data_[std::min(first + i, n_ - 1) * width_ + c]);
    return r;
  }
  template <int W>
    requires std::is_same_v<T, float>
  vvec3<W> vector(size_t first) const {
    return {number<W>(first, 0), number<W>(first, 1), number<W>(first, 2)};
  }

 private:
  const T* data_;
  size_t n_;
  int width_;
};

using InFloats = InArray<float>;
using InInts = InArray<int32_t>;

// World points (N, 3) in the core's space.
class CorePoints {
 public:
  CorePoints(const Scene& scene, const InArray<double>& p) : n(p.size() / 3), data_(p.size()) {
    for (size_t i = 0; i < n; ++i) {
      const dvec3 q = (dvec3{p.data()[3 * i], p.data()[3 * i + 1], p.data()[3 * i + 2]} - scene.origin) * scene.scale;
      data_[3 * i] = float(q.x), data_[3 * i + 1] = float(q.y), data_[3 * i + 2] = float(q.z);
    }
  }
  template <int W>
  vvec3<W> vector(size_t first) const {
    vvec3<W> r;
    for (int i = 0; i < W; ++i) {
      const float* p = &data_[3 * std::min(first + i, n - 1)];
      r.x.set(i, p[0]), r.y.set(i, p[1]), r.z.set(i, p[2]);
    }
    return r;
  }
  const size_t n;

 private:
  std::vector<float> data_;
};

}  // namespace primray
