// The extension module: one for each ISA class, with the same contents.
#include "base/error.hpp"
#include "base/memory_watch.hpp"
#include "base/time_spans.hpp"
#include "bindings/arrays.hpp"
#include "embree/embree.hpp"

#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

using namespace primray;

NB_MODULE(PRIMRAY_MODULE, m) {
  m.doc() = "primray's C++ core for one class of CPUs; use it through primray.core.";
  m.attr("ISA") = PRIMRAY_ISA;
  m.attr("MAX_LANES") = PRIMRAY_MAX_LANES;
  m.def("load_embree", &load_embree, nb::arg("path"), "Load the Embree library at this path; later calls do nothing.");
  m.def(
      "embree_memory",
      [] {
        const EmbreeMemory memory = embree_memory();
        return std::pair(memory.now, memory.peak);
      },
      "Return the current and peak memory of Embree in bytes.");
  m.def("limit_embree_memory", &limit_embree_memory, nb::arg("bytes"),
        "Limit the memory of Embree; builds that would exceed it fail.");
  m.def(
      "watch_memory",
      [](int64_t bytes, const std::string& before, const std::string& after, const std::string& json_before,
         const std::string& json_after,
         int exit_code) { watch_memory(bytes, {before, after, json_before, json_after, exit_code}); },
      nb::arg("bytes"), nb::arg("before") = "", nb::arg("after") = "", nb::arg("json_before") = "", nb::arg("json_after") = "",
      nb::arg("exit_code") = 4, "End the process with a message before it holds more than `bytes`; 0: stop watching.");
  m.def("record_spans", &record_spans, nb::arg("on"), "Start or stop recording time spans of the core's work.");
  m.def(
      "take_spans",
      [] {
        std::vector<std::tuple<const char*, int64_t, int64_t, int64_t>> rows;
        for (const RecordedSpan& s : take_spans()) rows.emplace_back(s.name, s.thread, s.begin_ns, s.end_ns);
        return rows;
      },
      "Return the recorded spans, each its name, thread, and begin and end in nanoseconds of time.monotonic_ns(), and forget "
      "them.");
  // Core errors carry a code; Python converts them to the classes of primray.errors.
  static PyObject* core_error = nb::exception<Error>(m, "CoreError").release().ptr();
  nb::register_exception_translator([](const std::exception_ptr& p, void*) {
    try {
      std::rethrow_exception(p);
    } catch (const Error& e) {
      const nb::tuple args = nb::make_tuple(e.code, std::string(e.what()));
      PyErr_SetObject(core_error, args.ptr());
    }
  });
  bind_facts(m);
  bind_settings(m);
  bind_scene(m);
  bind_film(m);
  bind_render(m);
  bind_first_hit(m);
  bind_subdivision(m);
  bind_polygons(m);
  nb::module_ testing = m.def_submodule("testing", "Array versions of the kernels' functions, for the tests.");
  bind_testing(testing);
  bind_caustics(m, testing);
}
