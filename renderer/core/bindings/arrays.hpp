// What all bindings share: numpy arrays as checked arguments and as results, and the function that binds each part of the
// module.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <span>
#include <vector>

#include "base/error.hpp"
#include "math/matrix.hpp"

namespace primray {

namespace nb = nanobind;

template <class T>
using InArray = nb::ndarray<const T, nb::c_contig, nb::device::cpu>;

template <class T>
std::span<const T> span_of(const InArray<T>& a) {
  return {a.data(), a.size()};
}

// Converts a (4, 4) or (3, 4) float64 matrix in column-vector convention.
inline daffine affine_of(const InArray<double>& m) {
  if (m.ndim() != 2 || m.shape(0) < 3 || m.shape(1) != 4) throw Error("internal", "a matrix must have shape (4, 4) or (3, 4)");
  return affine_from_rows(m.data());
}

// A numpy array of N dimensions as a result.
template <class T, size_t N>
using OutArray = nb::ndarray<nb::numpy, T, nb::ndim<N>>;

// Returns a new numpy array that owns `data`.
template <class T, size_t N>
OutArray<T, N> to_numpy(std::vector<T> data, const size_t (&shape)[N]) {
  auto* owned = new std::vector<T>(std::move(data));
  nb::capsule owner(owned, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
  return OutArray<T, N>(owned->data(), N, shape, owner);
}

// Return value policy of properties whose getter makes a new array, which nothing else owns.
constexpr auto kNewArray = nb::rv_policy::automatic;

struct ImageInput;
class SceneBuilder;

// Returns a view of (H, W, C) floats as an image; without pixels, no image.
ImageInput image_input(const InArray<float>& pixels);

void bind_facts(nb::module_& m);
void bind_settings(nb::module_& m);
void bind_scene(nb::module_& m);
void bind_surface(nb::module_& m);                                    // of the module
void bind_shapes(nb::module_& m, nb::class_<SceneBuilder>& builder);  // of the module and the builder; likewise those below
void bind_light(nb::module_& m, nb::class_<SceneBuilder>& builder);
void bind_volumes(nb::module_& m, nb::class_<SceneBuilder>& builder);
void bind_camera(nb::module_& m, nb::class_<SceneBuilder>& builder);
void bind_film(nb::module_& m);
void bind_render(nb::module_& m);
void bind_first_hit(nb::module_& m);
void bind_subdivision(nb::module_& m);
void bind_polygons(nb::module_& m);
void bind_testing(nb::module_& m);
void bind_caustics(nb::module_& m, nb::module_& testing);
void bind_math(nb::module_& m);         // submodule testing
void bind_phases(nb::module_& m);       // submodule testing
void bind_guide_tests(nb::module_& m);  // submodule testing
void bind_hierarchy(nb::module_& m);    // submodule testing
void bind_replay(nb::module_& m);       // submodule testing
void bind_grids(nb::module_& m);        // submodule testing
void bind_walks(nb::module_& m);        // submodule testing

}  // namespace primray
