// SceneBuilder and Scene for Python: arrays in, as description.py has them.
#include <nanobind/stl/string.h>
#include <nanobind/stl/unique_ptr.h>

#include <algorithm>

#include "base/error.hpp"
#include "bindings/arrays.hpp"
#include "bindings/surface_input.hpp"
#include "build/builder.hpp"

namespace primray {
namespace {

vec3 vec3_of(const nb::handle& h) { return {nb::cast<float>(h[0]), nb::cast<float>(h[1]), nb::cast<float>(h[2])}; }
dvec3 dvec3_of(const nb::handle& h) { return {nb::cast<double>(h[0]), nb::cast<double>(h[1]), nb::cast<double>(h[2])}; }

void add_mesh(SceneBuilder& b, InArray<float> points, InArray<int32_t> triangles, InArray<float> normals, int normal_kind,
              InArray<float> colors, int color_kind, InArray<int32_t> surfaces, InArray<double> matrix, bool cutout) {
  MeshInput m{span_of(points),        span_of(triangles),    span_of(normals),  span_of(colors),
              Attribute(normal_kind), Attribute(color_kind), span_of(surfaces), cutout};
  b.add_mesh(m, affine_of(matrix));
}

// (N, 2, 3): the least and greatest coordinates of every array of points; zeros where there are none.
nb::object boxes(nb::list arrays) {
  std::vector<double> out;
  out.reserve(6 * arrays.size());
  for (nb::handle each : arrays) {
    const InArray<float> array = nb::cast<InArray<float>>(each);  // a copy of its own where the array is not contiguous
    const std::span<const float> p = span_of(array);
    float low[3] = {0, 0, 0}, high[3] = {0, 0, 0};
    for (size_t i = 0; i < p.size(); ++i) {
      low[i % 3] = i < 3 ? p[i] : std::min(low[i % 3], p[i]);
      high[i % 3] = i < 3 ? p[i] : std::max(high[i % 3], p[i]);
    }
    out.insert(out.end(), low, low + 3), out.insert(out.end(), high, high + 3);
  }
  return to_numpy(std::move(out), {arrays.size(), 2, 3});
}

template <int N>
void read_numbers(nb::handle from, float (&to)[N]) {
  for (int i = 0; i < N; ++i) to[i] = nb::cast<float>(from[i]);
}

// The tuple that SurfaceUpload makes.
InputSource source_of(nb::handle t) {
  const auto number = [&](int i) { return nb::cast<int>(t[i]); };
  InputSource s;
  s.field = InputField(number(0)), s.primvar = number(1), s.texture = number(3);
  s.wrap_s = Wrap(number(4)), s.wrap_t = Wrap(number(5));
  read_numbers(t[2], s.fallback), read_numbers(t[6], s.st_transform), read_numbers(t[7], s.scale);
  read_numbers(t[8], s.bias), read_numbers(t[9], s.missing);
  s.tangents = number(10);
  return s;
}

int32_t add_surface(SceneBuilder& b, nb::handle surface, nb::list sources) {
  std::vector<InputSource> varying;
  for (nb::handle s : sources) varying.push_back(source_of(s));
  return b.add_surface(surface_of(surface), std::move(varying));
}

void set_texture_image(SceneBuilder& b, int texture, int tile, InArray<float> pixels) {
  b.set_texture_image(texture, tile, {span_of(pixels), int(pixels.shape(1)), int(pixels.shape(0))});
}

// Size, kept levels, bytes a channel and bytes of every image, in order.
nb::list texture_images(const Scene& scene) {
  nb::list r;
  for (const Texture& t : scene.textures) {
    for (const TextureImage& i : t.images) {
      nb::dict d;
      d["width"] = i.width, d["height"] = i.height, d["channels"] = i.channels;
      d["first_level"] = i.first_level, d["last_level"] = i.last_level;
      d["channel_bytes"] = i.format == TexelFormat::kFloat ? 4 : 2;
      d["bytes"] = i.memory_bytes();
      r.append(d);
    }
  }
  return r;
}

// `shaping`: a Shaping of lighting.py; `ies`: its profile's number, or -1.
ShapingInput shaping_of(nb::handle shaping, int ies) {
  const auto number = [&](const char* name) { return nb::cast<double>(shaping.attr(name)); };
  ShapingInput s;
  s.focus = number("focus"), s.focus_tint = vec3_of(shaping.attr("focus_tint"));
  s.cone_angle_deg = number("cone_angle_deg"), s.cone_softness = number("cone_softness");
  s.ies = ies, s.ies_angle_scale = number("ies_angle_scale");
  if (ies >= 0 && nb::cast<bool>(shaping.attr("ies_normalize")))
    s.ies_divisor = nb::cast<double>(shaping.attr("ies").attr("power"));
  return s;
}

// By placement: its group, its first instance, and the group that it stands in (0: the world); then the number of instances.
nb::tuple placements_of(const Scene& scene) {
  const size_t count = scene.placement_group.size();
  std::vector<int32_t> parent(count);
  for (size_t g = 0; g < scene.groups.size(); ++g)
    for (uint32_t k = 0; k < scene.groups[g].placement_count; ++k) parent[scene.groups[g].placement_base + k] = int32_t(g);
  return nb::make_tuple(to_numpy(std::vector(scene.placement_group), {count}),
                        to_numpy(std::vector(scene.placement_instance), {count}), to_numpy(std::move(parent), {count}),
                        scene.world_from_group.size() / 12);
}

// `light`: a Light of lighting.py.
LightInput light_input(int type, const InArray<double>& matrix, nb::handle light, int ies) {
  const auto number = [&](const char* name) { return nb::cast<double>(light.attr(name)); };
  LightInput l;
  l.type = LightType(type), l.world_from_light = affine_of(matrix), l.emission = vec3_of(light.attr("emission"));
  l.width = number("width"), l.height = number("height"), l.radius = number("radius"), l.length = number("length");
  l.angle_deg = number("angle_deg"), l.diffuse = float(number("diffuse")), l.specular = float(number("specular"));
  l.link = nb::cast<int>(light.attr("light_link")), l.casters = nb::cast<int>(light.attr("shadow_link"));
  l.visible_to_camera = nb::cast<bool>(light.attr("visible_to_camera"));
  if (const nb::object shadow = light.attr("shadow"); !shadow.is_none()) {
    l.casts_shadows = nb::cast<bool>(shadow.attr("enabled")), l.shadow_color = vec3_of(shadow.attr("color"));
    l.shadow_distance = nb::cast<double>(shadow.attr("distance"));
    l.shadow_falloff = nb::cast<double>(shadow.attr("falloff")),
    l.shadow_gamma = nb::cast<double>(shadow.attr("falloff_gamma"));
  }
  if (!light.attr("shaping").is_none()) l.shaping = shaping_of(light.attr("shaping"), ies);
  return l;
}

ImageInput image_input(const InArray<float>& pixels) {
  if (pixels.size() == 0) return {};
  return {span_of(pixels), int(pixels.shape(1)), int(pixels.shape(0))};
}

// `image`: a rectangle's texture, or -1. `portals`: rows of a matrix and two sizes, (N, 14).
void add_light(SceneBuilder& b, int type, InArray<double> matrix, nb::handle light, InArray<float> texture, int format,
               InArray<double> portals, int image, int ies) {
  LightInput l = light_input(type, matrix, light, ies);
  const ImageInput dome = image_input(texture);
  l.texture_width = dome.width, l.texture_height = dome.height, l.texels = dome.pixels, l.format = DomeFormat(format);
  for (size_t i = 0; i + 14 <= portals.size(); i += 14) {
    const double* p = portals.data() + i;
    l.portals.push_back({affine_from_rows(p), p[12], p[13]});
  }
  b.add_light(l, image);
}

// `light`: a Light of type GEOMETRY.
int add_geometry_light(SceneBuilder& b, InArray<double> matrix, nb::handle light, int ies) {
  LightInput l = light_input(int(LightType::kMesh), matrix, light, ies);
  l.normalize = nb::cast<bool>(light.attr("normalize"));
  l.own = nb::cast<bool>(light.attr("own_color")), l.shown = nb::cast<bool>(light.attr("shows_own"));
  return b.add_geometry_light(l);
}

}  // namespace

SurfaceInput surface_of(nb::handle s) {
  SurfaceInput r;
  r.lambert = nb::cast<bool>(s.attr("lambert"));
  r.diffuse_color = vec3_of(s.attr("diffuse_color")), r.emissive_color = vec3_of(s.attr("emissive_color"));
  r.use_specular_workflow = nb::cast<bool>(s.attr("use_specular_workflow")),
  r.specular_color = vec3_of(s.attr("specular_color"));
  const auto number = [&](const char* name) { return nb::cast<float>(s.attr(name)); };
  r.metallic = number("metallic"), r.roughness = number("roughness"), r.clearcoat = number("clearcoat");
  r.clearcoat_roughness = number("clearcoat_roughness"), r.opacity = number("opacity"), r.ior = number("ior");
  r.opacity_threshold = number("opacity_threshold");
  r.presence = nb::cast<bool>(s.attr("presence")), r.thin = nb::cast<bool>(s.attr("thin"));
  return r;
}

void bind_scene(nb::module_& m) {
  m.def("boxes", &boxes);
  nb::class_<Scene>(m, "Scene")
      .def_prop_ro("memory_bytes", &Scene::memory_bytes)
      .def_prop_ro("has_instances", [](const Scene& s) { return bool(s.has_instances); })
      .def_prop_ro("has_grouped", [](const Scene& s) { return bool(s.has_grouped); })
      .def_prop_ro("has_spheres", [](const Scene& s) { return bool(s.has_spheres); })
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
      .def_prop_ro("placements", &placements_of)
      .def_prop_ro("resolution",  // of its films
                   [](const Scene& s) { return nb::make_tuple(s.camera.pixels.width, s.camera.pixels.height); })
      .def_prop_ro("has_clipping_planes", [](const Scene& s) { return !s.camera.clipping_planes.empty(); })
      .def_prop_ro("has_shutter", [](const Scene& s) { return bool(s.camera.shutter_open); })
      .def_prop_ro("has_lens", [](const Scene& s) { return s.camera.lens_radius > 0; });
  nb::class_<SceneBuilder>(m, "SceneBuilder")
      .def("__init__", [](SceneBuilder* b, nb::handle origin, double scale) { new (b) SceneBuilder(dvec3_of(origin), scale); })
      .def("set_primvar_names", &SceneBuilder::set_primvar_names)
      .def("add_surface", &add_surface)
      .def("add_texture", &SceneBuilder::add_texture)
      .def("set_texture_image", &set_texture_image)
      .def("add_mesh_primvar",
           [](SceneBuilder& b, int name, int kind, int width, InArray<float> values) {
             b.add_mesh_primvar(name, PrimvarKind(kind), width, span_of(values));
           })
      .def("add_sphere_primvar", [](SceneBuilder& b, int name, int width,
                                    InArray<float> values) { b.add_sphere_primvar(name, width, span_of(values)); })
      .def("add_placement_primvar", [](SceneBuilder& b, int name, int width,
                                       InArray<float> values) { b.add_placement_primvar(name, width, span_of(values)); })
      .def("begin_prototype",
           [](SceneBuilder& b, nb::handle center, double scale) { return b.begin_prototype(dvec3_of(center), scale); })
      .def("add_mesh", &add_mesh)
      .def("add_sphere", [](SceneBuilder& b, double radius, int surface,
                            InArray<double> matrix) { return b.add_sphere(radius, surface, affine_of(matrix)); })
      .def_prop_ro("mesh_rows", &SceneBuilder::mesh_rows)
      .def_prop_ro("sphere_rows", &SceneBuilder::sphere_rows)
      .def_prop_ro("placement_rows", &SceneBuilder::placement_rows)
      .def("reserve_triangles", &SceneBuilder::reserve_triangles)
      .def("reserve_instances", &SceneBuilder::reserve_instances)
      .def("begin_placement", &SceneBuilder::begin_placement)
      .def("add_instances",
           [](SceneBuilder& b, InArray<double> rows) {
             std::vector<int64_t> left_out = b.add_instances(span_of(rows));
             const size_t count = left_out.size();
             return to_numpy(std::move(left_out), {count});
           })
      .def("end_placement", &SceneBuilder::end_placement)
      .def("set_links",
           [](SceneBuilder& b, InArray<uint8_t> members) {
             b.set_links(int(members.shape(0)), int(members.shape(1)), span_of(members));
           })
      .def("set_link_row", &SceneBuilder::set_link_row)
      .def("add_ies_profile",
           [](SceneBuilder& b, InArray<float> vertical_deg, InArray<float> horizontal_deg, InArray<float> candela,
              bool horizontal_pole) {
             if (candela.size() != vertical_deg.size() * horizontal_deg.size() || vertical_deg.size() < 2 ||
                 horizontal_deg.size() < 2)
               throw Error("internal", "a profile needs an intensity for every pair of angles, two or more of each");
             return b.add_ies_profile({span_of(vertical_deg), span_of(horizontal_deg), span_of(candela), horizontal_pole});
           })
      .def("add_light_image", [](SceneBuilder& b, InArray<float> pixels) { return b.add_light_image(image_input(pixels)); })
      .def("add_light", &add_light, nb::arg("type"), nb::arg("matrix"), nb::arg("light"), nb::arg("texture"), nb::arg("format"),
           nb::arg("portals"), nb::arg("image"), nb::arg("ies"))
      .def("add_geometry_light", &add_geometry_light, nb::arg("matrix"), nb::arg("light"), nb::arg("ies"))
      .def("wear_light", [](SceneBuilder& b, int light, InArray<double> matrix) { b.wear_light(light, affine_of(matrix)); })
      .def("set_camera",
           [](SceneBuilder& b, InArray<double> matrix, bool orthographic, nb::handle window, double near, double far,
              double lens_radius, double focus_distance, int blades, double blade_rotation_deg, InArray<double> clipping_planes,
              bool shutter_open, int width, int height, nb::handle pixels, float filter_width, InArray<float> inverse_cdf) {
             CameraInput c;
             c.world_from_camera = affine_of(matrix), c.orthographic = orthographic;
             for (int i = 0; i < 4; ++i) c.window[i] = nb::cast<double>(window[i]);
             c.near = near, c.far = far, c.lens_radius = lens_radius, c.focus_distance = focus_distance, c.width = width,
             c.height = height;
             const auto side = [&](int i) { return nb::cast<int>(pixels[i]); };
             c.pixels = {side(0), side(1), side(2), side(3)};
             c.blades = blades, c.blade_rotation_deg = blade_rotation_deg, c.shutter_open = shutter_open;
             c.clipping_planes = span_of(clipping_planes);
             c.filter_width = filter_width, c.filter_inverse_cdf = span_of(inverse_cdf);
             b.set_camera(c);
           })
      .def("finish", &SceneBuilder::finish, nb::call_guard<nb::gil_scoped_release>());
}

}  // namespace primray
