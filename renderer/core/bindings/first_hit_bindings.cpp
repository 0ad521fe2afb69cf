// Python bindings of first hits: planes that are allocated once, filled by bands of rows (with signal checks in between), and
// moved out.
#include <nanobind/stl/map.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>

#include "aov/first_hit.hpp"
#include "base/error.hpp"
#include "bindings/arrays.hpp"

namespace primray {
namespace {

struct FirstHits {
  const Scene& scene;
  FirstHitPlanes planes;
};

// `names`: planes to fill; `primvars`: (name, its wider alternative, width) of each; `replicate`: see FirstHitPlanes.
void make(FirstHits* self, const Scene& scene, const std::vector<std::string>& names,
          const std::vector<std::tuple<int, int, int>>& primvars, uint32_t replicate, float occlusion_distance) {
  new (self) FirstHits{scene, {}};
  FirstHitPlanes& p = self->planes;
  p.replicate = replicate, p.occlusion_distance = occlusion_distance;
  const size_t pixels = size_t(scene.camera.pixels.width) * scene.camera.pixels.height;
  for (const std::string& name : names) {
    bool found = false;
    p.for_each([&](const char* own, auto& plane, size_t width, FirstHitSampling, double) {
      if (own == name) plane.resize(pixels * width), found = true;
    });
    if (!found) throw Error("internal", "there is no first-hit plane '" + name + "'");
  }
  for (const auto& [name, wide, width] : primvars) {
    if (std::max(name, wide) >= scene.primvars.names) throw Error("internal", "the scene has no primvar of that number");
    p.primvars.push_back({{name, wide}, width, std::vector<float>(pixels * size_t(width))});
  }
}

// Returns the numbers per pixel of each plane, by name.
std::map<std::string, size_t> widths_of_planes() {
  std::map<std::string, size_t> widths;
  FirstHitPlanes().for_each([&](const char* name, auto&, size_t width, FirstHitSampling, double) { widths[name] = width; });
  return widths;
}

// `first` and `end`: (R, tiles), the film's sample ranges; `first_link`: see Round.
void want_coverage(FirstHits& self, uint32_t seed, int screen_block, int first_link, const InArray<uint32_t>& first,
                   const InArray<uint32_t>& end) {
  CoveragePlanes& planes = self.planes.coverage;
  const PixelWindow& pixels = self.scene.camera.pixels;
  const size_t tiles = size_t((pixels.width + kTile - 1) / kTile) * size_t((pixels.height + kTile - 1) / kTile);
  if (first.size() != kReplicates * tiles || end.size() != first.size())
    throw Error("internal", "the sample ranges do not match the film's size");
  planes.seed = seed, planes.screen_block = screen_block, planes.first_link = first_link;
  planes.first.assign(first.data(), first.data() + first.size());
  planes.end.assign(end.data(), end.data() + end.size());
  for (size_t i = 0; i < planes.end.size(); ++i) planes.first[i] = std::min(planes.first[i], planes.end[i]);
  planes.by_pixel.resize(size_t(pixels.width) * pixels.height);
}

// Returns the number of surfaces that cover each pixel (H, W), and for all of them (N, 4) shape, surface, instance and outer
// instance, and shares (N).
std::tuple<OutArray<uint32_t, 2>, OutArray<int32_t, 2>, OutArray<int64_t, 1>> take_coverage(FirstHits& self) {
  const auto& by_pixel = self.planes.coverage.by_pixel;
  std::vector<uint32_t> counts;
  std::vector<int32_t> what;
  std::vector<int64_t> shares;
  for (const std::vector<Covering>& covering : by_pixel) {
    counts.push_back(uint32_t(covering.size()));
    for (const Covering& c : covering) {
      what.insert(what.end(), {c.shape, c.surface, c.instance, c.outer});
      shares.push_back(c.share);
    }
  }
  const size_t h = size_t(self.scene.camera.pixels.height), w = size_t(self.scene.camera.pixels.width), n = shares.size();
  return {to_numpy(std::move(counts), {h, w}), to_numpy(std::move(what), {n, 4}), to_numpy(std::move(shares), {n})};
}

// Moves the planes out, (H, W, C) each, by name.
nb::typed<nb::dict, nb::str, nb::ndarray<nb::numpy>> take(FirstHits& self) {
  const size_t h = size_t(self.scene.camera.pixels.height), w = size_t(self.scene.camera.pixels.width);
  nb::typed<nb::dict, nb::str, nb::ndarray<nb::numpy>> found;
  self.planes.for_each([&](const char* name, auto& plane, size_t width, FirstHitSampling, double) {
    if (!plane.empty()) found[name] = to_numpy(std::move(plane), {h, w, width});
  });
  return found;
}

// Moves the primvars out, (H, W, C) each, in the order in which they were requested.
std::vector<OutArray<float, 3>> take_primvars(FirstHits& self) {
  const size_t h = size_t(self.scene.camera.pixels.height), w = size_t(self.scene.camera.pixels.width);
  std::vector<OutArray<float, 3>> found;
  for (PrimvarPlane& v : self.planes.primvars) found.push_back(to_numpy(std::move(v.values), {h, w, size_t(v.width)}));
  return found;
}

}  // namespace

void bind_first_hit(nb::module_& m) {
  nb::class_<FirstHits>(m, "FirstHits")
      .def("__init__", &make, nb::arg("scene"), nb::arg("names"), nb::arg("primvars"), nb::arg("replicate") = 0u,
           nb::arg("occlusion_distance") = 0.0f, nb::keep_alive<1, 2>())
      .def(
          "fill",
          [](FirstHits& f, int lanes, int threads, int first_row, int end_row) {
            find_first_hits(f.scene, lanes, threads, first_row, end_row, f.planes);
          },
          nb::arg("lanes"), nb::arg("threads"), nb::arg("first_row"), nb::arg("end_row"),
          nb::call_guard<nb::gil_scoped_release>())
      .def("want_coverage", &want_coverage, nb::arg("seed"), nb::arg("screen_block"), nb::arg("first_link"), nb::arg("first"),
           nb::arg("end"))
      .def("take_coverage", &take_coverage)
      .def("take", &take)
      .def("take_primvars", &take_primvars)
      .def_static("widths_of_planes", &widths_of_planes);
}

}  // namespace primray
