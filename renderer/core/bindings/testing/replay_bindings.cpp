// Test bindings that trace rays: replay of moving rays in the scene and in Embree alone, and rays through the world's
// TriangleBvh in one stream, as a render's pools do.

#include "bindings/arrays.hpp"
#include "bindings/recording.hpp"
#include "bindings/testing/rows.hpp"
#include "bvh/interleaved.hpp"
#include "integrator/rays/packet_choice.hpp"
#include "render/replay.hpp"

namespace primray {

// Test bindings that trace rays through the world's TriangleBvh in one stream, as a render's pools do.

namespace {

nb::dict intersect_stream(const Scene& scene, InArray<double> o_, InFloats d_) {
  if (!scene.triangle_bvh.any()) throw nb::value_error("the scene has no triangle hierarchy");
  const CorePoints o(scene, o_);
  const Input<float> d(d_, o.n, 3);
  std::vector<float> column[8];
  for (std::vector<float>& c : column) c.resize(o.n);
  for (size_t i = 0; i < o.n; ++i) {
    const vvec3<1> from = o.vector<1>(i), way = d.vector<1>(i);
    const float ray[8] = {from.x[0], from.y[0], from.z[0], way.x[0], way.y[0], way.z[0], 0.0f, kInfinity};
    for (int k = 0; k < 8; ++k) column[k][i] = ray[k];
  }
  const RayColumns rays{column[0].data(), column[1].data(), column[2].data(), column[3].data(),
                        column[4].data(), column[5].data(), column[6].data(), column[7].data()};
  std::vector<float> t(o.n), u(o.n), v(o.n);
  std::vector<int32_t> primitive(o.n), geometry(o.n), blocked(o.n);
  intersect_interleaved(scene.triangle_bvh, uint32_t(o.n), rays,
                        {t.data(), u.data(), v.data(), primitive.data(), geometry.data()});
  occluded_interleaved(scene.triangle_bvh, uint32_t(o.n), rays, blocked.data());
  for (float& distance : t) distance *= float(1 / scene.scale);
  nb::dict r;
  r["t"] = to_numpy(std::move(t), {o.n}), r["u"] = to_numpy(std::move(u), {o.n}), r["v"] = to_numpy(std::move(v), {o.n});
  r["primitive"] = to_numpy(std::move(primitive), {o.n}), r["blocked"] = to_numpy(std::move(blocked), {o.n});
  return r;
}

}  // namespace

void bind_hierarchy(nb::module_& m) {
  m.def("has_hierarchy", [](const Scene& scene) { return scene.triangle_bvh.any(); });
  m.def("timestamp_counter", [] { return PacketChoice::now(); });
  m.def("intersect_stream", &intersect_stream, nb::arg("scene"), nb::arg("o"), nb::arg("d"));
}

// `entry`: 0 as recorded, 1 packets, 2 single rays.
void bind_replay(nb::module_& m) {
  const auto recording = nb::arg("recording"), shadow = nb::arg("shadow"), entry = nb::arg("entry");
  nb::class_<BareWorld>(m, "BareWorld").def(nb::init<const Scene&>(), nb::arg("scene"), nb::keep_alive<1, 2>());
  // Returns CPU seconds of the scene and of the bare world.
  m.def(
      "replay_interleaved",
      [](const Recording& r, const BareWorld& world, bool shadow, int entry) {
        const ReplaySeconds found = replay_interleaved(r.scene, world, r.rays, {shadow, ReplayEntry(entry), r.lanes});
        return nb::make_tuple(found.scene, found.bare);
      },
      recording, nb::arg("world"), shadow, entry);
  // Returns the number of rays, and of those with different results.
  m.def(
      "replay_agreement",
      [](const Recording& r, const BareWorld& world, bool shadow) {
        const ReplayAgreement found = replay_agreement(r.scene, world, r.rays, {shadow, ReplayEntry::kSingle, r.lanes});
        return nb::make_tuple(found.rays, found.apart);
      },
      recording, nb::arg("world"), shadow);
}

}  // namespace primray
