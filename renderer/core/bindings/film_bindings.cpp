// Python bindings of the film: its images, and its whole state for checkpoints and merging.
#include "base/error.hpp"
#include "bindings/arrays.hpp"
#include "film/film.hpp"
#include "film/frame_error.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/unique_ptr.h>

namespace primray {
namespace {

// Names of the arrays with sums and bins of each Removal.
constexpr const char* kRemovalNames[kRemovals][2] = {{"clamped", "clamped_bins"}, {"caustics", "caustics_bins"}};

// Arrays by name, of several types and shapes.
using FilmState = nb::typed<nb::dict, nb::str, nb::ndarray<nb::numpy>>;

FilmState state_of(const Film& f) {
  const size_t h = size_t(f.height), w = size_t(f.width), tiles = size_t(f.tiles());
  FilmState state;
  state["parts"] = to_numpy(std::vector(f.parts), {kReplicates, h, w, Film::kColors, 2});
  state["bins"] = to_numpy(std::vector(f.bins), {kReplicates, h, w, Film::kColors});
  state["counts"] = to_numpy(std::vector(f.counts), {kReplicates, h, w});
  state["covered"] = to_numpy(std::vector(f.covered), {kReplicates, h, w});
  state["next"] = to_numpy(std::vector(f.next), {kReplicates, tiles});
  state["tile_rays"] = to_numpy(std::vector(f.tile_rays), {tiles});
  state["totals"] =
      to_numpy(std::vector<int64_t>{f.camera_rays, f.scattered_rays, f.shadow_rays, f.invalid_samples, f.samples}, {5});
  if (f.expressions > 0)
    state["routed"] = to_numpy(std::vector(f.routed), {size_t(f.expressions), kReplicates, h, w, Film::kColors, 2});
  for (size_t why = 0; why < kRemovals; ++why) {
    const PixelSums& sums = f.removed[why];
    if (!sums.any()) continue;
    state[kRemovalNames[why][0]] = to_numpy(std::vector(sums.parts), {kReplicates, h, w, Film::kColors, 2});
    state[kRemovalNames[why][1]] = to_numpy(std::vector(sums.bins), {kReplicates, h, w, Film::kColors});
  }
  return state;
}

template <class T>
void take(const FilmState& state, const char* name, std::vector<T>& into) {
  const auto array = nb::cast<nb::ndarray<const T, nb::c_contig, nb::device::cpu>>(state[name]);
  if (array.size() != into.size()) throw Error("checkpoint", std::string(name) + " does not have the film's size");
  std::copy_n(array.data(), array.size(), into.data());
}

std::unique_ptr<Film> film_from(int width, int height, const FilmState& state) {
  int expressions = 0;
  if (state.contains("routed"))
    expressions = int(nb::cast<nb::ndarray<const int64_t, nb::c_contig, nb::device::cpu>>(state["routed"]).shape(0));
  int removals = 0;
  for (int why = 0; why < kRemovals; ++why) removals |= int(state.contains(kRemovalNames[why][0])) << why;
  auto f = std::make_unique<Film>(width, height, expressions, removals);
  for (size_t why = 0; why < kRemovals; ++why)
    if (PixelSums& sums = f->removed[why]; sums.any())
      take(state, kRemovalNames[why][0], sums.parts), take(state, kRemovalNames[why][1], sums.bins);
  if (expressions > 0) take(state, "routed", f->routed);
  take(state, "parts", f->parts), take(state, "bins", f->bins), take(state, "counts", f->counts);
  take(state, "covered", f->covered), take(state, "next", f->next), take(state, "tile_rays", f->tile_rays);
  std::vector<int64_t> totals(5);
  take(state, "totals", totals);
  f->camera_rays = totals[0], f->scattered_rays = totals[1], f->shadow_rays = totals[2];
  f->invalid_samples = totals[3], f->samples = totals[4];
  return f;
}

// Returns (H, W, 4) colours with coverage and (H, W, 3) standard errors; infinite where a pixel has samples of one replicate
// only.
std::tuple<OutArray<float, 3>, OutArray<float, 3>> image(const Film& f, double exposure) {
  std::vector<float> pixels(f.pixels() * 4), errors(f.pixels() * Film::kColors);
  {
    const nb::gil_scoped_release release;
    for (size_t p = 0; p < f.pixels(); ++p) {
      const PixelEstimate e = estimate_pixel(f, p, exposure);
      for (int c = 0; c < Film::kColors; ++c) {
        pixels[4 * p + c] = float(e.mean[c]);
        errors[Film::kColors * p + c] = e.measured ? float(std::abs(e.difference[c])) : std::numeric_limits<float>::infinity();
      }
      pixels[4 * p + 3] = float(e.coverage);
    }
  }
  const size_t h = size_t(f.height), w = size_t(f.width);
  return {to_numpy(std::move(pixels), {h, w, 4}), to_numpy(std::move(errors), {h, w, size_t(Film::kColors)})};
}

// Returns for each light path expression its means (E, H, W, 3), and differences of both replicates (E, H, W, 3), signed, each
// distributed like the mean's error; NaN where a pixel has samples of one replicate only.
std::tuple<OutArray<double, 4>, OutArray<float, 4>> lpe_images(const Film& f, double exposure) {
  const size_t n = size_t(f.expressions), values = f.pixels() * Film::kColors;
  std::vector<double> means(n * values);
  std::vector<float> differences(n * values);
  {
    const nb::gil_scoped_release release;
    for (size_t e = 0; e < n; ++e)
      for (size_t p = 0; p < f.pixels(); ++p) {
        const PixelEstimate found = estimate_lpe(f, int(e), p, exposure);
        for (size_t c = 0; c < Film::kColors; ++c) {
          const size_t i = e * values + Film::kColors * p + c;
          means[i] = found.mean[c];
          differences[i] = found.measured ? float(found.difference[c]) : std::numeric_limits<float>::quiet_NaN();
        }
      }
  }
  const size_t h = size_t(f.height), w = size_t(f.width);
  return {to_numpy(std::move(means), {n, h, w, size_t(Film::kColors)}),
          to_numpy(std::move(differences), {n, h, w, size_t(Film::kColors)})};
}

// Returns the removed light of rows [first, end): means (rows, W, 3) and differences of both replicates (rows, W, 3), each
// distributed like the mean's error; NaN where a pixel has samples of one replicate only.
std::tuple<OutArray<double, 3>, OutArray<double, 3>> removed_rows(const Film& f, int why, double exposure, int first, int end) {
  if (why < 0 || why >= kRemovals || !f.removed[size_t(why)].any())
    throw Error("invariant", "the film does not record this kind of removed light");
  if (first < 0 || end < first || end > f.height) throw Error("invariant", "the film has no such rows");
  const size_t from = size_t(first) * size_t(f.width), pixels = size_t(end) * size_t(f.width) - from;
  std::vector<double> means(pixels * Film::kColors), differences(pixels * Film::kColors);
  {
    const nb::gil_scoped_release release;
    for (size_t p = 0; p < pixels; ++p) {
      const PixelEstimate found = estimate_removed(f, Removal(why), from + p, exposure);
      for (size_t c = 0; c < Film::kColors; ++c) {
        means[Film::kColors * p + c] = found.mean[c];
        differences[Film::kColors * p + c] = found.measured ? found.difference[c] : std::numeric_limits<double>::quiet_NaN();
      }
    }
  }
  const size_t h = size_t(end - first), w = size_t(f.width);
  return {to_numpy(std::move(means), {h, w, size_t(Film::kColors)}),
          to_numpy(std::move(differences), {h, w, size_t(Film::kColors)})};
}

// Returns the number of samples (H, W) of the deep picture and, pixel by pixel and front to back, (N, 6) of each: Z, ZBack, R,
// G, B, A.
std::tuple<OutArray<uint32_t, 2>, OutArray<float, 2>> deep_samples(const Film& f, double exposure) {
  if (!f.deep) throw Error("invariant", "the film has no deep picture");
  std::vector<uint32_t> counts(f.pixels());
  std::vector<DeepSample> samples;
  {
    const nb::gil_scoped_release release;
    for (size_t p = 0, other = f.pixels(); p < f.pixels(); ++p, ++other) {
      const size_t before = samples.size();
      append_samples(*f.deep, p, f.covered[p] + f.covered[other], f.counts[p] + f.counts[other], Film::kCovered, exposure,
                     samples);
      counts[p] = uint32_t(samples.size() - before);
    }
  }
  static_assert(sizeof(DeepSample) == 6 * sizeof(float));
  std::vector<float> values(6 * samples.size());
  if (!samples.empty()) std::memcpy(values.data(), samples.data(), samples.size() * sizeof(DeepSample));
  const size_t n = samples.size();
  return {to_numpy(std::move(counts), {size_t(f.height), size_t(f.width)}), to_numpy(std::move(values), {n, 6})};
}

std::unique_ptr<Film> make_film(int width, int height, int expressions, int removals, double deep_tolerance, int deep_samples) {
  auto f = std::make_unique<Film>(width, height, expressions, removals);
  if (deep_tolerance == 0) return f;
  if (!(deep_tolerance >= DepthCells::kFinest && deep_tolerance <= 1) || deep_samples < DeepFilm::kLeast)
    throw Error("invariant", "the tolerance or the number of samples of a deep picture is out of range");
  f->deep = std::make_unique<DeepFilm>(f->pixels(), deep_tolerance, deep_samples);
  return f;
}

// `mix` (E, 3), or (0, 3).
FrameError error_of(const Film& f, double exposure, int64_t most_pixels, int threads, const InArray<double>& mix,
                    bool by_pixel) {
  if (mix.ndim() != 2 || mix.shape(1) != size_t(Film::kColors) || (mix.shape(0) != 0 && mix.shape(0) != size_t(f.expressions)))
    throw Error("invariant", "the weights of a mix are not of the film's light path expressions");
  MixWeights weights(mix.shape(0));
  for (size_t i = 0; i < mix.size(); ++i) weights[i / Film::kColors][i % Film::kColors] = mix.data()[i];
  const nb::gil_scoped_release release;
  return frame_error(f, exposure, most_pixels, threads, weights, by_pixel);
}

// Returns sums (R, H, W, 4) of R, G, B and coverage.
OutArray<double, 4> replicates(const Film& f) {
  std::vector<double> sums(f.counts.size() * 4);
  for (size_t p = 0; p < f.counts.size(); ++p) {
    for (int c = 0; c < Film::kColors; ++c) sums[4 * p + c] = f.sum(p, c).value();
    sums[4 * p + 3] = double(f.covered[p]) / Film::kCovered;
  }
  return to_numpy(std::move(sums), {size_t(kReplicates), size_t(f.height), size_t(f.width), 4});
}

// Returns sums of groups of floats, `group` at a time, added up: (high, low, bin, value).
std::tuple<int64_t, int64_t, int, double> sum_of(const InArray<float>& terms, int group) {
  ExactSum sum;
  for (size_t i = 0; i < terms.size(); i += size_t(group))
    sum.add(exact_sum(terms.data() + i, int(std::min(size_t(group), terms.size() - i))));
  return {sum.high, sum.low, sum.bin, sum.value()};
}

}  // namespace

void bind_film(nb::module_& m) {
  m.attr("TILE") = kTile;
  m.attr("REPLICATES") = kReplicates;
  m.def("exact_sum", &sum_of, nb::arg("terms"), nb::arg("group"));
  nb::class_<FrameError>(m, "FrameErrorSums")
      .def_ro("values", &FrameError::values)
      .def_ro("relative_alone", &FrameError::relative_alone)
      .def_ro("relative_alike", &FrameError::relative_alike)
      .def_ro("relative", &FrameError::relative)
      .def_ro("relative_plain", &FrameError::relative_plain)
      .def_ro("relative_variance", &FrameError::relative_variance)
      .def_ro("squared", &FrameError::squared)
      .def_ro("squared_variance", &FrameError::squared_variance)
      .def_prop_ro(
          "tiles", [](const FrameError& e) { return to_numpy(std::vector(e.tiles), {e.tiles.size()}); }, kNewArray)
      .def_prop_ro("pixels", [](const FrameError& e) { return to_numpy(std::vector(e.pixels), {e.pixels.size()}); }, kNewArray);
  nb::class_<Film>(m, "Film")
      .def(nb::new_(&make_film), nb::arg("width"), nb::arg("height"), nb::arg("expressions") = 0, nb::arg("removals") = 0,
           nb::arg("deep_tolerance") = 0.0, nb::arg("deep_samples") = 0)
      .def_static("from_state", &film_from, nb::arg("width"), nb::arg("height"), nb::arg("state"))
      .def("state", &state_of)
      .def("merge", &Film::merge, nb::arg("other"))
      .def(
          "start_at", [](Film& f, uint32_t first) { std::fill(f.next.begin(), f.next.end(), first); }, nb::arg("first"))
      .def("image", &image, nb::arg("exposure"))
      .def("lpe_images", &lpe_images, nb::arg("exposure"))
      .def("removed_rows", &removed_rows, nb::arg("why"), nb::arg("exposure"), nb::arg("first"), nb::arg("end"))
      .def("deep_samples", &deep_samples, nb::arg("exposure"))
      .def_prop_ro("deep_memory_bytes", [](const Film& f) { return f.deep ? f.deep->memory_bytes() : 0; })
      .def_ro("expressions", &Film::expressions)
      .def("error", &error_of, nb::arg("exposure"), nb::arg("most_pixels"), nb::arg("threads"), nb::arg("mix"),
           nb::arg("by_pixel") = false, "Sums over pixels and colours; see film/frame_error.hpp.")
      .def_prop_ro("replicates", &replicates, kNewArray)
      .def_prop_ro(
          "counts",
          [](const Film& f) {
            return to_numpy(std::vector(f.counts), {size_t(kReplicates), size_t(f.height), size_t(f.width)});
          },
          kNewArray)
      .def_prop_ro(
          "next", [](const Film& f) { return to_numpy(std::vector(f.next), {size_t(kReplicates), size_t(f.tiles())}); },
          kNewArray)
      .def_prop_ro(
          "tile_rays", [](const Film& f) { return to_numpy(std::vector(f.tile_rays), {size_t(f.tiles())}); }, kNewArray)
      .def_ro("width", &Film::width)
      .def_ro("height", &Film::height)
      .def_ro("tiles_x", &Film::tiles_x)
      .def_ro("tiles_y", &Film::tiles_y)
      .def_prop_ro("samples", [](const Film& f) { return f.samples.load(); })
      .def_prop_ro("camera_rays", [](const Film& f) { return f.camera_rays.load(); })
      .def_prop_ro("scattered_rays", [](const Film& f) { return f.scattered_rays.load(); })
      .def_prop_ro("shadow_rays", [](const Film& f) { return f.shadow_rays.load(); })
      .def_prop_ro("unseen_walks",
                   [](const Film& f) {
                     nb::typed<nb::dict, int, float> walks;
                     for (const auto& [shape, pixels] : f.unseen_walks) walks[nb::int_(shape)] = pixels;
                     return walks;
                   })
      .def_prop_ro("invalid_samples", [](const Film& f) { return f.invalid_samples.load(); });
}

}  // namespace primray
