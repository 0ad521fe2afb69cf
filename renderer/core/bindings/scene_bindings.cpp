// Python bindings of SceneBuilder and Scene: arrays as in primray/description/.
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/unique_ptr.h>
#include <nanobind/stl/vector.h>

#include "bindings/inputs.hpp"
#include "build/builder.hpp"
#include "texture/tile_file.hpp"

namespace primray {
namespace {

// Textures and domes of a scene that is not rendered any more.
struct KeptTextures {
  std::vector<Texture> textures;
  std::vector<Dome> domes;
};

void set_texture_image(SceneBuilder& b, int texture, int tile, InArray<float> pixels) {
  const ImageInput image{span_of(pixels), int(pixels.shape(1)), int(pixels.shape(0))};
  const nb::gil_scoped_release release;
  b.set_texture_image(texture, tile, image);
}

nb::typed<nb::dict, nb::str, int64_t> counts_of(const TileMemory& memory) {
  const TileMemory::Counts c = memory.counts();
  nb::typed<nb::dict, nb::str, int64_t> r;
  r["images"] = c.images, r["tiles_read"] = c.reads, r["bytes_read"] = c.read_bytes, r["read_nanoseconds"] = c.read_nanoseconds;
  r["tiles_evicted"] = c.evictions, r["resident_bytes"] = c.resident_bytes, r["peak_bytes"] = c.peak_bytes;
  return r;
}

void bind_tiles(nb::module_& m) {
  nb::class_<TileMemory>(m, "TileMemory")
      .def(nb::init<int64_t>(), nb::arg("budget_bytes"))
      .def_prop_ro("budget_bytes", &TileMemory::budget_bytes)
      .def_prop_ro("counts", &counts_of)
      .def("take_fault", &TileMemory::take_fault);
  m.def(
      "write_tile_file",
      [](int file, const std::string& key, InArray<float> pixels, int first_level) {
        const nb::gil_scoped_release unlocked;
        write_tile_file(file, key, span_of(pixels), int(pixels.shape(1)), int(pixels.shape(0)), int(pixels.shape(2)),
                        first_level);
      },
      nb::arg("file"), nb::arg("key"), nb::arg("pixels"), nb::arg("first_level"));
}

// Returns size, kept levels, bytes per channel and bytes of every image, in order.
nb::typed<nb::list, nb::typed<nb::dict, nb::str, int64_t>> texture_images(const Scene& scene) {
  nb::typed<nb::list, nb::typed<nb::dict, nb::str, int64_t>> r;
  for (const Texture& t : scene.textures) {
    for (const TextureImage& i : t.images) {
      nb::dict d;
      d["width"] = i.width, d["height"] = i.height, d["channels"] = i.channels;
      d["first_level"] = i.first_level, d["last_level"] = i.last_level;
      d["channel_bytes"] = i.format == TexelFormat::kFloat ? 4 : 2;
      d["bytes"] = i.memory_bytes();
      d["by_tile"] = i.tiles ? 1 : 0;
      r.append(d);
    }
  }
  return r;
}

// Returns by placement: its group, its first instance, and the group that contains it (0: the world); then the number of
// instances.
std::tuple<OutArray<int32_t, 1>, OutArray<int32_t, 1>, OutArray<int32_t, 1>, size_t> placements_of(const Scene& scene) {
  const size_t count = scene.placement_group.size();
  std::vector<int32_t> parent(count);
  for (size_t g = 0; g < scene.groups.size(); ++g)
    for (uint32_t k = 0; k < scene.groups[g].placement_count; ++k) parent[scene.groups[g].placement_base + k] = int32_t(g);
  return {to_numpy(std::vector(scene.placement_group), {count}), to_numpy(std::vector(scene.placement_instance), {count}),
          to_numpy(std::move(parent), {count}), scene.world_from_group.size() / 12};
}

}  // namespace

void bind_scene(nb::module_& m) {
  nb::class_<FogInput> fog(m, "FogInput");
  fog.def(nb::init<>())
      .def_rw("density", &FogInput::density)
      .def_rw("phase", &FogInput::phase)
      .def_rw("falloff", &FogInput::falloff)
      .def_rw("hidden", &FogInput::hidden)
      .def_prop_rw("top", nullptr, [](FogInput& f, Numbers<double> v) { f.top = dvec3_of(v); })
      .def_prop_rw("up", nullptr, [](FogInput& f, Numbers<double> v) { f.up = dvec3_of(v); });
  def_vec3(fog, "albedo", &FogInput::albedo), def_vec3(fog, "emission", &FogInput::emission);
  bind_tiles(m);
  nb::class_<Scene>(m, "Scene")
      .def_prop_ro("memory_bytes", &Scene::memory_bytes)
      .def_prop_ro("has_instances", [](const Scene& s) { return bool(s.has_instances); })
      .def_prop_ro("has_grouped", [](const Scene& s) { return bool(s.has_grouped); })
      .def_prop_ro("has_curves", [](const Scene& s) { return bool(s.curves.any); })
      .def_prop_ro("has_spheres", [](const Scene& s) { return s.curved.has<SphereShape>(); })
      .def_prop_ro("has_attributes", [](const Scene& s) { return bool(s.has_attributes); })
      .def_prop_ro("has_inputs", [](const Scene& s) { return bool(s.has_inputs); })
      .def_prop_ro("has_cutouts", [](const Scene& s) { return bool(s.has_cutouts); })
      .def_prop_ro("textures", [](const Scene& s) { return s.textures.size(); })
      .def_prop_ro("texture_bytes", &Scene::texture_bytes)
      .def_prop_ro("texture_images", &texture_images)
      .def_prop_ro("has_emission", [](const Scene& s) { return bool(s.has_emission); })
      .def_prop_ro("has_thin", [](const Scene& s) { return bool(s.has_thin); })
      .def_prop_ro("emitters", [](const Scene& s) { return s.emitters.shapes; })
      .def_prop_ro("unsampled_emitters", [](const Scene& s) { return s.emitters.unsampled; })
      .def_prop_ro("sampled_lights", [](const Scene& s) { return s.lights.count; })
      .def_prop_ro("light_images", [](const Scene& s) { return s.lights.images.size(); })
      .def_prop_ro("geometry_lights", [](const Scene& s) { return s.geometry_lights.all.size(); })
      .def_prop_ro("has_portals", [](const Scene& s) { return !s.lights.portals.empty(); })
      .def_prop_ro("domes", [](const Scene& s) { return s.lights.domes.size(); })
      .def_prop_ro("has_shaping", [](const Scene& s) { return bool(s.lights.has_shaping); })
      .def_prop_ro("has_links", [](const Scene& s) { return s.lights.links.any(); })
      .def_prop_ro("has_special_shadows", [](const Scene& s) { return !s.lights.shadow_rows.empty(); })
      .def_prop_ro("has_lobe_factors", [](const Scene& s) { return bool(s.lights.lobe_factors); })
      .def_prop_ro("placements", &placements_of, kNewArray)
      .def_prop_ro("resolution",  // of its films
                   [](const Scene& s) { return std::pair(s.camera.pixels.width, s.camera.pixels.height); })
      .def_prop_ro("has_clipping_planes", [](const Scene& s) { return !s.camera.clipping_planes.empty(); })
      .def_prop_ro("has_moving_camera", [](const Scene& s) { return bool(s.camera.moves); })
      .def_prop_ro("has_moving_instances", [](const Scene& s) { return bool(s.motion.any_instances); })
      .def_prop_ro("has_moving_volumes", [](const Scene& s) { return s.volumes && s.volumes->any_moves(); })
      .def_prop_ro("has_moving_points", [](const Scene& s) { return bool(s.motion.any_points); })
      .def_prop_ro("has_moving_lights", [](const Scene& s) { return s.lights.motion.any(); })
      .def_prop_ro("media", [](const Scene& s) { return s.volumes ? s.volumes->media.size() : 0; })
      .def_prop_ro("volumes",
                   [](const Scene& s) { return s.volumes ? s.volumes->in_media.size() + s.volumes->in_emissions.size() : 0; })
      .def_prop_ro("has_lens", [](const Scene& s) { return s.camera.lens_radius > 0; });
  nb::class_<KeptTextures>(m, "KeptTextures").def("__init__", [](KeptTextures* kept, Scene& scene) {
    new (kept) KeptTextures{std::move(scene.textures), std::move(scene.lights.domes)};
  });
  nb::class_<SceneBuilder> builder(m, "SceneBuilder");
  builder
      .def("__init__",
           [](SceneBuilder* b, Numbers<double> origin, double scale) { new (b) SceneBuilder(dvec3_of(origin), scale); })
      .def("__init__", [](SceneBuilder* b, std::unique_ptr<Scene> scene) { new (b) SceneBuilder(std::move(scene)); })
      .def("keeps_means", &SceneBuilder::keeps_means)
      .def("drop_surfaces_and_lights", &SceneBuilder::drop_surfaces_and_lights)
      .def("release_coarse_textures", &SceneBuilder::release_coarse_textures)
      .def("take_texture_images",
           [](SceneBuilder& b, int texture, KeptTextures& earlier, int number) {
             return b.take_texture_images(texture, earlier.textures.at(size_t(number)));
           })
      .def("keep_domes", [](SceneBuilder& b, KeptTextures& earlier) { b.keep_domes(std::move(earlier.domes)); })
      .def("set_primvar_names", &SceneBuilder::set_primvar_names)
      .def("add_surface", [](SceneBuilder& b, const SurfaceInput& constants, std::vector<InputSource> varying,
                             int tape) { return b.add_surface(constants, std::move(varying), tape); })
      .def("add_tape", [](SceneBuilder& b, Tape tape) { return b.add_tape(std::move(tape)); })
      .def("add_texture", &SceneBuilder::add_texture)
      .def("set_texture_image", &set_texture_image)
      .def("finest_texture_level", &SceneBuilder::finest_texture_level)
      .def(
          "set_texture_tiles",
          [](SceneBuilder& b, int texture, int tile, const std::string& path, const std::string& key,
             std::shared_ptr<TileMemory> memory) {
            const nb::gil_scoped_release unlocked;
            b.set_texture_tiles(texture, tile, path, key, std::move(memory));
          },
          nb::arg("texture"), nb::arg("tile"), nb::arg("path"), nb::arg("key"), nb::arg("memory").none())
      .def("add_placement_primvar", [](SceneBuilder& b, int name, int width,
                                       InArray<float> values) { b.add_placement_primvar(name, width, span_of(values)); })
      .def("begin_prototype",
           [](SceneBuilder& b, Numbers<double> center, double scale) { return b.begin_prototype(dvec3_of(center), scale); })
      .def_prop_ro("mesh_rows", &SceneBuilder::mesh_rows)
      .def_prop_ro("curved_rows", &SceneBuilder::curved_rows)
      .def_prop_ro("placement_rows", &SceneBuilder::placement_rows)
      .def("reserve_triangles", &SceneBuilder::reserve_triangles)
      .def("reserve_instances", &SceneBuilder::reserve_instances)
      .def("begin_placement", &SceneBuilder::begin_placement)
      .def(
          "add_point_instances",
          [](SceneBuilder& b, const std::optional<InArray<double>>& outer, const InArray<double>& positions,
             const std::optional<InArray<double>>& orientations, const std::optional<InArray<double>>& scales) {
            const std::optional<daffine> around = outer ? std::optional(affine_of(*outer)) : std::nullopt;
            const auto given = [](const auto& array) { return array ? span_of(*array) : std::span<const double>(); };
            std::vector<int64_t> left_out =
                b.add_point_instances(around ? &*around : nullptr, span_of(positions), given(orientations), given(scales));
            const size_t count = left_out.size();
            return to_numpy(std::move(left_out), {count});
          },
          nb::arg("outer").none(), nb::arg("positions"), nb::arg("orientations").none(), nb::arg("scales").none())
      .def("add_instances",
           [](SceneBuilder& b, InArray<double> rows) {
             std::vector<int64_t> left_out = b.add_instances(span_of(rows));
             const size_t count = left_out.size();
             return to_numpy(std::move(left_out), {count});
           })
      .def("add_moving_instances",
           [](SceneBuilder& b, InArray<float> times, bool turns, InArray<double> rows) {
             std::vector<int64_t> left_out = b.add_moving_instances(span_of(times), turns, span_of(rows));
             const size_t count = left_out.size();
             return to_numpy(std::move(left_out), {count});
           })
      .def("set_fog", &SceneBuilder::set_fog)
      .def("set_exposure", &SceneBuilder::set_exposure)
      .def("set_rolling_shutter", &SceneBuilder::set_rolling_shutter)
      .def("end_placement", &SceneBuilder::end_placement)
      .def("set_links",
           [](SceneBuilder& b, InArray<uint8_t> members) {
             b.set_links(int(members.shape(0)), int(members.shape(1)), span_of(members));
           })
      .def("set_link_row", &SceneBuilder::set_link_row)
      .def("finish", &SceneBuilder::finish, nb::call_guard<nb::gil_scoped_release>());
  bind_surface(m);
  bind_shapes(m, builder);
  bind_light(m, builder);
  bind_volumes(m, builder);
  bind_camera(m, builder);
}

}  // namespace primray
