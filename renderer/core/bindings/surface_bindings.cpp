// Surfaces for Python: their constants, and where the inputs that vary come from.
#include "bindings/inputs.hpp"
#include "bsdf/surface.hpp"
#include "bsdf/surface_inputs.hpp"

namespace primray {

void bind_surface(nb::module_& m) {
  nb::class_<SurfaceInput> surface(m, "SurfaceInput");
  surface.def(nb::init<>())
      .def_rw("lambert", &SurfaceInput::lambert)
      .def_rw("use_specular_workflow", &SurfaceInput::use_specular_workflow)
      .def_rw("metallic", &SurfaceInput::metallic)
      .def_rw("roughness", &SurfaceInput::roughness)
      .def_rw("clearcoat", &SurfaceInput::clearcoat)
      .def_rw("clearcoat_roughness", &SurfaceInput::clearcoat_roughness)
      .def_rw("opacity", &SurfaceInput::opacity)
      .def_rw("opacity_threshold", &SurfaceInput::opacity_threshold)
      .def_rw("ior", &SurfaceInput::ior)
      .def_rw("presence", &SurfaceInput::presence)
      .def_rw("thin", &SurfaceInput::thin);
  def_vec3(surface, "diffuse_color", &SurfaceInput::diffuse_color);
  def_vec3(surface, "emissive_color", &SurfaceInput::emissive_color);
  def_vec3(surface, "specular_color", &SurfaceInput::specular_color);
  nb::class_<InputSource> source(m, "InputSource");
  source.def(nb::init<>())
      .def_rw("field", &InputSource::field)
      .def_rw("primvar", &InputSource::primvar)
      .def_rw("tangents", &InputSource::tangents)
      .def_rw("texture", &InputSource::texture)
      .def_rw("wrap_s", &InputSource::wrap_s)
      .def_rw("wrap_t", &InputSource::wrap_t);
  def_numbers(source, "fallback", &InputSource::fallback);
  def_numbers(source, "st_transform", &InputSource::st_transform);
  def_numbers(source, "scale", &InputSource::scale);
  def_numbers(source, "bias", &InputSource::bias);
  def_numbers(source, "missing", &InputSource::missing);
}

}  // namespace primray
