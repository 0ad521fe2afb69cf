// Test bindings of grids and of tracking in them: N segments in, N estimates out.
#include "bindings/testing/rows.hpp"
#include "volume/tracking.hpp"

namespace primray {
namespace {

// Adds a grid. `values` and `tile_values` are both float32 or both float16 as uint16.
int add_grid(GridTable& table, InInts leaf_origins, nb::object values, InInts tiles, nb::object tile_values, int channels) {
  GridInput grid;
  grid.channels = channels, grid.leaf_origins = span_of(leaf_origins), grid.tiles = span_of(tiles);
  InArray<uint16_t> halves, tile_halves;
  InFloats floats, tile_floats;
  grid.is_half = nb::try_cast(values, halves, false) && nb::try_cast(tile_values, tile_halves, false);
  if (grid.is_half) {
    grid.halves = {span_of(halves), span_of(tile_halves)};
  } else {
    floats = nb::cast<InFloats>(values), tile_floats = nb::cast<InFloats>(tile_values);
    grid.floats = {span_of(floats), span_of(tile_floats)};
  }
  return table.add(grid);
}

template <int W>
GridSegment<W> segment(const Input<float>& rays, const Input<float>& extinction, size_t at) {
  return {{rays.number<W>(at, 0), rays.number<W>(at, 1), rays.number<W>(at, 2)},
          {rays.number<W>(at, 3), rays.number<W>(at, 4), rays.number<W>(at, 5)},
          rays.number<W>(at, 6),
          rays.number<W>(at, 7),
          extinction.vector<W>(at)};
}

nb::object voxels(const GridTable& table, int grid, InInts places_, int lanes) {
  const size_t n = places_.shape(0);
  const Input<int32_t> places(places_, n, 3);
  Column<float> values(n);
  for_rows(n, lanes, [&]<int W>(size_t at) {
    const GridRows<W> rows(table, vint<W>(grid));
    values.put(at, rows.value(places.number<W>(at, 0), places.number<W>(at, 1), places.number<W>(at, 2)));
  });
  return values.array();
}

// `rays`: origin, direction, and the distances of both ends.
nb::object transmittance(const GridTable& table, int grid, InFloats rays_, InFloats extinction_, InInts seeds_, int lanes) {
  const size_t n = rays_.shape(0);
  const Input<float> rays(rays_, n, 8), extinction(extinction_, n, 3);
  const Input<int32_t> seeds(seeds_, n, 1);
  Column<float> found(n, 3);
  for_rows(n, lanes, [&]<int W>(size_t at) {
    found.put(at, estimate_transmittance(table, vbool<W>(true), vint<W>(grid), segment<W>(rays, extinction, at),
                                         bit_cast<vuint<W>>(seeds.number<W>(at))));
  });
  return found.array();
}

nb::tuple collisions(const GridTable& table, int grid, InFloats rays_, InFloats extinction_, InFloats beta_, InInts seeds_,
                     int lanes) {
  const size_t n = rays_.shape(0);
  const Input<float> rays(rays_, n, 8), extinction(extinction_, n, 3), beta(beta_, n, 3);
  const Input<int32_t> seeds(seeds_, n, 1);
  Column<int32_t> happens(n);
  Column<float> distance(n), throughput(n, 3);
  for_rows(n, lanes, [&]<int W>(size_t at) {
    const Collision<W> c = sample_collision(table, vbool<W>(true), vint<W>(grid), segment<W>(rays, extinction, at),
                                            beta.vector<W>(at), bit_cast<vuint<W>>(seeds.number<W>(at)));
    happens.put(at, c.happens), distance.put(at, c.t), throughput.put(at, c.beta);
  });
  return nb::make_tuple(happens.array(), distance.array(), throughput.array());
}

}  // namespace

void bind_grids(nb::module_& m) {
  nb::class_<GridTable>(m, "GridTable")
      .def(nb::init<>())
      .def("add", &add_grid, nb::arg("leaf_origins"), nb::arg("values"), nb::arg("tiles"), nb::arg("tile_values"),
           nb::arg("channels") = 1)
      .def("range",
           [](const GridTable& t, int grid) { return nb::make_tuple(t.rows[size_t(grid)].least, t.rows[size_t(grid)].most); })
      .def("box",
           [](const GridTable& t, int grid) {
             const GridTable::Row& r = t.rows[size_t(grid)];
             return nb::make_tuple(r.low[0], r.low[1], r.low[2], r.high[0], r.high[1], r.high[2]);
           })
      .def("voxels", &voxels, nb::arg("grid"), nb::arg("places"), nb::arg("lanes") = 0)
      .def("transmittance", &transmittance, nb::arg("grid"), nb::arg("rays"), nb::arg("extinction"), nb::arg("seeds"),
           nb::arg("lanes") = 0)
      .def("collisions", &collisions, nb::arg("grid"), nb::arg("rays"), nb::arg("extinction"), nb::arg("beta"),
           nb::arg("seeds"), nb::arg("lanes") = 0);
}

}  // namespace primray
