// Python bindings of the integrator's settings. Guides are kept by the owner of the scene.
#include "base/error.hpp"
#include "base/integrator_settings.hpp"
#include "bindings/arrays.hpp"
#include "guide/caustic_guide.hpp"
#include "guide/guide.hpp"
#include "route/route_tables.hpp"

namespace primray {
namespace {

// Converts (S, events), (S, ends) and a mask per class, as renderer/primray/light_paths creates them.
RouteTables tables_of(const InArray<uint8_t>& next, const InArray<uint8_t>& class_of, const InArray<uint32_t>& members,
                      int expressions, bool counts_straight, int leaves_out) {
  RouteTables t;
  const size_t states = next.size() / kRouteEvents, ends = states > 0 ? class_of.size() / states : 0;
  if (states < 1 || states > RouteTables::kMostStates || ends < 1 || ends >= RouteTables::kMostEnds ||
      expressions > RouteTables::kMostExpressions)
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
  m.attr("ROUTE_EVENTS") = int(kRouteEvents);
  m.attr("ROUTE_ENDS") = int(kRouteEnds);
  nb::class_<RouteTables>(m, "RouteTables")
      .def(
          "__init__",
          [](RouteTables* self, const InArray<uint8_t>& next, const InArray<uint8_t>& class_of,
             const InArray<uint32_t>& members, int expressions, bool counts_straight, int leaves_out) {
            new (self) RouteTables(tables_of(next, class_of, members, expressions, counts_straight, leaves_out));
          },
          nb::arg("next"), nb::arg("class_of"), nb::arg("members"), nb::arg("expressions"), nb::arg("counts_straight"),
          nb::arg("leaves_out") = -1)
      .def_ro("expressions", &RouteTables::expressions);
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
          "routes", nullptr, [](IntegratorSettings& s, const RouteTables* routes) { s.routes = routes; },
          nb::for_setter(nb::arg("routes").none()));
}

}  // namespace primray
