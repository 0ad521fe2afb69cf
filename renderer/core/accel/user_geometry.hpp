// Embree user geometry over an array of records, one primitive per record.
#pragma once

#include "embree/embree.hpp"

namespace primray {

struct UserFunctions {
  rtc::BoundsFunction bounds;
  rtc::IntersectFunction intersect;
  rtc::OccludedFunction occluded;
};

// `user` is passed to the functions, and must outlive the geometry; `steps`: times between which Embree interpolates boxes
// linearly.
inline OwnedGeometry make_user_geometry(const void* user, uint32_t count, const UserFunctions& functions, uint32_t steps = 1) {
  const rtc::Api& e = embree();
  OwnedGeometry g(e.rtcNewGeometry(embree_device(), rtc::kUser));
  e.rtcSetGeometryUserPrimitiveCount(g.get(), count);
  e.rtcSetGeometryUserData(g.get(), const_cast<void*>(user));
  if (steps > 1) e.rtcSetGeometryTimeStepCount(g.get(), steps);
  e.rtcSetGeometryBoundsFunction(g.get(), functions.bounds, nullptr);
  e.rtcSetGeometryIntersectFunction(g.get(), functions.intersect);
  e.rtcSetGeometryOccludedFunction(g.get(), functions.occluded);
  e.rtcCommitGeometry(g.get());
  return g;
}

}  // namespace primray
