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
      .def_rw("opacity_threshold", &SurfaceInput::opacity_threshold)
      .def_rw("presence", &SurfaceInput::presence)
      .def_rw("thin", &SurfaceInput::thin);
  for_each_input([&](InputField, const char* name, InputRange, auto member) {
    using Value = std::remove_cvref_t<decltype(member(std::declval<SurfaceInput&>()))>;
    surface.def_prop_rw(name, nullptr, [member](SurfaceInput& s, nb::handle v) {
      if constexpr (std::is_same_v<Value, vec3>)
        member(s) = vec3_of(v);
      else
        member(s) = nb::cast<Value>(v);
    });
  });
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
