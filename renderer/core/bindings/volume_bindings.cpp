// Python bindings of volumes: grids, and media in them.
#include "bindings/inputs.hpp"
#include "bindings/volume_inputs.hpp"
#include "build/builder.hpp"

namespace primray {
namespace {

template <class Volume>
struct Held : Volume {
  InArray<double> held_matrices;
  InArray<float> held_times;
};
using HeldMedium = Held<MediumInput>;
using HeldEmission = Held<VolumeEmissionInput>;

// Defines how instances of a volume are handed over.
template <class Volume>
void def_instances(nb::class_<Volume>& type) {
  type.def_prop_rw("world_from_index", nullptr,
                   [](Volume& v, InArray<double> a) {
                     v.held_matrices = std::move(a), v.instances.world_from_index = span_of(v.held_matrices);
                   })
      .def_prop_rw("times", nullptr,
                   [](Volume& v, InArray<float> a) { v.held_times = std::move(a), v.instances.times = span_of(v.held_times); })
      .def_prop_rw("turns", nullptr, [](Volume& v, bool turns) { v.instances.turns = turns; });
}

// Returns the instances that were left out.
OutArray<int64_t, 1> left_out_of(std::vector<int64_t> left_out) {
  const size_t count = left_out.size();
  return to_numpy(std::move(left_out), {count});
}

}  // namespace

void bind_volumes(nb::module_& m, nb::class_<SceneBuilder>& builder) {
  nb::class_<HeldMedium> medium(m, "MediumInput");
  medium.def(nb::init<>())
      .def_rw("grid", &HeldMedium::grid)
      .def_rw("albedo_grid", &HeldMedium::albedo_grid)
      .def_rw("phase", &HeldMedium::phase)
      .def_rw("camera", &HeldMedium::camera);
  def_vec3(medium, "extinction", &HeldMedium::extinction);
  def_vec3(medium, "albedo", &HeldMedium::albedo);
  def_instances(medium);
  nb::class_<HeldEmission> emission(m, "VolumeEmissionInput");
  emission.def(nb::init<>()).def_rw("grid", &HeldEmission::grid).def_rw("camera", &HeldEmission::camera);
  def_vec3(emission, "emission", &HeldEmission::emission);
  def_instances(emission);
  builder
      .def(
          "add_grid",
          [](SceneBuilder& b, InArray<int32_t> leaf_origins, nb::object values, InArray<int32_t> tiles, nb::object tile_values,
             int channels) {
            return b.add_grid(GridArrays(std::move(leaf_origins), values, std::move(tiles), tile_values, channels).input);
          },
          nb::arg("leaf_origins"), nb::arg("values"), nb::arg("tiles"), nb::arg("tile_values"), nb::arg("channels") = 1)
      .def("add_blurred_grid", &SceneBuilder::add_blurred_grid, nb::arg("grid"), nb::arg("velocity"), nb::arg("frame"))
      .def("add_medium", [](SceneBuilder& b, const HeldMedium& input) { return left_out_of(b.add_medium(input)); })
      .def("add_volume_emission",
           [](SceneBuilder& b, const HeldEmission& input) { return left_out_of(b.add_volume_emission(input)); });
}

}  // namespace primray
