// Volumes that overlap: media inside closed shapes without an interface. They add, and which of them contain a point does not
// depend on how a path came there, so a path carries the number of a set. Each worker numbers the sets that its paths come
// across; the medium of a set is the sum over its volumes, in an order that is the same for all workers.
#pragma once

#include <algorithm>
#include <map>
#include <span>
#include <unordered_map>
#include <vector>

#include "medium/medium.hpp"
#include "scene/scene.hpp"
#include "surface/hit_group.hpp"
#include "surface/surface_point.hpp"

namespace primray {

// Returns the volume that `surface` bounds at the hit of lane `i`.
template <int W>
VolumeObject volume_object_at(const Scene& scene, const HitGroup<W>& in, int32_t surface, int i) {
  return {scene.interiors.volume_of[size_t(surface)], in.instanced[i] ? in.instance[i] : -1, in.grouped[i] ? in.outer[i] : -1};
}

// Rows of two media for each set: of all rays, and of rays from the camera, which does not see hidden volumes.
class VolumeSets {
 public:
  // Sets that no path is in any more are forgotten when there are more than these.
  static constexpr size_t kMostSets = 1 << 14;

  explicit VolumeSets(const Interiors& interiors) : interiors_(&interiors) { restart(); }

  // Set around the camera.
  int32_t of_camera() const { return camera_; }
  // Returns the set of a path that was in `set` and enters or leaves `object`.
  int32_t after(int32_t set, const VolumeObject& object, bool enters) {
    const Step step{set, object, enters};
    if (const auto known = steps_.find(step); known != steps_.end()) return known->second;
    std::vector<VolumeObject> objects = sets_[size_t(set)];
    const auto at = std::lower_bound(objects.begin(), objects.end(), object);
    const bool has = at != objects.end() && *at == object;
    if (enters && !has) objects.insert(at, object);
    if (!enters && has) objects.erase(at);
    return steps_[step] = number_of(objects);
  }
  // Begins again if there are too many sets, and returns whether it does. No path may be alive.
  bool forget_if_many() {
    if (sets_.size() <= kMostSets) return false;
    restart();
    return true;
  }

  std::span<const VolumeObject> objects(int32_t set) const { return sets_[size_t(set)]; }
  // Index of the rows of sets `set`.
  template <int W>
  static PRIMRAY_INLINE vint<W> row_of(vint<W> set, vbool<W> from_camera) {
    return set * vint<W>(2) + select(from_camera, vint<W>(1), vint<W>(0));
  }
  template <int W>
  Medium<W> medium(vint<W> row, vvec3<W>& emission) const {
    const vint<W> at = row * vint<W>(kColumns);
    const auto color = [&](int column) { return gather_vec3<W>(rows_.data() + column, at); };
    Medium<W> m;
    m.extinction = color(kExtinction), m.scattering = color(kScattering), emission = color(kEmission);
    m.phase = gather<W>(rows_.data() + kPhase, at);
    return m;
  }
  // Share of the light that matte volumes extinguish: such light counts as absent from the picture's alpha.
  bool any_matte() const { return any_matte_; }
  template <int W>
  vfloat<W> matte_share(vint<W> row) const {
    return gather<W>(rows_.data() + kMatte, row * vint<W>(kColumns));
  }

  // A volume that scatters, in a set.
  struct Member {
    vec3 scattering;
    float phase;
  };
  std::span<const Member> members(int32_t row) const { return members_[size_t(row)]; }

 private:
  enum Column { kExtinction = 0, kScattering = 3, kEmission = 6, kPhase = 9, kMatte, kColumns };
  struct Step {
    int32_t set;
    VolumeObject object;
    bool enters;
    bool operator==(const Step&) const = default;
  };
  struct StepHash {
    size_t operator()(const Step& s) const {
      uint64_t h = uint32_t(s.set) * 2u + (s.enters ? 1u : 0u);
      for (const int32_t x : {s.object.volume, s.object.instance, s.object.outer})
        h = (h ^ uint32_t(x)) * 0x9e3779b97f4a7c15u, h ^= h >> 29;
      return size_t(h);
    }
  };

  void restart() {
    sets_.clear(), numbers_.clear(), rows_.clear(), members_.clear(), steps_.clear();
    number_of({});
    camera_ = number_of(interiors_->camera_volumes);
  }
  int32_t number_of(const std::vector<VolumeObject>& objects) {
    const auto [known, is_new] = numbers_.try_emplace(objects, int32_t(sets_.size()));
    if (!is_new) return known->second;
    sets_.push_back(objects);
    add_row(objects, false), add_row(objects, true);
    return int32_t(sets_.size()) - 1;
  }
  void add_row(const std::vector<VolumeObject>& objects, bool from_camera) {
    vec3 extinction(0.0f), scattering(0.0f), emission(0.0f);
    float matte = 0, total = 0;
    std::vector<Member> members;
    for (const VolumeObject& object : objects) {
      const Volume& v = interiors_->volumes[size_t(object.volume)];
      const CameraVisibility seen = from_camera ? v.camera : CameraVisibility::kSeen;
      if (seen == CameraVisibility::kHidden) continue;
      extinction = extinction + v.extinction;
      total += v.extinction.x + v.extinction.y + v.extinction.z;
      if (seen == CameraVisibility::kMatte) {
        matte += v.extinction.x + v.extinction.y + v.extinction.z;
        continue;
      }
      scattering = scattering + v.scattering, emission = emission + v.emission;
      if (std::max({v.scattering.x, v.scattering.y, v.scattering.z}) > 0) members.push_back({v.scattering, v.phase});
    }
    const float row[kColumns] = {extinction.x,
                                 extinction.y,
                                 extinction.z,
                                 scattering.x,
                                 scattering.y,
                                 scattering.z,
                                 emission.x,
                                 emission.y,
                                 emission.z,
                                 members.empty() ? 0.0f : members[0].phase,
                                 total > 0 ? matte / total : 0.0f};
    any_matte_ |= matte > 0;
    rows_.insert(rows_.end(), row, row + kColumns);
    members_.push_back(std::move(members));
  }

  const Interiors* interiors_;
  std::vector<std::vector<VolumeObject>> sets_;
  std::map<std::vector<VolumeObject>, int32_t> numbers_;
  std::vector<float> rows_;
  std::vector<std::vector<Member>> members_;  // by row
  std::unordered_map<Step, int32_t, StepHash> steps_;
  int32_t camera_ = 0;
  bool any_matte_ = false;
};

}  // namespace primray
