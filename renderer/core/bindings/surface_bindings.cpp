// Python bindings of surfaces: constant inputs, sources of varying ones (textures, primvars), and tapes of pattern networks.
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "base/error.hpp"
#include "bindings/inputs.hpp"
#include "bsdf/surface.hpp"
#include "bsdf/surface_inputs.hpp"
#include "pattern/tape.hpp"

namespace primray {

namespace {

// A tape's code is one row per instruction: operation, width, steps, result, four operands, data.
constexpr size_t kCodeColumns = 9;

std::vector<Instruction> code_of(std::span<const int32_t> rows) {
  std::vector<Instruction> code;
  for (size_t i = 0; i + kCodeColumns <= rows.size(); i += kCodeColumns) {
    const int32_t* row = &rows[i];
    if (row[0] < 0 || row[0] >= int32_t(PatternOp::kCount) || row[1] < 1 || row[3] < 0 || row[3] + row[1] > kMostRegisters)
      throw Error("internal", "a tape has an unknown instruction");
    Instruction made;
    made.op = PatternOp(row[0]), made.width = uint8_t(row[1]), made.steps = uint16_t(row[2]), made.out = uint16_t(row[3]);
    for (size_t k = 0; k < 4; ++k) {
      if (row[4 + k] < 0 || row[4 + k] >= kMostRegisters)
        throw Error("internal", "a tape reads a register that does not exist");
      made.in[k] = uint16_t(row[4 + k]);
    }
    made.data = row[8];
    code.push_back(made);
  }
  return code;
}

std::vector<Tape::Output> outputs_of(std::span<const int32_t> rows) {
  if (rows.size() > size_t(3 * kMostOutputs)) throw Error("internal", "a tape has too many outputs");
  std::vector<Tape::Output> outputs;
  for (size_t i = 0; i + 3 <= rows.size(); i += 3) outputs.push_back({rows[i], rows[i + 1], rows[i + 2]});
  return outputs;
}

void bind_tape(nb::module_& m) {
  m.def("pattern_operations", [] { return std::vector<std::string>(std::begin(kPatternOpNames), std::end(kPatternOpNames)); });
  m.attr("PATTERN_REGISTERS") = kMostRegisters;
  nb::class_<PatternImage> image(m, "PatternImage");
  image.def(nb::init<>())
      .def_rw("color", &PatternImage::color)
      .def_rw("alpha", &PatternImage::alpha)
      .def_rw("wrap_s", &PatternImage::wrap_s)
      .def_rw("wrap_t", &PatternImage::wrap_t)
      .def_rw("closest", &PatternImage::closest)
      .def_rw("primvar", &PatternImage::primvar);
  def_numbers(image, "st_transform", &PatternImage::st_transform);
  nb::class_<Tape>(m, "Tape")
      .def(nb::init<>())
      .def_prop_rw("code", nullptr, [](Tape& t, InArray<int32_t> rows) { t.code = code_of(span_of(rows)); })
      .def_prop_rw("constants", nullptr, [](Tape& t, std::vector<float> values) { t.constants = std::move(values); })
      .def_prop_rw("images", nullptr, [](Tape& t, std::vector<PatternImage> images) { t.images = std::move(images); })
      .def_prop_rw("outputs", nullptr, [](Tape& t, InArray<int32_t> rows) { t.outputs = outputs_of(span_of(rows)); })
      .def_rw("asks_object_space", &Tape::asks_object_space);
}

// Binds the colour or number that `member` selects from the inputs.
template <class Inputs, class Member>
void def_input(nb::class_<Inputs>& c, const char* name, Member member) {
  using Value = std::remove_cvref_t<decltype(member(std::declval<Inputs&>()))>;
  if constexpr (std::is_same_v<Value, vec3>)
    c.def_prop_rw(name, nullptr, [member](Inputs& s, Numbers<float> v) { member(s) = vec3_of(v); });
  else
    c.def_prop_rw(name, nullptr, [member](Inputs& s, Value v) { member(s) = v; });
}

}  // namespace

void bind_surface(nb::module_& m) {
  bind_tape(m);
  nb::class_<OpenPbrInput> open_pbr(m, "OpenPbrInput");
  open_pbr.def(nb::init<>());
  for_each_open_pbr_input([&](const char* name, InputRange, auto member) { def_input<OpenPbrInput>(open_pbr, name, member); });
  nb::class_<HairInput> hair(m, "HairInput");
  hair.def(nb::init<>());
  for_each_hair_input([&](const char* name, InputRange, auto member) { def_input<HairInput>(hair, name, member); });
  nb::class_<VolumeInput> volume(m, "VolumeInput");
  volume.def(nb::init<>()).def_rw("phase", &VolumeInput::phase);
  def_vec3(volume, "extinction", &VolumeInput::extinction), def_vec3(volume, "scattering", &VolumeInput::scattering);
  def_vec3(volume, "emission", &VolumeInput::emission);
  nb::enum_<CameraVisibility>(m, "CameraVisibility")
      .value("seen", CameraVisibility::kSeen)
      .value("hidden", CameraVisibility::kHidden)
      .value("matte", CameraVisibility::kMatte);
  nb::class_<SurfaceInput> surface(m, "SurfaceInput");
  surface.def(nb::init<>())
      .def_rw("lambert", &SurfaceInput::lambert)
      .def_rw("use_specular_workflow", &SurfaceInput::use_specular_workflow)
      .def_rw("opacity_threshold", &SurfaceInput::opacity_threshold)
      .def_rw("dielectric_priority", &SurfaceInput::dielectric_priority)
      .def_rw("camera", &SurfaceInput::camera)
      .def_rw("presence", &SurfaceInput::presence)
      .def_rw("thin", &SurfaceInput::thin)
      .def_rw("interface", &SurfaceInput::interface);
  surface.def_prop_rw("open_pbr", nullptr, [](SurfaceInput& s, const OpenPbrInput& o) { s.open_pbr = o; });
  surface.def_prop_rw("hair", nullptr, [](SurfaceInput& s, const HairInput& h) { s.hair = h; });
  surface.def_prop_rw("volume", nullptr, [](SurfaceInput& s, const VolumeInput& v) { s.volume = v; });
  for_each_input(
      [&](InputField, const char* name, InputRange, auto member) { def_input<SurfaceInput>(surface, name, member); });
  nb::class_<InputSource> source(m, "InputSource");
  source.def(nb::init<>())
      .def_rw("field", &InputSource::field)
      .def_rw("primvar", &InputSource::primvar)
      .def_rw("tangents", &InputSource::tangents)
      .def_rw("texture", &InputSource::texture)
      .def_rw("output", &InputSource::output)
      .def_rw("wrap_s", &InputSource::wrap_s)
      .def_rw("wrap_t", &InputSource::wrap_t);
  def_numbers(source, "fallback", &InputSource::fallback);
  def_numbers(source, "st_transform", &InputSource::st_transform);
  def_numbers(source, "scale", &InputSource::scale);
  def_numbers(source, "bias", &InputSource::bias);
  def_numbers(source, "missing", &InputSource::missing);
}

}  // namespace primray
