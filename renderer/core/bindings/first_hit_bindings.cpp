// Python bindings of first hits: planes that are allocated once, filled by bands of rows (with signal checks in between), and
// moved out.
#include <nanobind/stl/string.h>

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
void make(FirstHits* self, const Scene& scene, nb::list names, nb::list primvars, uint32_t replicate,
          float occlusion_distance) {
  new (self) FirstHits{scene, {}};
  FirstHitPlanes& p = self->planes;
  p.replicate = replicate, p.occlusion_distance = occlusion_distance;
  const size_t pixels = size_t(scene.camera.pixels.width) * scene.camera.pixels.height;
  for (nb::handle each : names) {
    const std::string name = nb::cast<std::string>(each);
    if (name == "depth") p.depth.resize(pixels);
    if (name == "distance") p.distance.resize(pixels);
    if (name == "position") p.position.resize(3 * pixels);
    if (name == "camera_position") p.camera_position.resize(3 * pixels);
    if (name == "normal") p.normal.resize(3 * pixels);
    if (name == "geometric_normal") p.geometric.resize(3 * pixels);
    if (name == "motion_forward") p.forward.resize(2 * pixels);
    if (name == "motion_backward") p.backward.resize(2 * pixels);
    if (name == "albedo") p.albedo.resize(3 * pixels);
    if (name == "emission") p.emission.resize(3 * pixels);
    if (name == "guide_albedo") p.guide_albedo.resize(3 * pixels);
    if (name == "guide_normal") p.guide_normal.resize(3 * pixels);
    if (name == "occlusion") p.occlusion.resize(pixels);
    if (name == "prim") p.shape.resize(pixels);
    if (name == "material") p.surface.resize(pixels);
    if (name == "instance") p.instance.resize(pixels), p.outer.resize(scene.has_grouped ? pixels : 0);
  }
  for (nb::handle each : primvars) {
    PrimvarPlane plane;
    plane.names[0] = nb::cast<int>(each[0]), plane.names[1] = nb::cast<int>(each[1]), plane.width = nb::cast<int>(each[2]);
    for (const int name : plane.names)
      if (name >= scene.primvars.names) throw Error("internal", "the scene has no primvar of that number");
    plane.values.resize(pixels * plane.width);
    p.primvars.push_back(std::move(plane));
  }
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
nb::tuple take_coverage(FirstHits& self) {
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
  return nb::make_tuple(to_numpy(std::move(counts), {h, w}), to_numpy(std::move(what), {n, 4}),
                        to_numpy(std::move(shares), {n}));
}

// Moves the planes out.
nb::dict take(FirstHits& self) {
  FirstHitPlanes& p = self.planes;
  const size_t h = size_t(self.scene.camera.pixels.height), w = size_t(self.scene.camera.pixels.width);
  nb::dict d;
  const auto add = [&](const char* name, auto& plane, size_t channels) {
    if (!plane.empty()) d[name] = to_numpy(std::move(plane), {h, w, channels});
  };
  add("depth", p.depth, 1), add("distance", p.distance, 1), add("position", p.position, 3);
  add("camera_position", p.camera_position, 3), add("normal", p.normal, 3), add("geometric_normal", p.geometric, 3);
  add("motion_forward", p.forward, 2), add("motion_backward", p.backward, 2);
  add("albedo", p.albedo, 3), add("emission", p.emission, 3);
  add("guide_albedo", p.guide_albedo, 3), add("guide_normal", p.guide_normal, 3);
  add("occlusion", p.occlusion, 1);
  add("prim", p.shape, 1), add("material", p.surface, 1), add("instance", p.instance, 1), add("outer", p.outer, 1);
  nb::list primvars;
  for (PrimvarPlane& v : p.primvars) primvars.append(to_numpy(std::move(v.values), {h, w, size_t(v.width)}));
  d["primvars"] = primvars;
  return d;
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
      .def("take", &take);
}

}  // namespace primray
