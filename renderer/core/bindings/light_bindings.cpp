// Python bindings of lights, with their shaping, portals and images.
#include <nanobind/stl/optional.h>

#include "base/error.hpp"
#include "bindings/inputs.hpp"
#include "build/builder.hpp"

namespace primray {
namespace {

struct HeldLight : LightInput {
  InArray<float> held_texels, held_times;
  InArray<double> held_poses;
  std::vector<std::pair<InArray<float>, InArray<double>>> held_portals;
};

// Sets the image of a dome, (H, W, 3).
void set_texture(HeldLight& l, InArray<float> pixels) {
  l.held_texels = std::move(pixels);
  const ImageInput image = image_input(l.held_texels);
  l.texture_width = image.width, l.texture_height = image.height, l.texels = image.pixels;
}

// Sets portals: rows of a matrix and two sizes, (N, 14).
void set_portals(HeldLight& l, InArray<double> rows) {
  l.portals.clear();
  for (size_t i = 0; i + 14 <= rows.size(); i += 14) {
    const double* p = rows.data() + i;
    l.portals.push_back({affine_from_rows(p), p[12], p[13]});
  }
}

// Sets the motion of portal number `i`, as `times` and `pose_matrices` do for a light.
void set_portal_motion(HeldLight& l, int i, InArray<float> times, InArray<double> pose_matrices) {
  PortalInput& portal = l.portals.at(size_t(i));
  portal.times = span_of(times), portal.pose_matrices = span_of(pose_matrices);
  l.held_portals.emplace_back(std::move(times), std::move(pose_matrices));
}

int32_t add_ies_profile(SceneBuilder& b, InArray<float> vertical_deg, InArray<float> horizontal_deg, InArray<float> candela,
                        bool horizontal_pole) {
  if (candela.size() != vertical_deg.size() * horizontal_deg.size() || vertical_deg.size() < 2 || horizontal_deg.size() < 2)
    throw Error("internal", "an IES profile needs an intensity for every pair of angles, and at least two angles of each kind");
  return b.add_ies_profile({span_of(vertical_deg), span_of(horizontal_deg), span_of(candela), horizontal_pole});
}

}  // namespace

ImageInput image_input(const InArray<float>& pixels) {
  if (pixels.size() == 0) return {};
  return {span_of(pixels), int(pixels.shape(1)), int(pixels.shape(0))};
}

void bind_light(nb::module_& m, nb::class_<SceneBuilder>& builder) {
  nb::class_<ShapingInput> shaping(m, "ShapingInput");
  shaping.def(nb::init<>())
      .def_rw("focus", &ShapingInput::focus)
      .def_rw("cone_angle_deg", &ShapingInput::cone_angle_deg)
      .def_rw("cone_softness", &ShapingInput::cone_softness)
      .def_rw("ies", &ShapingInput::ies)
      .def_rw("ies_angle_scale", &ShapingInput::ies_angle_scale)
      .def_rw("ies_divisor", &ShapingInput::ies_divisor);
  def_vec3(shaping, "focus_tint", &ShapingInput::focus_tint);
  nb::class_<HeldLight> light(m, "LightInput");
  light.def(nb::init<>())
      .def_rw("type", &HeldLight::type)
      .def_rw("width", &HeldLight::width)
      .def_rw("height", &HeldLight::height)
      .def_rw("radius", &HeldLight::radius)
      .def_rw("length", &HeldLight::length)
      .def_rw("angle_deg", &HeldLight::angle_deg)
      .def_rw("diffuse", &HeldLight::diffuse)
      .def_rw("specular", &HeldLight::specular)
      .def_rw("light_link", &HeldLight::link)
      .def_rw("group", &HeldLight::group)
      .def_rw("shadow_link", &HeldLight::casters)
      .def_rw("visible_to_camera", &HeldLight::visible_to_camera)
      .def_rw("casts_shadows", &HeldLight::casts_shadows)
      .def_rw("shadow_distance", &HeldLight::shadow_distance)
      .def_rw("shadow_falloff", &HeldLight::shadow_falloff)
      .def_rw("shadow_gamma", &HeldLight::shadow_gamma)
      .def_rw("format", &HeldLight::format)
      .def_rw("earlier_dome", &HeldLight::earlier_dome)
      .def_rw("shaping", &HeldLight::shaping)
      .def_rw("own_color", &HeldLight::own)
      .def_rw("shows_own", &HeldLight::shown)
      .def_rw("normalize", &HeldLight::normalize)
      .def_prop_rw("texture", nullptr, &set_texture)
      .def_prop_rw("portals", nullptr, &set_portals)
      .def("set_portal_motion", &set_portal_motion);
  def_array(light, "times", &HeldLight::held_times, &HeldLight::times);
  def_array(light, "pose_matrices", &HeldLight::held_poses, &HeldLight::pose_matrices);
  def_matrix(light, "world_from_light", &HeldLight::world_from_light);
  def_vec3(light, "emission", &HeldLight::emission);
  def_vec3(light, "shadow_color", &HeldLight::shadow_color);
  builder.def("add_ies_profile", &add_ies_profile)
      .def("add_light_image", [](SceneBuilder& b, InArray<float> pixels) { return b.add_light_image(image_input(pixels)); })
      // `image`: texture of a rectangle light, or -1.
      .def("add_light", [](SceneBuilder& b, const HeldLight& l, int image) { return b.add_light(l, image); })
      .def("add_geometry_light", [](SceneBuilder& b, const HeldLight& l) { return b.add_geometry_light(l); })
      .def("set_light_of_shape", [](SceneBuilder& b, int light_number, InArray<double> matrix) {
        b.set_light_of_shape(light_number, affine_of(matrix));
      });
}

}  // namespace primray
