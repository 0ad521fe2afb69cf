// Python binding of render_pass(), of recorded rays, and of the guide for caustics. The GIL is released while threads render;
// signals are checked and progress is reported in between.

#include <algorithm>
#include <string_view>

#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/tuple.h>

#include "bindings/arrays.hpp"
#include "bindings/recording.hpp"
#include "guiding/pilot/caustic_photons.hpp"
#include "guiding/pilot/learning.hpp"
#include "integrator/path_log.hpp"
#include "render/render.hpp"
#include "render/replay.hpp"
#include "scene/scene.hpp"

namespace primray {

// Python bindings of the caustic guide, and for the tests its densities and samples at points.

namespace {

constexpr int W = 4;

// Returns for each of `p` (N, 3; world space) and `u` (N, 3): (share of the rays that are guided, sampled direction, its
// density, density of the directions `wi`).
std::tuple<OutArray<float, 1>, OutArray<float, 2>, OutArray<float, 1>, OutArray<float, 1>> caustic_lobes(
    const Scene& scene, const CausticGuide& caustics, InArray<double> p_, InArray<float> u_, InArray<float> wi_) {
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
  return {to_numpy(std::move(share), {n}), to_numpy(std::move(wi), {n, 3}), to_numpy(std::move(pdf), {n}),
          to_numpy(std::move(given), {n})};
}

// Photons of a scene: landing points (N, 3; world space), the directions that they came from (N, 3), and their weights: areas
// of unoccluded light, in world units.
std::tuple<OutArray<double, 2>, OutArray<float, 2>, OutArray<float, 1>> photons_of(const Scene& scene, int max_depth,
                                                                                   int threads) {
  const std::vector<CausticPhoton> photons = trace_photons(scene, max_depth, threads);
  std::vector<double> landing;
  std::vector<float> direction, weight;
  for (const CausticPhoton& p : photons) {
    const dvec3 at = dvec3{p.landing.x, p.landing.y, p.landing.z} * (1 / scene.scale) + scene.origin;
    landing.insert(landing.end(), {at.x, at.y, at.z});
    direction.insert(direction.end(), {p.direction.x, p.direction.y, p.direction.z});
    weight.push_back(p.weight / float(scene.scale * scene.scale));
  }
  const size_t n = photons.size();
  return {to_numpy(std::move(landing), {n, 3}), to_numpy(std::move(direction), {n, 3}), to_numpy(std::move(weight), {n})};
}

}  // namespace

void bind_caustics(nb::module_& m, nb::module_& testing) {
  nb::class_<CausticGuide>(m, "CausticGuide")
      .def_prop_ro("photons", [](const CausticGuide& g) { return g.photons.size() / kPhotonFields; })
      .def_ro("sharp", &CausticGuide::sharp)
      .def_prop_ro("memory_bytes", &CausticGuide::memory_bytes);
  m.def(
      "learn_caustics",
      [](const Scene& scene, int max_depth, int threads, int lanes, const Cancellation* cancel) {
        return learn_caustics(scene, max_depth, threads, kernel_of(lanes), cancel ? &cancel->asked : nullptr).release();
      },
      nb::arg("scene"), nb::arg("max_depth"), nb::arg("threads"), nb::arg("lanes"), nb::arg("cancel").none() = nb::none(),
      nb::rv_policy::take_ownership, nb::call_guard<nb::gil_scoped_release>());
  testing.def(
      "find_caustics",
      [](const Scene& scene, int max_depth, int threads) { return find_caustics(scene, max_depth, threads).release(); },
      nb::rv_policy::take_ownership, nb::call_guard<nb::gil_scoped_release>());
  testing.def("photons", &photons_of);
  testing.def("caustic_lobes", &caustic_lobes);
}

namespace {

// Called with the fraction of a pass that is done; the pass ends where it returns False.
using ProgressFunction = nb::typed<nb::object, std::optional<nb::typed<nb::callable, std::optional<bool>(double)>>>;

PassStatistics pass(const Scene& scene, Film& film, const InArray<uint32_t>& ends, const IntegratorSettings& settings,
                    int lanes, ProgressFunction progress) {
  const std::span<const uint32_t> to = span_of(ends);
  const Progress poll = [&](double fraction) {
    const nb::gil_scoped_acquire gil;
    if (PyErr_CheckSignals() != 0) {
      // Only a keyboard interrupt ends the pass with a valid image; it is reported through `interrupted`.
      if (!PyErr_ExceptionMatches(PyExc_KeyboardInterrupt)) PyErr_WriteUnraisable(nullptr);
      PyErr_Clear();
      return false;
    }
    if (progress.is_none()) return true;
    const nb::object answer = progress(fraction);
    return answer.is_none() || nb::cast<bool>(answer);
  };
  std::exception_ptr error;
  PassStatistics statistics;
  {
    const nb::gil_scoped_release release;
    const Progress guarded = [&](double fraction) {
      try {
        return poll(fraction);
      } catch (...) {
        // Exceptions of the callback are rethrown after the threads have ended.
        error = std::current_exception();
        return false;
      }
    };
    statistics = render_pass(scene, settings, lanes, to, film, guarded);
  }
  if (error) std::rethrow_exception(error);
  return statistics;
}

// Only depth and seed of `settings` are used.
void record(Recording* self, const Scene& scene, int samples, const IntegratorSettings& asked, int lanes) {
  new (self) Recording{scene, lanes, {}};
  Film film(scene.camera.pixels.width, scene.camera.pixels.height);
  IntegratorSettings settings;
  settings.max_depth = asked.max_depth, settings.seed = asked.seed;
  const nb::gil_scoped_release release;
  const std::unique_ptr<CausticGuide> caustics = learn_caustics(scene, settings.max_depth, 1, kernel_of(lanes));
  settings.caustics = caustics.get();
  const Splits chosen = choose_splits(scene, settings, kernel_of(lanes));
  settings.splits = chosen.paths, settings.light_samples = chosen.lights;
  const std::vector<uint32_t> ends(film.next.size(), uint32_t((samples + 1) / kReplicates));
  const std::unique_ptr<Guide> guide = learn_guide(scene, settings, kernel_of(lanes));
  settings.guide = guide.get();
  if (guide && guide->alone) settings.caustics = nullptr;
  render_pass(scene, settings, lanes, ends, film, {}, &self->rays);
}

using namespace std::string_view_literals;

using Events = nb::typed<nb::list, nb::typed<nb::dict, nb::str, nb::any>>;

bool is_of_all(const PathLog::Event& event) { return event.kind == "sample"sv || event.kind == "camera"sv; }

// Whether each sample of a log is among the `count` that are brightest in any channel.
std::vector<uint8_t> are_brightest(const PathLog& log, int count) {
  std::vector<std::pair<double, int>> values;
  for (const PathLog::Event& event : log.events) {
    if (event.kind != "sample"sv) continue;
    const double (&v)[3] = event.values.front().v;
    values.emplace_back(-std::max({v[0], v[1], v[2]}), event.sample);
  }
  const size_t kept = std::min(size_t(count), values.size());
  std::nth_element(values.begin(), values.begin() + std::ptrdiff_t(kept), values.end());
  std::vector<uint8_t> found(values.size());
  for (size_t i = 0; i < kept; ++i) found[size_t(values[i].second)] = 1;
  return found;
}

// Returns the events of a log: dictionaries of numbers, tuples of three numbers, and texts. Of samples that are not among the
// `brightest` ones, only their camera rays and their values.
Events events_of(const PathLog& log, int brightest) {
  const std::vector<uint8_t> bright = are_brightest(log, brightest);
  Events events;
  for (const PathLog::Event& event : log.events) {
    if (!bright[size_t(event.sample)] && !is_of_all(event)) continue;
    nb::dict e;
    e["kind"] = event.kind, e["sample"] = event.sample, e["part"] = event.part, e["vertex"] = event.vertex;
    e["depth"] = event.depth;
    if (*event.why) e["why"] = event.why;
    for (const PathLog::Value& value : event.values) {
      if (value.width == 1)
        e[value.name] = value.v[0];
      else
        e[value.name] = nb::make_tuple(value.v[0], value.v[1], value.v[2]);
    }
    events.append(e);
  }
  return events;
}

// `first`, `end`: indices of the samples of both replicates.
Events log_of_pixel(const Scene& scene, const IntegratorSettings& settings, int x, int y, std::pair<uint32_t, uint32_t> first,
                    std::pair<uint32_t, uint32_t> end, int brightest) {
  PathLog log;
  {
    const nb::gil_scoped_release release;
    log_pixel(scene, settings, x, y, {{first.first, end.first}, {first.second, end.second}}, log);
  }
  return events_of(log, brightest);
}

// Shape of an emissive geometry's light row, numbered as in the plane "prim" of
// first hits, and its instance, or -1.
std::pair<int, int> shape_of_light(const Scene& scene, int light) {
  const EmitterTable& table = scene.emitters;
  int number = light - table.static_light, instance = -1;
  size_t group = 0;
  for (size_t p = 0; p < table.placement_light.size(); ++p) {
    const int first = table.placement_light[p], rows = table.placement_rows[p];
    if (first < 0 || rows == 0 || light < first) continue;
    number = (light - first) % rows, instance = scene.placement_instance[p] + (light - first) / rows;
    group = size_t(scene.placement_group[p]);
  }
  const Group& g = scene.groups[group];
  const uint32_t end = g.triangle_base + g.triangle_count + g.cutout_count;
  for (size_t m = 0; m < table.of_mesh.size(); ++m) {
    const uint32_t first = uint32_t(scene.meshes.triangle_base[m]);
    if (table.of_mesh[m] == number && first >= g.triangle_base && first < end) return {int(m), instance};
  }
  for (size_t c = 0; c < table.of_curved.size(); ++c)
    if (table.of_curved[c] == number) return {-2 - int(c), instance};
  return {-1, instance};
}

// Returns (whether it is a shadow ray, its time) for every ray, in order: (N,) and (N,).
std::tuple<OutArray<uint8_t, 1>, OutArray<float, 1>> times_of(const Recording& r) {
  std::vector<uint8_t> shadow;
  std::vector<float> times;
  for (const RayRecorder::Call& call : r.rays.calls) {
    for (int i = 0; i < call.lanes; ++i) {
      if (!(call.active >> i & 1)) continue;
      shadow.push_back(call.shadow), times.push_back(r.rays.rays[call.first + 8 * size_t(call.lanes) + size_t(i)]);
    }
  }
  const size_t n = times.size();
  return {to_numpy(std::move(shadow), {n}), to_numpy(std::move(times), {n})};
}

}  // namespace

void bind_render(nb::module_& m) {
  nb::class_<PassStatistics>(m, "PassStatistics")
      .def_ro("interrupted", &PassStatistics::interrupted)
      .def_ro("busy_lanes", &PassStatistics::busy_lanes)
      .def_ro("shaded_lanes", &PassStatistics::shaded_lanes)
      .def_ro("seconds", &PassStatistics::seconds);
  m.def(
      "choose_splits",
      [](const Scene& scene, const IntegratorSettings& settings, int lanes) {
        const Splits chosen = choose_splits(scene, settings, kernel_of(lanes));
        return std::pair(chosen.paths, chosen.lights);
      },
      nb::arg("scene"), nb::arg("settings"), nb::arg("lanes"), nb::call_guard<nb::gil_scoped_release>());
  m.def("render_pass", &pass, nb::arg("scene"), nb::arg("film"), nb::arg("ends"), nb::arg("settings"), nb::arg("lanes"),
        nb::arg("progress").none() = nb::none());
  m.def("log_pixel", &log_of_pixel, nb::arg("scene"), nb::arg("settings"), nb::arg("x"), nb::arg("y"), nb::arg("first"),
        nb::arg("end"), nb::arg("brightest"));
  m.def("shape_of_light", &shape_of_light, nb::arg("scene"), nb::arg("light"));
  nb::class_<Guide>(m, "Guide")
      .def_prop_ro("regions", [](const Guide& g) { return g.cdf.size() / (Guide::kBins + 1); })
      .def_ro("alone", &Guide::alone)
      .def_ro("share", &Guide::share)
      .def_prop_ro("memory_bytes", &Guide::memory_bytes);
  m.def(
      "learn_guide",
      [](const Scene& scene, const IntegratorSettings& settings, int lanes) {
        return learn_guide(scene, settings, kernel_of(lanes)).release();
      },
      nb::arg("scene"), nb::arg("settings"), nb::arg("lanes"), nb::rv_policy::take_ownership,
      nb::call_guard<nb::gil_scoped_release>());
  m.def("has_lanes", &has_lanes);
  nb::class_<Recording>(m, "Recording")
      .def("__init__", &record, nb::keep_alive<1, 2>())
      .def(
          "replay_seconds", [](const Recording& r) { return replay(r.scene, r.rays, r.lanes); },
          nb::call_guard<nb::gil_scoped_release>())
      .def_prop_ro("times", &times_of, kNewArray);
}

}  // namespace primray
