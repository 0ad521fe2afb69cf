// SceneBuilder and Scene for Python: arrays in, as description.py has them.
#include <nanobind/stl/string.h>
#include <nanobind/stl/unique_ptr.h>

#include "bindings/arrays.hpp"
#include "bindings/surface_input.hpp"
#include "scene/builder.hpp"
#include "scene/error.hpp"

namespace primray {
namespace {

vec3 vec3_of(const nb::handle& h) { return {nb::cast<float>(h[0]), nb::cast<float>(h[1]), nb::cast<float>(h[2])}; }
dvec3 dvec3_of(const nb::handle& h) { return {nb::cast<double>(h[0]), nb::cast<double>(h[1]), nb::cast<double>(h[2])}; }

void add_mesh(SceneBuilder& b, InArray<float> points, InArray<int32_t> triangles, InArray<float> normals, int normal_kind,
              InArray<float> colors, int color_kind, InArray<int32_t> surfaces, InArray<double> matrix) {
  MeshInput m{span_of(points),        span_of(triangles),    span_of(normals), span_of(colors),
              Attribute(normal_kind), Attribute(color_kind), span_of(surfaces)};
  b.add_mesh(m, affine_of(matrix));
}

void add_light(SceneBuilder& b, int type, InArray<double> matrix, nb::handle emission, double width, double height,
               double radius, double length, double angle_deg, float diffuse, float specular, InArray<float> texture) {
  LightInput l;
  l.type = LightType(type), l.world_from_light = affine_of(matrix), l.emission = vec3_of(emission);
  l.width = width, l.height = height, l.radius = radius, l.length = length, l.angle_deg = angle_deg;
  l.diffuse = diffuse, l.specular = specular;
  if (texture.size() > 0) l.texture_height = int(texture.shape(0)), l.texture_width = int(texture.shape(1));
  l.texels = span_of(texture);
  b.add_light(l);
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
  r.presence = nb::cast<bool>(s.attr("presence")), r.thin = nb::cast<bool>(s.attr("thin"));
  return r;
}

void bind_scene(nb::module_& m) {
  nb::class_<Scene>(m, "Scene")
      .def_prop_ro("memory_bytes", &Scene::memory_bytes)
      .def_ro("has_instances", &Scene::has_instances)
      .def_ro("has_grouped", &Scene::has_grouped)
      .def_ro("has_spheres", &Scene::has_spheres)
      .def_ro("has_attributes", &Scene::has_attributes)
      .def_ro("has_emission", &Scene::has_emission)
      .def_ro("has_thin", &Scene::has_thin)
      .def_prop_ro("sampled_lights", [](const Scene& s) { return s.lights.count; })
      .def_prop_ro("domes", [](const Scene& s) { return s.lights.domes.size(); })
      .def_prop_ro("has_lobe_factors", [](const Scene& s) { return s.lights.lobe_factors; })
      .def_prop_ro("has_lens", [](const Scene& s) { return s.camera.lens_radius > 0; });
  nb::class_<SceneBuilder>(m, "SceneBuilder")
      .def("__init__", [](SceneBuilder* b, nb::handle origin, double scale) { new (b) SceneBuilder(dvec3_of(origin), scale); })
      .def("add_surface", [](SceneBuilder& b, nb::handle s) { return b.add_surface(surface_of(s)); })
      .def("begin_prototype",
           [](SceneBuilder& b, nb::handle center, double scale) { return b.begin_prototype(dvec3_of(center), scale); })
      .def("add_mesh", &add_mesh)
      .def("add_sphere", [](SceneBuilder& b, double radius, int surface,
                            InArray<double> matrix) { b.add_sphere(radius, surface, affine_of(matrix)); })
      .def("reserve_instances", &SceneBuilder::reserve_instances)
      .def("begin_placement", &SceneBuilder::begin_placement)
      .def("add_instances", [](SceneBuilder& b, InArray<double> rows) { return b.add_instances(span_of(rows)); })
      .def("end_placement", &SceneBuilder::end_placement)
      .def("add_light", &add_light)
      .def(
          "set_camera",
          [](SceneBuilder& b, InArray<double> matrix, bool orthographic, nb::handle window, double near, double far,
             double lens_radius, double focus_distance, int width, int height, float filter_width, InArray<float> inverse_cdf) {
            CameraInput c;
            c.world_from_camera = affine_of(matrix), c.orthographic = orthographic;
            for (int i = 0; i < 4; ++i) c.window[i] = nb::cast<double>(window[i]);
            c.near = near, c.far = far, c.lens_radius = lens_radius, c.focus_distance = focus_distance, c.width = width,
            c.height = height;
            c.filter_width = filter_width, c.filter_inverse_cdf = span_of(inverse_cdf);
            b.set_camera(c);
          })
      .def("finish", &SceneBuilder::finish, nb::call_guard<nb::gil_scoped_release>());
}

}  // namespace primray
