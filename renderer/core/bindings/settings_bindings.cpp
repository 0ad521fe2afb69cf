// What a user may ask of the integrator, for Python. Guides are those of the scene's owner, who keeps them.
#include "base/integrator_settings.hpp"
#include "bindings/arrays.hpp"
#include "guide/caustic_guide.hpp"
#include "guide/guide.hpp"

namespace primray {

void bind_settings(nb::module_& m) {
  nb::class_<IntegratorSettings>(m, "IntegratorSettings")
      .def(nb::init<>())
      .def_rw("max_depth", &IntegratorSettings::max_depth)
      .def_rw("threads", &IntegratorSettings::threads)
      .def_rw("seed", &IntegratorSettings::seed)
      .def_rw("splits", &IntegratorSettings::splits)
      .def_rw("screen_block", &IntegratorSettings::screen_block)
      .def_prop_rw(
          "light_samples", [](const IntegratorSettings& s) { return s.light_samples; },
          [](IntegratorSettings& s, int samples) {
            if (samples < 1 || samples > kMostLightSamples) throw nb::value_error("light_samples is not 1 to 4");
            s.light_samples = samples;
          })
      .def_prop_rw(
          "guide", nullptr, [](IntegratorSettings& s, const Guide* guide) { s.guide = guide; },
          nb::for_setter(nb::arg("guide").none()))
      .def_prop_rw(
          "caustics", nullptr, [](IntegratorSettings& s, const CausticGuide* caustics) { s.caustics = caustics; },
          nb::for_setter(nb::arg("caustics").none()));
}

}  // namespace primray
