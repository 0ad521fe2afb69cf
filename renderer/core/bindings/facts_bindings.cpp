// Python bindings of the core's constants: enumerations by name, sizes.
#include "bindings/arrays.hpp"
#include "bsdf/surface_inputs.hpp"
#include "film/film.hpp"
#include "light/dome/dome_format.hpp"
#include "light/light.hpp"
#include "scene/primvars.hpp"
#include "scene/scene.hpp"
#include "texture/lookup.hpp"

namespace primray {

void bind_facts(nb::module_& m) {
  m.attr("TILE") = kTile;
  m.attr("FILM_PIXEL_BYTES") = Film::kPixelBytes;
  nb::enum_<Attribute>(m, "Attribute")
      .value("NONE", Attribute::kNone)
      .value("TRIANGLE", Attribute::kTriangle)
      .value("VERTEX", Attribute::kVertex)
      .value("CORNER", Attribute::kCorner);
  nb::enum_<PrimvarKind>(m, "PrimvarKind")
      .value("CONSTANT", PrimvarKind::kConstant)
      .value("FACE", PrimvarKind::kFace)
      .value("POINT", PrimvarKind::kPoint)
      .value("CORNER", PrimvarKind::kCorner)
      .value("INSTANCE", PrimvarKind::kInstance);
  nb::enum_<Wrap>(m, "Wrap")
      .value("BLACK", Wrap::kBlack)
      .value("CLAMP", Wrap::kClamp)
      .value("REPEAT", Wrap::kRepeat)
      .value("MIRROR", Wrap::kMirror);
  nb::enum_<InputField> inputs(m, "InputField");
  for_each_input([&](InputField field, const char* name, InputRange, auto) { inputs.value(name, field); });
  inputs.value("normal", InputField::kNormal);
  int own = 0;
  for_each_open_pbr_input(
      [&](const char* name, InputRange, auto) { inputs.value(open_pbr_name(name).c_str(), open_pbr_field(own++)); });
  int of_hair = 0;
  for_each_hair_input(
      [&](const char* name, InputRange, auto) { inputs.value(hair_name(name).c_str(), hair_field(of_hair++)); });
  nb::enum_<LightType> lights(m, "LightType");
  for_light_types([&]<class T>(T) { lights.value(T::kName, T::kType); });
  nb::enum_<DomeFormat>(m, "DomeFormat")
      .value("LAT_LONG", DomeFormat::kLatLong)
      .value("MIRRORED_BALL", DomeFormat::kMirroredBall)
      .value("ANGULAR", DomeFormat::kAngular)
      .value("VERTICAL_CROSS", DomeFormat::kVerticalCross);
}

}  // namespace primray
