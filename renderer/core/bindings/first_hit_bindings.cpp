// Python bindings of first hits: planes that are allocated once, filled by bands of rows (with signal checks in between), and
// moved out.
#include <nanobind/stl/map.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>

#include "aov/extents.hpp"
#include "aov/first_hit.hpp"
#include "aov/returns.hpp"
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

// Returns the number of layers of each point (N), and of all of them, in order, (M, 3) shape, instance and outer instance, and
// (M, 2) depth and distance. `positions`: (N, 2) pixels of the frame.
std::tuple<OutArray<uint32_t, 1>, OutArray<int32_t, 2>, OutArray<float, 2>> layers(const Scene& scene,
                                                                                   const InArray<float>& positions,
                                                                                   bool first_only, int lanes, int threads) {
  LayerPoints points;
  points.first_only = first_only;
  for (size_t i = 0; i + 1 < positions.size(); i += 2)
    points.x.push_back(positions.data()[i]), points.y.push_back(positions.data()[i + 1]);
  std::vector<int32_t> what;
  std::vector<float> lengths;
  {
    const nb::gil_scoped_release released;
    find_layers(scene, lanes, threads, points);
    for (const std::vector<Layer>& task : points.by_task)
      for (const Layer& l : task) {
        what.insert(what.end(), {l.shape, l.instance, l.outer});
        lengths.insert(lengths.end(), {l.depth, l.distance});
      }
  }
  const size_t n = points.count.size(), m = lengths.size() / 2;
  return {to_numpy(std::move(points.count), {n}), to_numpy(std::move(what), {m, 3}), to_numpy(std::move(lengths), {m, 2})};
}

// Layers of points, to be counted once the things that their parts belong to are known.
NumberedLayers numbered_layers(const Scene& scene, const InArray<float>& positions, bool first_only, int lanes, int threads) {
  LayerPoints points;
  points.first_only = first_only;
  points.x.reserve(positions.size() / 2), points.y.reserve(positions.size() / 2);
  for (size_t i = 0; i + 1 < positions.size(); i += 2)
    points.x.push_back(positions.data()[i]), points.y.push_back(positions.data()[i + 1]);
  const nb::gil_scoped_release released;
  find_layers(scene, lanes, threads, points);
  return numbered(points);
}

OutArray<int32_t, 2> parts_of_layers(const NumberedLayers& layers) {
  std::vector<int32_t> rows;
  for (const auto& part : layers.parts) rows.insert(rows.end(), part.begin(), part.end());
  return to_numpy(std::move(rows), {layers.parts.size(), 3});
}

// `places`: (K) the thing of each part; `parents`: (T) the thing that holds each, -1: none.
void check_things(const NumberedLayers& layers, const InArray<int32_t>& places, const InArray<int32_t>& parents) {
  if (places.size() != layers.parts.size()) throw Error("internal", "there is not one thing for each part");
  const auto held = [&](const InArray<int32_t>& of) {
    return std::all_of(of.data(), of.data() + of.size(), [&](int32_t at) { return at < int32_t(parents.size()); });
  };
  if (!held(places) || !held(parents)) throw Error("internal", "there is no thing of that number");
}

// Returns (T) rays that pass each thing, and (T) those that hit it first.
std::tuple<OutArray<int64_t, 1>, OutArray<int64_t, 1>> count_rays(const NumberedLayers& layers, const InArray<int32_t>& places,
                                                                  const InArray<int32_t>& parents) {
  check_things(layers, places, parents);
  RayCounts counts = rays_by_thing(layers, {places.data(), places.size()}, {parents.data(), parents.size()});
  const size_t n = parents.size();
  return {to_numpy(std::move(counts.passing), {n}), to_numpy(std::move(counts.first), {n})};
}

