// The filter for nearest hits and for shadow rays, a lane at a time: packets of incoherent rays bring it 1.1 on average.
//
// Opacity is read at the finest level, since a filter knows no ray's cone: a cut-out has the same holes for every ray. A ray
// that meets the edge of two triangles may be asked about twice, with the same answer.
#include "accel/cutout.hpp"

#include "surface/evaluate_inputs.hpp"

namespace primray {
namespace {

// What a filter is given of lane `i`, laid out as Embree does: field by field, a lane of each.
struct FilterHit {
  float u, v;
  uint32_t prim, instance, instance_prim;
  FilterHit(const rtc::FilterArguments& args, uint32_t i) {
    const auto field = [&](int f) { return args.hit[f * args.n + i]; };
    const auto number = [&](int f) { return reinterpret_cast<const uint32_t*>(args.hit)[f * args.n + i]; };
    u = field(3), v = field(4), prim = number(5), instance = number(7), instance_prim = number(8);
  }
};

bool is_hole(const CutoutGroup& cutouts, const FilterHit& hit) {
  const Scene& scene = *cutouts.scene;
  const Group& group = scene.groups[cutouts.group];
  const vbool<1> yes(true);
  // Inside a group of instances the numbers are the group's own: there the instance's primvars are not looked at.
  const bool placed = hit.instance != rtc::kInvalidId && !scene.has_grouped;
  const int32_t placement = placed ? int32_t(hit.instance - kFirstPlacement + scene.groups[0].placement_base) : -1;
  const int32_t triangle = int32_t(group.triangle_base + cutouts.first + hit.prim);
  const SurfacePoint<1> point(scene, yes, vint<1>(triangle), vint<1>(int32_t(group.vertex_base)), vint<1>(placement),
                              vint<1>(int32_t(hit.instance_prim)), vfloat<1>(hit.u), vfloat<1>(hit.v));
  const int32_t surface = scene.meshes.surface[point.mesh[0]], inputs = scene.surface_inputs_of[surface];
  const SurfaceInputs* s = inputs < 0 ? nullptr : &scene.surface_inputs[inputs];
  const InputSource* opacity = s ? s->find(InputField::kOpacity) : nullptr;
  if (!opacity) return false;
  InputReader<1> reader(scene, yes, point, vfloat<1>(0.0f));
  reader.run_tape(*s, [](InputField f) { return f == InputField::kOpacity; });
  return !(reader.read(*opacity).x[0] >= s->constants.opacity_threshold);
}

void filter(const rtc::FilterArguments* args) {
  const CutoutGroup& cutouts = *static_cast<const CutoutGroup*>(args->user);
  for (uint32_t i = 0; i < args->n; ++i)
    if (args->valid[i] && is_hole(cutouts, FilterHit(*args, i))) args->valid[i] = 0;
}

}  // namespace

void set_cutout_filter(rtc::Geometry geometry, const CutoutGroup& cutouts) {
  const rtc::Api& e = embree();
  e.rtcSetGeometryUserData(geometry, const_cast<CutoutGroup*>(&cutouts));
  e.rtcSetGeometryIntersectFilterFunction(geometry, filter);
  e.rtcSetGeometryOccludedFilterFunction(geometry, filter);
}

}  // namespace primray
