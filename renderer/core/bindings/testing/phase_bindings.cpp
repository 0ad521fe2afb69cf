// Test bindings with array versions of phase functions.
#include "bindings/testing/rows.hpp"
#include "medium/phase_function.hpp"

namespace primray {
namespace {

// Results of f for numbers (N, 2), whose columns are its arguments.
template <class F>
nb::object map_rows(const InFloats& numbers_, int width, int lanes, F f) {
  const size_t n = numbers_.shape(0);
  const Input<float> numbers(numbers_, n, 2);
  Column<float> r(n, width);
  for_rows(n, lanes, [&]<int W>(size_t at) { f(r, at, numbers.number<W>(at, 0), numbers.number<W>(at, 1)); });
  return r.array();
}

}  // namespace

void bind_phases(nb::module_& m) {
  m.def(
      "phase_density",
      [](InFloats cosines, int lanes) {
        return map_rows(cosines, 1, lanes, []<int W>(Column<float>& r, size_t at, vfloat<W> cosine, vfloat<W> phase) {
          r.put(at, phase_density(cosine, phase));
        });
      },
      nb::arg("cosine_and_phase"), nb::arg("lanes") = 0);
  m.def(
      "sample_phase",
      [](InFloats u, float phase, int lanes) {
        return map_rows(u, 3, lanes, [&]<int W>(Column<float>& r, size_t at, vfloat<W> a, vfloat<W> b) {
          r.put(at, sample_phase(vfloat<W>(phase), a, b));
        });
      },
      nb::arg("u"), nb::arg("phase"), nb::arg("lanes") = 0);
  m.def(
      "sample_phases",
      [](InFloats u, int lanes) {
        return map_rows(u, 3, lanes, []<int W>(Column<float>& r, size_t at, vfloat<W> a, vfloat<W> phase) {
          r.put(at, sample_phase(phase, a, vfloat<W>(0.0f)));
        });
      },
      nb::arg("u_and_phase"), nb::arg("lanes") = 0);
  m.def(
      "mean_cosine",
      [](InFloats phases, int lanes) {
        return map_rows(phases, 1, lanes,
                        []<int W>(Column<float>& r, size_t at, vfloat<W> phase, vfloat<W>) { r.put(at, mean_cosine(phase)); });
      },
      nb::arg("phase"), nb::arg("lanes") = 0, "Function of the first of each two numbers.");
  m.def(
      "droplet_lobes",
      [](InFloats phases, int lanes) {
        return map_rows(phases, 4, lanes, []<int W>(Column<float>& r, size_t at, vfloat<W> phase, vfloat<W>) {
          const DropletLobes<W> lobes = DropletLobes<W>::of(phase);
          r.put(at, lobes.g, 0), r.put(at, lobes.draine.g, 1), r.put(at, lobes.draine.alpha, 2), r.put(at, lobes.weight, 3);
        });
      },
      nb::arg("phase"), nb::arg("lanes") = 0, "Function of the first of each two numbers: both g, alpha and the weight.");
  m.def(
      "draine_density",
      [](InFloats cosines, float g, float alpha, int lanes) {
        return map_rows(cosines, 1, lanes, [&]<int W>(Column<float>& r, size_t at, vfloat<W> cosine, vfloat<W>) {
          r.put(at, Draine<W>{vfloat<W>(g), vfloat<W>(alpha)}.density(cosine));
        });
      },
      nb::arg("cosine"), nb::arg("g"), nb::arg("alpha"), nb::arg("lanes") = 0, "Function of the first of each two numbers.");
  m.def(
      "sample_draine",
      [](InFloats u, float g, float alpha, int lanes) {
        return map_rows(u, 1, lanes, [&]<int W>(Column<float>& r, size_t at, vfloat<W> a, vfloat<W>) {
          r.put(at, Draine<W>{vfloat<W>(g), vfloat<W>(alpha)}.sample(a));
        });
      },
      nb::arg("u"), nb::arg("g"), nb::arg("alpha"), nb::arg("lanes") = 0,
      "Function of the first of each two numbers: a cosine.");
}

}  // namespace primray
