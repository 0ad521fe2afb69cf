// Python bindings of the caustic guide, and for the tests its densities and samples at points.
#include "bindings/arrays.hpp"
#include "pilot/learn_caustics.hpp"
#include "render/render.hpp"
#include "scene/scene.hpp"

namespace primray {
namespace {

constexpr int W = 4;

// Returns for each of `p` (N, 3; world space) and `u` (N, 3): (share of the rays that are guided, sampled direction, its
// density, density of the directions `wi`).
nb::tuple caustic_lobes(const Scene& scene, const CausticGuide& caustics, InArray<double> p_, InArray<float> u_,
                        InArray<float> wi_) {
  const size_t n = p_.size() / 3;
  std::vector<float> share(n), wi(3 * n), pdf(n), given(n);
  for (size_t first = 0; first < n; first += W) {
    vvec3<W> p, u, w;
    for (int i = 0; i < W; ++i) {
      const size_t row = 3 * std::min(first + size_t(i), n - 1);
      const dvec3 q = (dvec3{p_.data()[row], p_.data()[row + 1], p_.data()[row + 2]} - scene.origin) * scene.scale;
      p.x.set(i, float(q.x)), p.y.set(i, float(q.y)), p.z.set(i, float(q.z));
      u.x.set(i, u_.data()[row]), u.y.set(i, u_.data()[row + 1]), u.z.set(i, u_.data()[row + 2]);
      w.x.set(i, wi_.data()[row]), w.y.set(i, wi_.data()[row + 1]), w.z.set(i, wi_.data()[row + 2]);
    }
    const CausticLanes<W> guide(caustics, vbool<W>(true), p, [](const vvec3<W>&, vfloat<W>) { return vfloat<W>(1.0f); });
    if (!any(guide.share > vfloat<W>(0.0f))) continue;
    const vvec3<W> s = guide.sample(u.x, u.y, u.z);
    const vfloat<W> of_sample = guide.pdf(s), of_given = guide.pdf(w);
    for (int i = 0; i < W && first + size_t(i) < n; ++i) {
      const size_t row = first + size_t(i);
      share[row] = guide.share[i], pdf[row] = of_sample[i], given[row] = of_given[i];
      wi[3 * row] = s.x[i], wi[3 * row + 1] = s.y[i], wi[3 * row + 2] = s.z[i];
    }
  }
  return nb::make_tuple(to_numpy(std::move(share), {n}), to_numpy(std::move(wi), {n, 3}), to_numpy(std::move(pdf), {n}),
                        to_numpy(std::move(given), {n}));
}

}  // namespace

void bind_caustics(nb::module_& m, nb::module_& testing) {
  nb::class_<CausticGuide>(m, "CausticGuide")
      .def_prop_ro("photons", [](const CausticGuide& g) { return g.photons.size() / kPhotonFields; })
      .def_ro("sharp", &CausticGuide::sharp)
      .def_prop_ro("memory_bytes", &CausticGuide::memory_bytes);
  m.def(
      "learn_caustics",
      [](const Scene& scene, int max_depth, int threads, int lanes) {
        return learn_caustics(scene, max_depth, threads, kernel_of(lanes)).release();
      },
      nb::arg("scene"), nb::arg("max_depth"), nb::arg("threads"), nb::arg("lanes"), nb::rv_policy::take_ownership,
      nb::call_guard<nb::gil_scoped_release>());
  testing.def(
      "find_caustics",
      [](const Scene& scene, int max_depth, int threads) { return find_caustics(scene, max_depth, threads).release(); },
      nb::rv_policy::take_ownership, nb::call_guard<nb::gil_scoped_release>());
  testing.def("caustic_lobes", &caustic_lobes);
}

}  // namespace primray
