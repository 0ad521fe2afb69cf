// Test bindings of grids and of tracking in them: N segments in, N estimates out.
#include "bindings/testing/rows.hpp"
#include "bindings/volume_inputs.hpp"
#include "volume/tracking.hpp"

namespace primray {
namespace {

// Segments in one grid. `rays`: origin, direction, and the distances of both ends.
struct Segments {
  const GridTable& table;
  int grid;
  size_t count;
  Input<float> rays, extinction;
  Input<int32_t> seeds;
  float time = 0;

  Segments(const GridTable& t, int grid_number, const InFloats& r, const InFloats& e, const InInts& s)
      : table(t), grid(grid_number), count(r.shape(0)), rays(r, count, 8), extinction(e, count, 3), seeds(s, count, 1) {}

  template <int W>
  TrackingTask<W> task(vint<W> numbers) const {
    const auto number = [&](const Input<float>& from, int k) {
      vfloat<W> r(0.0f);
      for (int i = 0; i < W; ++i) r.set(i, from.at(size_t(numbers[i]), k));
      return r;
    };
    const auto vector = [&](const Input<float>& from, int k) {
      return vvec3<W>(number(from, k), number(from, k + 1), number(from, k + 2));
    };
    vuint<W> seed(0u);
    for (int i = 0; i < W; ++i) seed.set(i, uint32_t(seeds.at(size_t(numbers[i]), 0)));
    return {vint<W>(grid),
            {vector(rays, 0), vector(rays, 3), number(rays, 6), number(rays, 7), vector(extinction, 0)},
            seed,
            vfloat<W>(time)};
  }
  // Calls f.operator()<W>(), with the lanes that the test asks for.
  template <class F>
  static void with_lanes(int lanes, F&& f) {
    const FlushDenormals as_in_a_render;
    lanes == 1 ? f.template operator()<1>() : f.template operator()<PRIMRAY_MAX_LANES>();
  }
};

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

nb::object transmittance(const GridTable& table, int grid, InFloats rays, InFloats extinction, InInts seeds, int lanes,
                         float time) {
  Segments segments(table, grid, rays, extinction, seeds);
  segments.time = time;
  Column<float> found(segments.count, 3);
  Segments::with_lanes(lanes, [&]<int W>() {
    const auto load = [&](vbool<W> fresh, vint<W> numbers, TransmittanceEvents<W>& events) {
      const TrackingTask<W> task = segments.task<W>(numbers);
      events.begin(fresh, task.segment);
      return task;
    };
    const auto store = [&](vbool<W> done, vint<W> numbers, const TransmittanceEvents<W>& events) {
      const vvec3<W> left = events.transmittance();
      for (uint32_t b = bits(done); b; b &= b - 1) {
        const int i = __builtin_ctz(b);
        found.put(size_t(numbers[i]), vvec3<1>(vfloat<1>(left.x[i]), vfloat<1>(left.y[i]), vfloat<1>(left.z[i])));
      }
    };
    follow_segments<W, TransmittanceEvents<W>>(table, int(segments.count), load, store);
  });
  return found.array();
}

nb::tuple collisions(const GridTable& table, int grid, InFloats rays, InFloats extinction, InFloats beta_, InInts seeds,
                     int lanes, float time) {
  Segments segments(table, grid, rays, extinction, seeds);
  segments.time = time;
  const Input<float> beta(beta_, segments.count, 3);
  Column<int32_t> happens(segments.count);
  Column<float> distance(segments.count), throughput(segments.count, 3);
  Segments::with_lanes(lanes, [&]<int W>() {
    const auto load = [&](vbool<W> fresh, vint<W> numbers, CollisionEvents<W>& events) {
      const TrackingTask<W> task = segments.task<W>(numbers);
      vvec3<W> own(vfloat<W>(0.0f));
      for (int i = 0; i < W; ++i) {
        const size_t at = size_t(numbers[i]);
        own.x.set(i, beta.at(at, 0)), own.y.set(i, beta.at(at, 1)), own.z.set(i, beta.at(at, 2));
      }
      events.begin(fresh, task.segment, own);
      return task;
    };
    const auto store = [&](vbool<W> done, vint<W> numbers, const CollisionEvents<W>& events) {
      for (uint32_t b = bits(done); b; b &= b - 1) {
        const int i = __builtin_ctz(b);
        const size_t at = size_t(numbers[i]);
        happens.put(at, vint<1>(events.happens[i] ? 1 : 0)), distance.put(at, vfloat<1>(events.t[i]));
        throughput.put(at, vvec3<1>(vfloat<1>(events.beta.x[i]), vfloat<1>(events.beta.y[i]), vfloat<1>(events.beta.z[i])));
      }
    };
    follow_segments<W, CollisionEvents<W>>(table, int(segments.count), load, store);
  });
  return nb::make_tuple(happens.array(), distance.array(), throughput.array());
}

}  // namespace

void bind_grids(nb::module_& m) {
  nb::class_<GridTable>(m, "GridTable")
      .def(nb::init<>())
      .def(
          "add",
          [](GridTable& t, InInts leaf_origins, nb::object values, InInts tiles, nb::object tile_values, int channels) {
            return t.add(GridArrays(leaf_origins, values, tiles, tile_values, channels).input);
          },
          nb::arg("leaf_origins"), nb::arg("values"), nb::arg("tiles"), nb::arg("tile_values"), nb::arg("channels") = 1)
      .def(
          "add_blurred",
          [](GridTable& t, int grid, int velocity, float frame) { return t.add_blurred({grid, velocity, {0, 0, 0}, frame}); },
          nb::arg("grid"), nb::arg("velocity"), nb::arg("frame"))
      .def("range",
           [](const GridTable& t, int grid) { return nb::make_tuple(t.rows[size_t(grid)].least, t.rows[size_t(grid)].most); })
      .def("box",
           [](const GridTable& t, int grid) {
             const GridTable::Row& r = t.rows[size_t(grid)];
             return nb::make_tuple(r.low[0], r.low[1], r.low[2], r.high[0], r.high[1], r.high[2]);
           })
      .def("voxels", &voxels, nb::arg("grid"), nb::arg("places"), nb::arg("lanes") = 0)
      .def("transmittance", &transmittance, nb::arg("grid"), nb::arg("rays"), nb::arg("extinction"), nb::arg("seeds"),
           nb::arg("lanes") = 0, nb::arg("time") = 0)
      .def("collisions", &collisions, nb::arg("grid"), nb::arg("rays"), nb::arg("extinction"), nb::arg("beta"),
           nb::arg("seeds"), nb::arg("lanes") = 0, nb::arg("time") = 0);
}

}  // namespace primray
