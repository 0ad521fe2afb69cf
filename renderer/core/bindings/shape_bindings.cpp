// Python bindings of meshes, curves, spheres and their primvars, and bounding boxes of arrays of points.
#include <algorithm>

#include "bindings/inputs.hpp"
#include "build/builder.hpp"

namespace primray {
namespace {

struct HeldMesh : MeshInput {
  InArray<float> held_points, held_normals, held_colors, held_times, held_step_points, held_step_normals;
  InArray<int32_t> held_triangles, held_surfaces;
};

// Returns (N, 2, 3): the lower and upper corners of the bounding box of each array of points; zeros for an empty array.
OutArray<double, 3> boxes(nb::typed<nb::sequence, InArray<float>> arrays) {
  std::vector<double> out;
  const size_t count = nb::len(arrays);
  out.reserve(6 * count);
  for (nb::handle each : arrays) {
    const InArray<float> array = nb::cast<InArray<float>>(each);  // a copy if the array is not contiguous
    const std::span<const float> p = span_of(array);
    float low[3] = {0, 0, 0}, high[3] = {0, 0, 0};
    for (size_t i = 0; i < p.size(); ++i) {
      low[i % 3] = i < 3 ? p[i] : std::min(low[i % 3], p[i]);
      high[i % 3] = i < 3 ? p[i] : std::max(high[i % 3], p[i]);
    }
    out.insert(out.end(), low, low + 3), out.insert(out.end(), high, high + 3);
  }
  return to_numpy(std::move(out), {count, 2, 3});
}

// Adds meshes of one surface each, without attributes: in one call, since there may be a million. `matrices`: (N, 4, 4).
void add_plain_meshes(SceneBuilder& builder, const nb::typed<nb::sequence, InArray<float>>& points,
                      const nb::typed<nb::sequence, InArray<int32_t>>& triangles, const InArray<int32_t>& surfaces,
                      const InArray<double>& matrices) {
  for (size_t i = 0; i < surfaces.size(); ++i) {
    const auto own_points = nb::cast<InArray<float>>(points[i]);
    const auto own_triangles = nb::cast<InArray<int32_t>>(triangles[i]);
    MeshInput mesh;
    mesh.points = span_of(own_points), mesh.triangles = span_of(own_triangles), mesh.surfaces = {&surfaces.data()[i], 1};
    builder.add_mesh(mesh, affine_from_rows(matrices.data() + 16 * i));
  }
}

struct HeldCurves : CurvesInput {
  InArray<float> held_points, held_times, held_step_points;
  InArray<int32_t> held_segments, held_surfaces;
};

}  // namespace

void bind_shapes(nb::module_& m, nb::class_<SceneBuilder>& builder) {
  m.def("boxes", &boxes);
  nb::class_<HeldMesh> mesh(m, "MeshInput");
  mesh.def(nb::init<>())
      .def_rw("normal_kind", &HeldMesh::normal_kind)
      .def_rw("color_kind", &HeldMesh::color_kind)
      .def_rw("cutout", &HeldMesh::cutout);
  def_array(mesh, "points", &HeldMesh::held_points, &HeldMesh::points);
  def_array(mesh, "triangles", &HeldMesh::held_triangles, &HeldMesh::triangles);
  def_array(mesh, "normals", &HeldMesh::held_normals, &HeldMesh::normals);
  def_array(mesh, "colors", &HeldMesh::held_colors, &HeldMesh::colors);
  def_array(mesh, "times", &HeldMesh::held_times, &HeldMesh::times);
  def_array(mesh, "step_points", &HeldMesh::held_step_points, &HeldMesh::step_points);
  def_array(mesh, "step_normals", &HeldMesh::held_step_normals, &HeldMesh::step_normals);
  def_array(mesh, "surfaces", &HeldMesh::held_surfaces, &HeldMesh::surfaces);
  nb::class_<HeldCurves> curves(m, "CurvesInput");
  curves.def(nb::init<>()).def_rw("closed", &HeldCurves::closed).def_rw("joined", &HeldCurves::joined);
  def_array(curves, "points", &HeldCurves::held_points, &HeldCurves::points);
  def_array(curves, "segments", &HeldCurves::held_segments, &HeldCurves::segments);
  def_array(curves, "surfaces", &HeldCurves::held_surfaces, &HeldCurves::surfaces);
  def_array(curves, "times", &HeldCurves::held_times, &HeldCurves::times);
  def_array(curves, "step_points", &HeldCurves::held_step_points, &HeldCurves::step_points);
  builder
      .def("add_curves",
           [](SceneBuilder& b, const HeldCurves& input, InArray<double> matrix) { b.add_curves(input, affine_of(matrix)); })
      .def("add_mesh",
           [](SceneBuilder& b, const HeldMesh& input, InArray<double> matrix) { b.add_mesh(input, affine_of(matrix)); })
      .def("add_plain_meshes", &add_plain_meshes, nb::arg("points"), nb::arg("triangles"), nb::arg("surfaces"),
           nb::arg("matrices"))
      .def("replace_mesh", [](SceneBuilder& b, size_t row, const HeldMesh& input, InArray<double> before,
                              InArray<double> now) { return b.replace_mesh(row, input, affine_of(before), affine_of(now)); })
      .def("add_mesh_primvar", [](SceneBuilder& b, int name, PrimvarKind kind, int width,
                                  InArray<float> values) { b.add_mesh_primvar(name, kind, width, span_of(values)); })
      .def("add_sphere", [](SceneBuilder& b, double radius, int surface,
                            InArray<double> matrix) { return b.add_curved<SphereShape>(radius, surface, affine_of(matrix)); })
      .def("add_curved_primvar", [](SceneBuilder& b, int name, PrimvarKind kind, int width, InArray<float> values) {
        b.add_curved_primvar(name, kind, width, span_of(values));
      });
}

}  // namespace primray