// Returns (N, 2) thing and ray, in the order of rays.
OutArray<int32_t, 2> rays_passing(const NumberedLayers& layers, const InArray<int32_t>& places,
                                  const InArray<int32_t>& parents) {
  check_things(layers, places, parents);
  std::vector<int32_t> rows;
  for (const auto& pair : rays_passing_things(layers, {places.data(), places.size()}, {parents.data(), parents.size()}))
    rows.insert(rows.end(), pair.begin(), pair.end());
  const size_t n = rows.size() / 2;
  return to_numpy(std::move(rows), {n, 2});
}

// `origins` and `directions`: (N, 3) in the world; `times`: (N) within the span; `reach`: where rays begin and end, in scene
// units; `weights`: of R, G and B. Returns the number of returns of each ray (N), and of all of them, in order, (M, 4) shape,
// instance, outer instance and surface, (M) distances, and (M, 2) strength and cosine.
std::tuple<OutArray<uint32_t, 1>, OutArray<int32_t, 2>, OutArray<double, 1>, OutArray<float, 2>> returns(
    const Scene& scene, const InArray<double>& origins, const InArray<double>& directions, const InArray<float>& times,
    const std::tuple<double, double>& reach, const std::tuple<float, float, float>& weights, float least_alpha,
    float least_strength, int lanes, int threads) {
  const size_t n = times.size();
  if (origins.size() != 3 * n || directions.size() != 3 * n) throw Error("internal", "each ray has an origin and a direction");
  ReturnRays rays;
  rays.origin.resize(n), rays.direction.resize(n);
  for (size_t i = 0; i < n; ++i) {
    const double *o = origins.data() + 3 * i, *d = directions.data() + 3 * i;
    rays.origin[i] = {o[0], o[1], o[2]}, rays.direction[i] = {d[0], d[1], d[2]};
  }
  rays.time.assign(times.data(), times.data() + n);
  rays.near = std::get<0>(reach), rays.far = std::get<1>(reach);
  rays.weights = {std::get<0>(weights), std::get<1>(weights), std::get<2>(weights)};
  rays.least_alpha = least_alpha, rays.least_strength = least_strength;
  std::vector<int32_t> what;
  std::vector<double> distances;
  std::vector<float> strengths;
  {
    const nb::gil_scoped_release released;
    find_returns(scene, lanes, threads, rays);
    for (const std::vector<Return>& task : rays.by_task)
      for (const Return& r : task) {
        what.insert(what.end(), {r.shape, r.instance, r.outer, r.surface});
        distances.push_back(r.distance);
        strengths.insert(strengths.end(), {r.strength, r.cosine});
      }
  }
  const size_t m = distances.size();
  return {to_numpy(std::move(rays.count), {n}), to_numpy(std::move(what), {m, 4}), to_numpy(std::move(distances), {m}),
          to_numpy(std::move(strengths), {m, 2})};
}

// Returns (K, 2) group and shape of each part.
OutArray<int32_t, 2> parts_of_groups(const Scene& scene) {
  std::vector<int32_t> found;
  for (const auto& [group, shape] : shapes_of_groups(scene)) found.insert(found.end(), {group, shape});
  const size_t n = found.size() / 2;
  return to_numpy(std::move(found), {n, 2});
}

// `parts`: (N, 4) shape, instance, outer instance, axes; `axes`: (B, 3, 4). Returns (N, 4) the box on the film, (N) the nearest
// depth, (N, 2, 3) the corners in the axes, and (N) the number of points that are not seen.
std::tuple<OutArray<double, 2>, OutArray<double, 1>, OutArray<double, 3>, OutArray<int64_t, 1>> extents(
    const Scene& scene, const InArray<int32_t>& parts, const InArray<double>& axes, int threads) {
  std::vector<ScenePart> asked;
  for (size_t i = 0; i + 3 < parts.size(); i += 4) {
    const int32_t* p = parts.data() + i;
    asked.push_back({p[0], p[1], p[2], p[3]});
  }
  std::vector<daffine> of;
  for (size_t i = 0; i + 11 < axes.size(); i += 12) of.push_back(affine_from_rows(axes.data() + i));
  std::vector<double> film, nearest, corners;
  std::vector<int64_t> unseen;
  {
    const nb::gil_scoped_release released;
    for (const Extent& e : find_extents(scene, threads, asked, of)) {
      film.insert(film.end(), std::begin(e.film), std::end(e.film));
      nearest.push_back(e.nearest), unseen.push_back(e.unseen);
      corners.insert(corners.end(), {e.low.x, e.low.y, e.low.z, e.high.x, e.high.y, e.high.z});
    }
  }
  const size_t n = nearest.size();
  return {to_numpy(std::move(film), {n, 4}), to_numpy(std::move(nearest), {n}), to_numpy(std::move(corners), {n, 2, 3}),
          to_numpy(std::move(unseen), {n})};
}

