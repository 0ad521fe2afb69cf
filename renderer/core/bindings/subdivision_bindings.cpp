// Python binding of dice(): a cage's arrays as in primray/description/, the diced cage's as the result; and its
// displacement.
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "bindings/arrays.hpp"
#include "displacement/displacer.hpp"
#include "subdivision/dicing/dice.hpp"

namespace primray {
namespace {

using namespace subdivision;

template <class T>
std::span<const T> span_in(nb::handle dict, const char* name) {
  return span_of(nb::cast<InArray<T>>(dict[name]));
}

template <class T>
T number_in(nb::handle dict, const char* name) {
  return nb::cast<T>(dict[name]);
}

int width_of(nb::handle array) { return nb::cast<int>(array.attr("shape")[nb::int_(1)]); }

CageInput cage_of(nb::handle d) {
  CageInput c;
  c.scheme = Scheme(number_in<int>(d, "scheme"));
  c.boundary = Boundary(number_in<int>(d, "boundary"));
  c.smooth_triangles = number_in<bool>(d, "smooth_triangles");
  c.face_counts = span_in<int32_t>(d, "face_counts"), c.face_points = span_in<int32_t>(d, "face_points");
  c.holes = span_in<int32_t>(d, "holes");
  c.crease_lengths = span_in<int32_t>(d, "crease_lengths"), c.crease_points = span_in<int32_t>(d, "crease_points");
  c.crease_sharpnesses = span_in<float>(d, "crease_sharpnesses");
  c.corner_points = span_in<int32_t>(d, "corner_points"), c.corner_sharpnesses = span_in<float>(d, "corner_sharpnesses");
  c.points = int(span_in<float>(d, "points").size() / 3);
  return c;
}

Footprint footprint_of(nb::handle d) {
  Footprint f;
  f.projection.orthographic = number_in<bool>(d, "orthographic");
  f.projection.pixels_per_unit = number_in<double>(d, "pixels_per_unit");
  for (int i = 0; i < 4; ++i) f.projection.window[i] = nb::cast<double>(d["window"][nb::int_(i)]);
  f.projection.outside = number_in<double>(d, "outside");
  const std::span<const double> rows = span_in<double>(d, "views");
  const std::span<const double> sweeps = span_in<double>(d, "sweeps");
  for (size_t i = 0; i < rows.size() / 12; ++i)
    f.views.push_back({affine_from_rows(&rows[12 * i]), {sweeps[3 * i], sweeps[3 * i + 1], sweeps[3 * i + 2]}});
  f.density = number_in<double>(d, "density");
  return f;
}

DiceInput input_of(nb::handle d) {
  DiceInput in;
  in.cage = cage_of(d);
  in.rule = LinearRule(number_in<int>(d, "face_varying_rule"));
  in.points = span_in<float>(d, "points"), in.steps = span_in<float>(d, "steps");
  in.vertex_values = span_in<float>(d, "vertex_values"), in.vertex_width = width_of(d["vertex_values"]);
  in.varying_values = span_in<float>(d, "varying_values"), in.varying_width = width_of(d["varying_values"]);
  for (const nb::handle channel : d["face_varying"])
    in.face_varying.push_back({span_of(nb::cast<InArray<int32_t>>(channel[nb::int_(0)])),
                               span_of(nb::cast<InArray<float>>(channel[nb::int_(1)])), width_of(channel[nb::int_(1)])});
  in.footprint = footprint_of(d);
  in.pixels = number_in<double>(d, "pixels"), in.flatness = number_in<double>(d, "flatness");
  in.faces_differ = number_in<bool>(d, "faces_differ");
  in.min_level = number_in<int>(d, "min_level"), in.max_level = number_in<int>(d, "max_level");
  in.max_triangles = number_in<int64_t>(d, "max_triangles");
  return in;
}

ValuePlace place_in(nb::handle pair) {
  return {ValuePlace::Kind(nb::cast<int>(pair[nb::int_(0)])), nb::cast<int>(pair[nb::int_(1)])};
}

DisplacedShape shape_of(nb::handle d, const DiceInput& in) {
  DisplacedShape shape;
  shape.surfaces = span_in<int32_t>(d, "surfaces");
  shape.world_from_object = affine_of(nb::cast<InArray<double>>(d["world_from_object"]));
  for (const nb::handle p : d["primvars"]) {
    using Kind = CagePrimvar::Kind;
    CagePrimvar& made = shape.primvars.emplace_back();
    made.name = number_in<int>(p, "name"), made.kind = Kind(number_in<int>(p, "kind"));
    made.at = number_in<int>(p, "at"), made.width = number_in<int>(p, "width");
    made.values = span_in<float>(p, "values");
    made.row_width =
        made.kind == Kind::kVertex ? in.vertex_width : (made.kind == Kind::kVarying ? in.varying_width : made.width);
  }
  return shape;
}

// Sets `in.displacing` from the dictionary `d`; None: the cage has no displacement.
void set_displacing(nb::handle d, DiceInput& in) {
  if (d.is_none()) return;
  Displacing& how = in.displacing.emplace();
  how.st = place_in(d["st"]), how.normals = number_in<int>(d, "normals"), how.faces_differ = in.faces_differ;
  Displacer* displacer = nb::cast<Displacer*>(d["displacer"]);
  how.displace = [displacer, shape = shape_of(d, in)](const CornerRows& rows, std::span<float> out) {
    displacer->displace(shape, rows, out);
  };
}

// A diced cage as arrays: rows of coordinates, values and indices.
struct DicedCage {
  using Floats = OutArray<float, 2>;
  using Indices = OutArray<int32_t, 2>;
  Floats points, normals, vertex_values, varying_values;
  std::vector<Floats> step_points, step_normals;
  std::vector<std::pair<Indices, Floats>> face_varying;  // by channel: indices of the corners' values, and the values
  Indices triangles, normal_indices;
  OutArray<int32_t, 1> faces;
  int level, non_manifold_edges, unknown_creases;
  bool level_limited;
};

template <class T>
OutArray<T, 2> rows_of(std::vector<T> values, int width) {
  const size_t n = width ? values.size() / width : 0;
  return to_numpy(std::move(values), {n, size_t(width)});
}

DicedCage as_arrays(Diced d, const DiceInput& in) {
  DicedCage out;
  out.points = rows_of(std::move(d.points), 3), out.normals = rows_of(std::move(d.normals), 3);
  out.vertex_values = rows_of(std::move(d.vertex_values), in.vertex_width);
  out.varying_values = rows_of(std::move(d.varying_values), in.varying_width);
  for (std::vector<float>& step : d.step_points) out.step_points.push_back(rows_of(std::move(step), 3));
  for (std::vector<float>& step : d.step_normals) out.step_normals.push_back(rows_of(std::move(step), 3));
  for (size_t k = 0; k < in.face_varying.size(); ++k)
    out.face_varying.emplace_back(rows_of(std::move(d.triangles.values[k]), 3),
                                  rows_of(std::move(d.face_varying[k]), in.face_varying[k].width));
  out.triangles = rows_of(std::move(d.triangles.points), 3);
  out.normal_indices = rows_of(std::move(d.triangles.normals), 3);
  const size_t n = d.triangles.faces.size();
  out.faces = to_numpy(std::move(d.triangles.faces), {n});
  out.level = d.level, out.level_limited = d.is_level_limited;
  out.non_manifold_edges = d.non_manifold_edges, out.unknown_creases = d.unknown_creases;
  return out;
}

using CageArrays = nb::typed<nb::dict, nb::str, nb::object>;

// Returns None if the result would have more than max_triangles.
std::optional<DicedCage> dice_cage(CageArrays arrays) {
  DiceInput in = input_of(arrays);
  set_displacing(arrays["displacement"], in);
  Diced diced;
  {
    const nb::gil_scoped_release release;
    diced = dice(in);
  }
  if (!diced.is_complete) return std::nullopt;
  return as_arrays(std::move(diced), in);
}

int64_t estimate_cage(CageArrays arrays) {
  const DiceInput in = input_of(arrays);
  const nb::gil_scoped_release release;
  return estimated_triangles(in);
}

}  // namespace

void bind_subdivision(nb::module_& m) {
  nb::class_<Displacer>(m, "Displacer")
      .def(nb::init<>())
      .def("add_tape", [](Displacer& d, Tape tape) { return d.add_tape(std::move(tape)); })
      .def("add_surface", [](Displacer& d, const SurfaceInput& constants, std::vector<InputSource> varying,
                             int tape) { return d.add_surface(constants, std::move(varying), tape); })
      .def("add_texture", [](Displacer& d, int channels, bool udim, bool) { return d.add_texture(channels, udim); })
      .def("set_texture_image",
           [](Displacer& d, int texture, int tile, InArray<float> pixels) {
             d.set_texture_image(texture, tile, span_of(pixels), int(pixels.shape(1)), int(pixels.shape(0)));
           })
      .def("set_primvar_names", &Displacer::set_primvar_names)
      .def("set_directions", [](Displacer& d, const std::vector<int>& along) {
        std::vector<DisplacedAlong> made;
        for (const int a : along) made.push_back(DisplacedAlong(a));
        d.set_directions(std::move(made));
      });
  nb::class_<DicedCage>(m, "DicedCage")
      .def_ro("points", &DicedCage::points, kNewArray)
      .def_ro("normals", &DicedCage::normals, kNewArray)
      .def_ro("vertex_values", &DicedCage::vertex_values, kNewArray)
      .def_ro("varying_values", &DicedCage::varying_values, kNewArray)
      .def_ro("step_points", &DicedCage::step_points, kNewArray)
      .def_ro("step_normals", &DicedCage::step_normals, kNewArray)
      .def_ro("face_varying", &DicedCage::face_varying, kNewArray)
      .def_ro("triangles", &DicedCage::triangles, kNewArray)
      .def_ro("normal_indices", &DicedCage::normal_indices, kNewArray)
      .def_ro("faces", &DicedCage::faces, kNewArray)
      .def_ro("level", &DicedCage::level)
      .def_ro("level_limited", &DicedCage::level_limited)
      .def_ro("non_manifold_edges", &DicedCage::non_manifold_edges)
      .def_ro("unknown_creases", &DicedCage::unknown_creases);
  m.def("dice", &dice_cage, nb::arg("cage"));
  m.def("estimated_triangles", &estimate_cage, nb::arg("cage"));
}

}  // namespace primray
