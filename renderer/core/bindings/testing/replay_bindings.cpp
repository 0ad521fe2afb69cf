// Test bindings that replay moving rays in the scene and in Embree alone, for the benchmark and its test.
#include "bindings/arrays.hpp"
#include "bindings/recording.hpp"
#include "render/moving_replay.hpp"

namespace primray {

// `entry`: 0 as recorded, 1 packets, 2 single rays.
void bind_replay(nb::module_& m) {
  const auto recording = nb::arg("recording"), shadow = nb::arg("shadow"), entry = nb::arg("entry");
  nb::class_<BareWorld>(m, "BareWorld").def(nb::init<const Scene&>(), nb::arg("scene"), nb::keep_alive<1, 2>());
  // Returns CPU seconds of the scene and of the bare world.
  m.def(
      "replay_by_turns",
      [](const Recording& r, const BareWorld& world, bool shadow, int entry) {
        const ReplaySeconds found = replay_by_turns(r.scene, world, r.rays, {shadow, ReplayEntry(entry), r.lanes});
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
