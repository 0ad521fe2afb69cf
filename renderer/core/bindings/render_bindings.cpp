// render() and Film for Python. The GIL is free while threads render; signals and progress are looked after in between.
#include "bindings/arrays.hpp"
#include "film/film.hpp"
#include "integrator/render.hpp"
#include "integrator/replay.hpp"

#include <nanobind/stl/unique_ptr.h>

namespace primray {
namespace {

struct RenderResult {
  Film film;
  RenderStatistics statistics;
};

// A render's rays on one thread, kept in order.
struct Recording {
  const Scene& scene;
  int lanes;
  RayRecorder rays;
};

IntegratorSettings settings_of(int samples, int max_depth, int threads, uint32_t seed, int splits) {
  return {samples, max_depth, threads, seed, splits};
}

std::unique_ptr<RenderResult> render_scene(const Scene& scene, int samples, int max_depth, int threads, uint32_t seed,
                                           int lanes, nb::object progress, int splits) {
  std::unique_ptr<RenderResult> r(new RenderResult{Film(scene.camera.width, scene.camera.height), {}});
  const IntegratorSettings settings = settings_of(samples, max_depth, threads, seed, splits);
  Film& film = r->film;
  const Progress poll = [&](double fraction) {
    const nb::gil_scoped_acquire gil;
    if (PyErr_CheckSignals() != 0) {
      // Only a keyboard interrupt is an answer that leaves a picture; it is told through `interrupted`.
      if (!PyErr_ExceptionMatches(PyExc_KeyboardInterrupt)) PyErr_WriteUnraisable(nullptr);
      PyErr_Clear();
      return false;
    }
    if (progress.is_none()) return true;
    const nb::object answer =
        progress(fraction, film.samples.load(), film.camera_rays + film.scattered_rays + film.shadow_rays);
    return answer.is_none() || nb::cast<bool>(answer);
  };
  std::exception_ptr error;
  {
    const nb::gil_scoped_release release;
    const Progress guarded = [&](double fraction) {
      try {
        return poll(fraction);
      } catch (...) {
        // What the callback raised goes on after the threads have ended.
        error = std::current_exception();
        return false;
      }
    };
    r->statistics = render(scene, settings, lanes, film, guarded);
  }
  if (error) std::rethrow_exception(error);
  return r;
}

// Means over all replicates, (height, width, 4) float32; pixels without samples are 0.
nb::object pixels(const RenderResult& r, float exposure) {
  const Film& f = r.film;
  const size_t n = size_t(f.width) * f.height;
  std::vector<float> out(n * Film::kChannels);
  for (size_t p = 0; p < n; ++p) {
    double count = 0, sum[Film::kChannels] = {};
    for (int k = 0; k < kReplicates; ++k) {
      count += f.counts[k * n + p];
      for (int c = 0; c < Film::kChannels; ++c) sum[c] += f.sums[(k * n + p) * Film::kChannels + c];
    }
    if (count == 0) continue;
    for (int c = 0; c < Film::kChannels; ++c)
      out[p * Film::kChannels + c] = float(sum[c] / count * (c < 3 ? double(exposure) : 1.0));
  }
  return to_numpy(std::move(out), {size_t(f.height), size_t(f.width), size_t(Film::kChannels)});
}

}  // namespace

void bind_render(nb::module_& m) {
  nb::class_<RenderResult>(m, "RenderResult")
      .def("pixels", &pixels, nb::arg("exposure_scale"))
      .def_prop_ro("replicates",
                   [](const RenderResult& r) {
                     return to_numpy(r.film.sums, {size_t(kReplicates), size_t(r.film.height), size_t(r.film.width),
                                                   size_t(Film::kChannels)});
                   })
      .def_prop_ro("counts",
                   [](const RenderResult& r) {
                     return to_numpy(r.film.counts, {size_t(kReplicates), size_t(r.film.height), size_t(r.film.width)});
                   })
      .def_prop_ro("samples", [](const RenderResult& r) { return r.film.samples.load(); })
      .def_prop_ro("camera_rays", [](const RenderResult& r) { return r.film.camera_rays.load(); })
      .def_prop_ro("scattered_rays", [](const RenderResult& r) { return r.film.scattered_rays.load(); })
      .def_prop_ro("shadow_rays", [](const RenderResult& r) { return r.film.shadow_rays.load(); })
      .def_prop_ro("invalid_samples", [](const RenderResult& r) { return r.film.invalid_samples.load(); })
      .def_prop_ro("interrupted", [](const RenderResult& r) { return r.statistics.interrupted; })
      .def_prop_ro("lane_occupancy", [](const RenderResult& r) { return r.statistics.lane_occupancy; })
      .def_prop_ro("splits", [](const RenderResult& r) { return r.statistics.splits; })
      .def_prop_ro("seconds", [](const RenderResult& r) { return r.statistics.seconds; });
  m.def("render", &render_scene, nb::arg("scene"), nb::arg("samples"), nb::arg("max_depth"), nb::arg("threads"),
        nb::arg("seed"), nb::arg("lanes"), nb::arg("progress").none(), nb::arg("splits") = 0);
  m.def("has_lanes", &has_lanes);
  nb::class_<Recording>(m, "Recording")
      .def(
          "__init__",
          [](Recording* self, const Scene& scene, int samples, int max_depth, uint32_t seed, int lanes) {
            new (self) Recording{scene, lanes, {}};
            Film film(scene.camera.width, scene.camera.height);
            const nb::gil_scoped_release release;
            render(scene, settings_of(samples, max_depth, 1, seed, 0), lanes, film, {}, &self->rays);
          },
          nb::keep_alive<1, 2>())
      .def(
          "replay_seconds", [](const Recording& r) { return replay(r.scene, r.rays, r.lanes); },
          nb::call_guard<nb::gil_scoped_release>());
}

}  // namespace primray
