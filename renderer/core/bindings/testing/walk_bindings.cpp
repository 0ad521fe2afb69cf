// Test bindings with array versions of the guide of random walks.
#include "bindings/testing/rows.hpp"
#include "math/vec3.hpp"
#include "medium/walk_guide.hpp"

namespace primray {
namespace {

// Walk along `d` at a vertex that lies `middle` before the middle of a body with normal +z.
template <int W>
struct Walk {
  Medium<W> medium;
  WalkGuide<W> guide;
  vvec3<W> beta, d;

  explicit Walk(const Input<float>& row) {
    const auto w = [&](int k) { return row.at(0, k); };
    const auto color = [&](int k) -> vvec3<W> { return {vfloat<W>(w(k)), vfloat<W>(w(k + 1)), vfloat<W>(w(k + 2))}; };
    medium.extinction = color(0), medium.scattering = medium.extinction * color(3), medium.phase = vfloat<W>(w(6));
    beta = color(7);
    const float sine = std::sqrt(1 - w(10) * w(10));
    d = {vfloat<W>(sine), vfloat<W>(0.0f), vfloat<W>(w(10))};
    guide = WalkGuide<W>::entering(medium, {vfloat<W>(0.0f), vfloat<W>(0.0f), vfloat<W>(1.0f)});
  }
};

}  // namespace

void bind_walks(nb::module_& m) {
  m.def(
      "walk_directions",
      [](InFloats u_, InFloats walk, float middle, int lanes) {
        const size_t n = u_.shape(0);
        const Input<float> u(u_, n, 2), row(walk, 1, 11);
        Column<float> r(n, 5);
        for_rows(n, lanes, [&]<int W>(size_t at) {
          Walk<W> w(row);
          w.guide.middle = vfloat<W>(middle);
          const auto s = sample_walk_direction(w.guide, w.medium, w.beta, w.d, u.number<W>(at, 0), u.number<W>(at, 1));
          r.put(at, s.d), r.put(at, s.phase_pdf, 3), r.put(at, s.weight, 4);
        });
        return r.array();
      },
      nb::arg("u"), nb::arg("walk"), nb::arg("middle"), nb::arg("lanes") = 0,
      "`walk`: extinction, albedo (3 each), mean cosine, throughput (3), cosine of the direction with the normal. Returns\n"
      "directions, their densities by the phase function, and weights.");
  m.def(
      "walk_distances",
      [](InFloats u_, InFloats walk, float middle, float end, int lanes) {
        const size_t n = u_.shape(0);
        const Input<float> u(u_, n, 2), row(walk, 1, 11);
        Column<float> r(n, 5);
        for_rows(n, lanes, [&]<int W>(size_t at) {
          Walk<W> w(row);
          w.guide.middle = vfloat<W>(middle);
          w.guide.phase_pdf = vfloat<W>(kInvFourPi);
          const WalkDistance<W> distance(w.guide, w.medium, w.beta, w.d);
          const vfloat<W> t = distance.draw(u.number<W>(at, 0), u.number<W>(at, 1));
          const DistanceSample<W> s = distance.at(t, vfloat<W>(end), w.medium.scattering, w.beta);
          r.put(at, s.t), r.put(at, s.beta.x, 1), r.put(at, s.beta.y, 2), r.put(at, s.beta.z, 3);
          r.put(at, select(s.scatters, vfloat<W>(1.0f), 0.0f), 4);
        });
        return r.array();
      },
      nb::arg("u"), nb::arg("walk"), nb::arg("middle"), nb::arg("end"), nb::arg("lanes") = 0,
      "Distances up to `end`, throughputs after them, and whether the path collides there.");
}

}  // namespace primray
