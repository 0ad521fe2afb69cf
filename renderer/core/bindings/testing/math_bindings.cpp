// Test bindings with array versions of functions of math/ and of lobes.
#include "bindings/testing/rows.hpp"
#include "bsdf/bsdf.hpp"
#include "light/light.hpp"
#include "math/ellipsoid.hpp"
#include "math/matrix.hpp"
#include "math/transcendental.hpp"
#include "motion/clock.hpp"

namespace primray {
namespace {

template <class F>
nb::object map_pairs(const InFloats& xy_, int width, int lanes, F f) {
  const size_t n = xy_.shape(0);
  const Input<float> xy(xy_, n, 2);
  Column<float> r(n, width);
  for_rows(n, lanes, [&]<int W>(size_t at) { f(r, at, xy.number<W>(at, 0), xy.number<W>(at, 1)); });
  return r.array();
}

}  // namespace

void bind_math(nb::module_& m) {
  m.def(
      "sincos_turns",
      [](InFloats u, int lanes) {
        return map_pairs(u, 2, lanes, []<int W>(Column<float>& r, size_t at, vfloat<W> x, vfloat<W>) {
          const SinCos<W> a = sincos_turns(x);
          r.put(at, a.sin, 0), r.put(at, a.cos, 1);
        });
      },
      nb::arg("u"), nb::arg("lanes") = 0, "Function of the first of each two numbers.");
  m.def(
      "acos",
      [](InFloats u, int lanes) {
        return map_pairs(u, 1, lanes, []<int W>(Column<float>& r, size_t at, vfloat<W> x, vfloat<W>) { r.put(at, acos(x)); });
      },
      nb::arg("x"), nb::arg("lanes") = 0, "Function of the first of each two numbers.");
  m.def(
      "atan2",
      [](InFloats yx, int lanes) {
        return map_pairs(yx, 1, lanes,
                         []<int W>(Column<float>& r, size_t at, vfloat<W> y, vfloat<W> x) { r.put(at, atan2(y, x)); });
      },
      nb::arg("yx"), nb::arg("lanes") = 0);
  m.def(
      "exp2",
      [](InFloats u, int lanes) {
        return map_pairs(u, 1, lanes, []<int W>(Column<float>& r, size_t at, vfloat<W> x, vfloat<W>) { r.put(at, exp2(x)); });
      },
      nb::arg("x"), nb::arg("lanes") = 0, "Function of the first of each two numbers.");
  m.def(
      "log2_cosine",
      [](InFloats cs, int lanes) {
        return map_pairs(cs, 1, lanes, []<int W>(Column<float>& r, size_t at, vfloat<W> c, vfloat<W> s) {
          r.put(at, log2_cosine(c, s * s));
        });
      },
      nb::arg("cosine_and_sine"), nb::arg("lanes") = 0);
  m.def(
      "concentric_disk",
      [](InFloats u, int lanes) {
        return map_pairs(u, 2, lanes, []<int W>(Column<float>& r, size_t at, vfloat<W> a, vfloat<W> b) {
          vfloat<W> x, y;
          concentric_disk(a, b, x, y);
          r.put(at, x, 0), r.put(at, y, 1);
        });
      },
      nb::arg("u"), nb::arg("lanes") = 0);
  m.def(
      "reflection_normals",
      [](nb::handle wo, float alpha, InFloats u, int lanes) {
        const vec3 w{nb::cast<float>(wo[0]), nb::cast<float>(wo[1]), nb::cast<float>(wo[2])};
        return map_pairs(u, 3, lanes, [&]<int W>(Column<float>& r, size_t at, vfloat<W> a, vfloat<W> b) {
          const vvec3<W> o(vfloat<W>(w.x), vfloat<W>(w.y), vfloat<W>(w.z));
          r.put(at, ggx_sample_normal(o, vfloat<W>(alpha), a, b));
        });
      },
      nb::arg("wo"), nb::arg("alpha"), nb::arg("u"), nb::arg("lanes") = 0);
  m.def("is_even_clock", [](InFloats times) { return clock_of_times({times.data(), times.size()}).uniform; });
  m.def(
      "filter_offsets",
      [](const Scene& scene, InFloats u, int lanes) {
        return map_pairs(u, 2, lanes, [&]<int W>(Column<float>& r, size_t at, vfloat<W> a, vfloat<W> b) {
          r.put(at, scene.camera.filter.sample<W>(a), 0), r.put(at, scene.camera.filter.sample<W>(b), 1);
        });
      },
      nb::arg("scene"), nb::arg("u"), nb::arg("lanes") = 0);
}

}  // namespace primray
