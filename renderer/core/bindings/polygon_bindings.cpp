// Python binding of triangulate(): a mesh's arrays as USD has them.
#include <nanobind/stl/optional.h>
#include <nanobind/stl/tuple.h>

#include "bindings/arrays.hpp"
#include "polygon/triangulate.hpp"

namespace primray {
namespace {

// The largest coordinate of usable points: primray/usd/mesh/triangulate.py.
constexpr float kLargest = 1e37f;

using Made = std::tuple<OutArray<int32_t, 2>, OutArray<int32_t, 2>, OutArray<int32_t, 1>, int64_t>;

std::optional<Made> triangulated(const InArray<float>& points, const InArray<int32_t>& counts, const InArray<int32_t>& indices,
                                 const std::optional<InArray<bool>>& keep) {
  PolygonMesh mesh{span_of(points), span_of(counts), span_of(indices), {}};
  if (keep)
    mesh.keep = {reinterpret_cast<const uint8_t*>(keep->data()), keep->size()};
  else if (!is_usable(mesh, kLargest))
    return std::nullopt;
  PolygonTriangles made = triangulate(mesh);
  const size_t count = made.faces.size();
  return Made{to_numpy(std::move(made.points), {count, 3}), to_numpy(std::move(made.corners), {count, 3}),
              to_numpy(std::move(made.faces), {count}), made.lost_faces};
}

}  // namespace

void bind_polygons(nb::module_& m) {
  m.def("triangulate", &triangulated, nb::arg("points"), nb::arg("counts"), nb::arg("indices"),
        nb::arg("keep").none() = nb::none(),
        "Triangulate polygonal faces as primray/usd/mesh/triangulate.py does; None if some have to be left out.");
}

}  // namespace primray