// Returns the surface of a part, given by shape, instance and outer instance: (N, 3) points in the world, and (M, 3) triangles.
std::tuple<OutArray<double, 2>, OutArray<uint32_t, 2>> surface_of_part(const Scene& scene, int32_t shape, int32_t instance,
                                                                       int32_t outer) {
  std::vector<double> points;
  std::vector<uint32_t> corners;
  {
    const nb::gil_scoped_release released;
    PartSurface surface = find_surface(scene, {shape, instance, outer, 0});
    for (const dvec3& p : surface.points) points.insert(points.end(), {p.x, p.y, p.z});
    corners = std::move(surface.corners);
  }
  const size_t n = points.size() / 3, m = corners.size() / 3;
  return {to_numpy(std::move(points), {n, 3}), to_numpy(std::move(corners), {m, 3})};
}

// `points`: (N, 3) in the world. Returns (N, 3) x and y in pixels of the frame, NaN where they are not seen, and depth.
OutArray<double, 2> project(const Scene& scene, const InArray<double>& points) {
  std::vector<dvec3> world;
  for (size_t i = 0; i + 2 < points.size(); i += 3)
    world.push_back({points.data()[i], points.data()[i + 1], points.data()[i + 2]});
  std::vector<double> found;
  const double nowhere = std::numeric_limits<double>::quiet_NaN();
  for (const ProjectedPoint& p : project_points(scene, world))
    found.insert(found.end(), {p.seen ? p.x : nowhere, p.seen ? p.y : nowhere, p.depth});
  const size_t n = world.size();
  return to_numpy(std::move(found), {n, 3});
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
  nb::class_<NumberedLayers>(m, "NumberedLayers")
      .def("parts", &parts_of_layers)
      .def("first", [](const NumberedLayers& l) { return to_numpy(std::vector<int32_t>(l.first), {l.first.size()}); })
      .def("depth", [](const NumberedLayers& l) { return to_numpy(std::vector<float>(l.depth), {l.depth.size()}); })
      .def("count_rays", &count_rays, nb::arg("places"), nb::arg("parents"))
      .def("rays_passing", &rays_passing, nb::arg("places"), nb::arg("parents"));
  m.def("numbered_layers", &numbered_layers, nb::arg("scene"), nb::arg("positions"), nb::arg("first_only"), nb::arg("lanes"),
        nb::arg("threads"));
  m.def("layers", &layers, nb::arg("scene"), nb::arg("positions"), nb::arg("first_only"), nb::arg("lanes"), nb::arg("threads"));
  m.def("returns", &returns, nb::arg("scene"), nb::arg("origins"), nb::arg("directions"), nb::arg("times"), nb::arg("reach"),
        nb::arg("weights"), nb::arg("least_alpha"), nb::arg("least_strength"), nb::arg("lanes"), nb::arg("threads"));
  m.def("project", &project, nb::arg("scene"), nb::arg("points"));
  m.def("parts_of_groups", &parts_of_groups, nb::arg("scene"));
  m.def("surface_of_part", &surface_of_part, nb::arg("scene"), nb::arg("shape"), nb::arg("instance"), nb::arg("outer"));
  m.def("extents", &extents, nb::arg("scene"), nb::arg("parts"), nb::arg("axes"), nb::arg("threads"));
}

}  // namespace primray
