// Python bindings of the camera, with the film's window and filter.
#include "bindings/inputs.hpp"
#include "build/builder.hpp"

namespace primray {
namespace {

struct HeldDistortion : DistortionInput {
  InArray<double> held_coefficients;
  InArray<float> held_directions, held_places;
};

struct HeldCamera : CameraInput {
  HeldDistortion held_distortion;
  InArray<double> held_planes;
  InArray<float> held_filter, held_times;
  InArray<double> held_matrices, held_numbers;
};

// Sets x, y, width, height.
void set_pixels(HeldCamera& c, Numbers<int> window) {
  const auto side = [&](int i) { return nb::cast<int>(window[i]); };
  c.pixels = {side(0), side(1), side(2), side(3)};
}

void bind_distortion(nb::module_& m) {
  nb::class_<HeldDistortion> distortion(m, "DistortionInput");
  distortion.def(nb::init<>())
      .def_rw("model", &HeldDistortion::model)
      .def_rw("most_angle", &HeldDistortion::most_angle)
      .def_rw("table_columns", &HeldDistortion::table_columns)
      .def_rw("table_rows", &HeldDistortion::table_rows);
  def_numbers(distortion, "table_window", &HeldDistortion::table_window);
  def_array(distortion, "coefficients", &HeldDistortion::held_coefficients, &HeldDistortion::coefficients);
  def_array(distortion, "directions", &HeldDistortion::held_directions, &HeldDistortion::directions);
  def_array(distortion, "places", &HeldDistortion::held_places, &HeldDistortion::places);
}

void set_distortion(HeldCamera& c, const HeldDistortion& d) { c.held_distortion = d, c.distortion = c.held_distortion; }

}  // namespace

void bind_camera(nb::module_& m, nb::class_<SceneBuilder>& builder) {
  bind_distortion(m);
  nb::class_<HeldCamera> camera(m, "CameraInput");
  camera.def(nb::init<>())
      .def_rw("orthographic", &HeldCamera::orthographic)
      .def_rw("near", &HeldCamera::near)
      .def_rw("far", &HeldCamera::far)
      .def_rw("lens_radius", &HeldCamera::lens_radius)
      .def_rw("focus_distance", &HeldCamera::focus_distance)
      .def_rw("blades", &HeldCamera::blades)
      .def_rw("blade_rotation_deg", &HeldCamera::blade_rotation_deg)
      .def_rw("width", &HeldCamera::width)
      .def_rw("height", &HeldCamera::height)
      .def_rw("filter_width", &HeldCamera::filter_width)
      .def_prop_rw("pixels", nullptr, &set_pixels)
      .def_rw("natural_vignetting", &HeldCamera::natural_vignetting)
      .def_rw("rim_distance", &HeldCamera::rim_distance)
      .def_rw("rim_radius", &HeldCamera::rim_radius)
      .def_prop_rw("distortion", nullptr, &set_distortion);
  def_numbers(camera, "magnification", &HeldCamera::magnification);
  def_numbers(camera, "focus_shift", &HeldCamera::focus_shift);
  def_matrix(camera, "world_from_camera", &HeldCamera::world_from_camera);
  def_numbers(camera, "window", &HeldCamera::window);
  def_array(camera, "clipping_planes", &HeldCamera::held_planes, &HeldCamera::clipping_planes);
  def_array(camera, "times", &HeldCamera::held_times, &HeldCamera::times);
  def_array(camera, "pose_matrices", &HeldCamera::held_matrices, &HeldCamera::pose_matrices);
  def_array(camera, "pose_numbers", &HeldCamera::held_numbers, &HeldCamera::pose_numbers);
  def_array(camera, "filter_inverse_cdf", &HeldCamera::held_filter, &HeldCamera::filter_inverse_cdf);
  builder.def("set_camera", [](SceneBuilder& b, const HeldCamera& c) { b.set_camera(c); });
}

}  // namespace primray
