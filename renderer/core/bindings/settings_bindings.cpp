// Python bindings of the integrator's settings, and of the core's constants: enumerations by name, sizes. Guides are kept by
// the owner of the scene.

#include "base/error.hpp"
#include "base/integrator_settings.hpp"
#include "bindings/arrays.hpp"
#include "bsdf/surface_inputs.hpp"
#include "film/film.hpp"
#include "guiding/caustic_guide.hpp"
#include "guiding/guide.hpp"
#include "light/dome/dome_format.hpp"
#include "light/light.hpp"
#include "lpe/automaton.hpp"
#include "scene/scene.hpp"
#include "texture/lookup.hpp"

namespace primray {

// Python bindings of the core's constants: enumerations by name, sizes.
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

namespace {

// Converts (S, events), (S, ends) and a mask per class, as renderer/primray/lpe/automaton.py creates them.
LpeAutomaton automaton_of(const InArray<uint8_t>& next, const InArray<uint8_t>& class_of, const InArray<uint32_t>& members,
                          int expressions, bool counts_straight, int leaves_out) {
  LpeAutomaton t;
  const size_t states = next.size() / kLpeEvents, ends = states > 0 ? class_of.size() / states : 0;
  if (states < 1 || states > LpeAutomaton::kMostStates || ends < 1 || ends >= LpeAutomaton::kMostEnds ||
      expressions > LpeAutomaton::kMostExpressions)
    throw Error("internal", "light path expressions do not fit the core's tables");
  std::copy_n(next.data(), next.size(), t.next.begin());
  t.class_of.assign(class_of.data(), class_of.data() + class_of.size());
  t.members.assign(members.data(), members.data() + members.size());
  t.ends = int(ends), t.expressions = expressions, t.counts_straight = counts_straight;
  t.leaves_out = leaves_out;
  for (const uint8_t of : t.class_of)
    if (of >= t.members.size()) throw Error("internal", "a light path has an unknown class");
  return t;
}

}  // namespace

void bind_settings(nb::module_& m) {
  m.attr("LPE_EVENTS") = int(kLpeEvents);
  m.attr("LPE_ENDS") = int(kLpeEnds);
  nb::class_<LpeAutomaton>(m, "LpeAutomaton")
      .def(
          "__init__",
          [](LpeAutomaton* self, const InArray<uint8_t>& next, const InArray<uint8_t>& class_of,
             const InArray<uint32_t>& members, int expressions, bool counts_straight, int leaves_out) {
            new (self) LpeAutomaton(automaton_of(next, class_of, members, expressions, counts_straight, leaves_out));
          },
          nb::arg("next"), nb::arg("class_of"), nb::arg("members"), nb::arg("expressions"), nb::arg("counts_straight"),
          nb::arg("leaves_out") = -1)
      .def_ro("expressions", &LpeAutomaton::expressions);
  nb::class_<Cancellation>(m, "Cancellation")
      .def(nb::init<>())
      .def("ask", [](Cancellation& c) { c.asked = true; })
      .def("clear", [](Cancellation& c) { c.asked = false; })
      .def_prop_ro("is_asked", [](const Cancellation& c) { return c.asked.load(); });
  nb::class_<IntegratorSettings>(m, "IntegratorSettings")
      .def(nb::init<>())
      .def_rw("max_depth", &IntegratorSettings::max_depth)
      .def_rw("threads", &IntegratorSettings::threads)
      .def_rw("seed", &IntegratorSettings::seed)
      .def_rw("splits", &IntegratorSettings::splits)
      .def_rw("clamp_indirect", &IntegratorSettings::clamp_indirect)
      .def_rw("screen_block", &IntegratorSettings::screen_block)
      .def_prop_rw(
          "light_samples", [](const IntegratorSettings& s) { return s.light_samples; },
          [](IntegratorSettings& s, int samples) {
            if (samples < 1 || samples > kMostLightSamples) throw nb::value_error("light_samples must be 1 to 4");
            s.light_samples = samples;
          })
      .def_prop_rw(
          "guide", nullptr, [](IntegratorSettings& s, const Guide* guide) { s.guide = guide; },
          nb::for_setter(nb::arg("guide").none()))
      .def_prop_rw(
          "caustics", nullptr, [](IntegratorSettings& s, const CausticGuide* caustics) { s.caustics = caustics; },
          nb::for_setter(nb::arg("caustics").none()))
      .def_prop_rw(
          "cancel", nullptr,
          [](IntegratorSettings& s, const Cancellation* cancel) { s.cancel = cancel ? &cancel->asked : nullptr; },
          nb::for_setter(nb::arg("cancel").none()))
      .def_prop_rw(
          "lpe", nullptr, [](IntegratorSettings& s, const LpeAutomaton* lpe) { s.lpe = lpe; },
          nb::for_setter(nb::arg("lpe").none()));
}

}  // namespace primray
