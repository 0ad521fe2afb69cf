// The filter for nearest hits and for shadow rays, a lane at a time: packets of incoherent rays bring it 1.1 on average.
//
// Opacity is read at the finest level, since a filter knows no ray's cone: a cut-out has the same holes for every ray. A ray
// that meets the edge of two triangles may be asked about twice, with the same answer.
#include "accel/cutout.hpp"

#include "scene/evaluate_inputs.hpp"

namespace primray {
namespace {

// Lane `i` of the N hits that a filter is given, laid out as Embree does: field by field, N lanes each.
Hits<1> hit_of(const rtc::FilterArguments& args, uint32_t i) {
  const uint32_t n = args.n;
  const float* f = args.hit;
  const uint32_t* id = reinterpret_cast<const uint32_t*>(args.hit);
  const auto number = [&](int field) { return vint<1>(int32_t(id[field * n + i])); };
  return {vfloat<1>(0.0f),
          vvec3<1>(vfloat<1>(0.0f)),
          vfloat<1>(f[3 * n + i]),
          vfloat<1>(f[4 * n + i]),
          number(5),
          number(6),
          number(7),
          number(8)};
}

bool is_hole(const Scene& scene, const Hits<1>& hit) {
  const vbool<1> yes(true);
  const SurfacePoint<1> point(scene, yes, hit);
  const int32_t surface = scene.meshes.surface[point.mesh[0]], inputs = scene.surface_inputs_of[surface];
  const SurfaceInputs* s = inputs < 0 ? nullptr : &scene.surface_inputs[inputs];
  const InputSource* opacity = s ? s->find(InputField::kOpacity) : nullptr;
  if (!opacity) return false;
  InputReader<1> reader(scene, yes, point, vfloat<1>(0.0f));
  return !(reader.read(*opacity).x[0] >= s->constants.opacity_threshold);
}

void filter(const rtc::FilterArguments* args) {
  const Scene& scene = *static_cast<const Scene*>(args->user);
  for (uint32_t i = 0; i < args->n; ++i)
    if (args->valid[i] && is_hole(scene, hit_of(*args, i))) args->valid[i] = 0;
}

}  // namespace

void set_cutout_filter(rtc::Geometry geometry, const Scene& scene) {
  const rtc::Api& e = embree();
  e.rtcSetGeometryUserData(geometry, const_cast<Scene*>(&scene));
  e.rtcSetGeometryIntersectFilterFunction(geometry, filter);
  e.rtcSetGeometryOccludedFilterFunction(geometry, filter);
}

}  // namespace primray
