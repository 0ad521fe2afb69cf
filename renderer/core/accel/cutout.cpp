// Embree's filter functions. Those of cutouts (surfaces with an opacityThreshold) reject hits in a cutout's holes, for nearest
// hits and shadow rays alike. That of hair lets shadow rays out of a fibre: what is within one has already been scattered by
// it. Lanes are handled one at a time: a call for a packet of incoherent rays has 1.1 active lanes on average.
//
// Opacity is read at the finest mip level, since a filter does not know the ray's cone: a cutout has the same holes for every
// ray. A ray that hits an edge shared by two triangles may be tested twice, with the same answer.
#include "accel/geometry.hpp"

#include "surface/evaluate_inputs.hpp"

namespace primray {
namespace {

// A filter's input for lane `i`. Embree stores it field by field, with all lanes of each.
struct FilterHit {
  float u, v;
  uint32_t prim, instance, instance_prim;
  FilterHit(const rtc::FilterArguments& args, uint32_t i) {
    const auto field = [&](int f) { return args.hit[f * args.n + i]; };
    const auto number = [&](int f) { return reinterpret_cast<const uint32_t*>(args.hit)[f * args.n + i]; };
    u = field(3), v = field(4), prim = number(5), instance = number(7), instance_prim = number(8);
  }
};

// Whether the surface is absent at the point.
bool is_open(const Scene& scene, const SurfacePoint<1>& point, int32_t surface) {
  const vbool<1> yes(true);
  const int32_t inputs = scene.surface_inputs_of[surface];
  const SurfaceInputs* s = inputs < 0 ? nullptr : &scene.surface_inputs[inputs];
  const InputSource* opacity = s ? s->find(InputField::kOpacity) : nullptr;
  if (!opacity || !(s->constants.opacity_threshold > 0)) return false;
  InputReader<1> reader(scene, yes, point, vfloat<1>(0.0f));
  reader.run_tape(*s, [](InputField f) { return f == InputField::kOpacity; });
  return !(reader.read(*opacity).x[0] >= s->constants.opacity_threshold);
}

// Whether the tube is absent on segment `segment` of the scene, at parameter `longer` of the longer segment that Embree has.
bool is_tube_open(const Scene& scene, int32_t segment, float longer, uint32_t instance, uint32_t instance_prim) {
  const vbool<1> yes(true);
  Hits<1> nowhere{};
  nowhere.geom = nowhere.inst = vint<1>(-1);
  SurfacePoint<1> point(scene, yes, nowhere);
  point.curve.is = yes, point.curve.any_is = true, point.curve.segment = vint<1>(segment);
  const int32_t row = scene.curves.row[size_t(scene.curves.run[size_t(segment)])];
  point.curve.row = point.curved = vint<1>(row);
  point.u = point.curve.u = clamp(vfloat<1>(longer) * (1.0f + 2 * kBeyond) - kBeyond, 0.0f, 1.0f);
  if (instance != rtc::kInvalidId && !scene.has_grouped) {
    point.instanced = yes, point.instance_row = vint<1>(int32_t(instance_prim));
    point.placement = vint<1>(int32_t(instance - kFirstPlacement + scene.groups[0].placement_base));
  }
  return is_open(scene, point, scene.curved.surface[size_t(row)]);
}

bool is_hole(const CutoutGroup& cutouts, const FilterHit& hit) {
  const Scene& scene = *cutouts.scene;
  const Group& group = scene.groups[cutouts.group];
  const vbool<1> yes(true);
  // Within a group of instances the numbers are the group's own, so primvars of the instance are not read there.
  const bool placed = hit.instance != rtc::kInvalidId && !scene.has_grouped;
  const int32_t placement = placed ? int32_t(hit.instance - kFirstPlacement + scene.groups[0].placement_base) : -1;
  const int32_t triangle = int32_t(group.triangle_base + cutouts.first + hit.prim);
  const SurfacePoint<1> point(scene, yes, vint<1>(triangle), vint<1>(int32_t(group.vertex_base)), vint<1>(placement),
                              vint<1>(int32_t(hit.instance_prim)), vfloat<1>(hit.u), vfloat<1>(hit.v));
  return is_open(scene, point, scene.meshes.surface[point.mesh[0]]);
}

void filter(const rtc::FilterArguments* args) {
  const CutoutGroup& cutouts = *static_cast<const CutoutGroup*>(args->user);
  for (uint32_t i = 0; i < args->n; ++i)
    if (args->valid[i] && is_hole(cutouts, FilterHit(*args, i))) args->valid[i] = 0;
}

void tube_filter(const rtc::FilterArguments* args) {
  const CutoutGroup& cutouts = *static_cast<const CutoutGroup*>(args->user);
  for (uint32_t i = 0; i < args->n; ++i) {
    if (!args->valid[i]) continue;
    const FilterHit hit(*args, i);
    if (is_tube_open(*cutouts.scene, int32_t(cutouts.first + hit.prim), hit.u, hit.instance, hit.instance_prim))
      args->valid[i] = 0;
  }
}

// Whether a ray meets the wall of a tube from within.
bool leaves(const rtc::FilterArguments& args, uint32_t i) {
  const auto ray = [&](int f) { return args.ray[f * args.n + i]; };
  const auto ng = [&](int f) { return args.hit[f * args.n + i]; };
  return ng(0) * ray(4) + ng(1) * ray(5) + ng(2) * ray(6) >= 0;
}

template <bool kHoles>
void fibre_filter(const rtc::FilterArguments* args) {
  const CutoutGroup& cutouts = *static_cast<const CutoutGroup*>(args->user);
  for (uint32_t i = 0; i < args->n; ++i)
    if (args->valid[i] && leaves(*args, i) && is_fibre(*cutouts.scene, size_t(cutouts.first) + FilterHit(*args, i).prim))
      args->valid[i] = 0;
  if constexpr (kHoles) tube_filter(args);
}

void set_filter(rtc::Geometry geometry, const CutoutGroup& cutouts, rtc::FilterFunction function) {
  const rtc::Api& e = embree();
  e.rtcSetGeometryUserData(geometry, const_cast<CutoutGroup*>(&cutouts));
  e.rtcSetGeometryIntersectFilterFunction(geometry, function);
  e.rtcSetGeometryOccludedFilterFunction(geometry, function);
}

int32_t surface_of(const Scene& scene, int32_t run) { return scene.curved.surface[size_t(scene.curves.row[size_t(run)])]; }

// Whether `test` is true of the surface of one of the curves.
template <class Test>
bool any_surface(const Scene& scene, const CurveRange& range, const Test& test) {
  int32_t before = -1;
  for (uint32_t i = 0; i < range.segments; ++i) {
    const int32_t run = scene.curves.run[range.segment + i];
    if (run == before) continue;
    before = run;
    if (test(surface_of(scene, run))) return true;
  }
  return false;
}

bool is_hair(const Scene& scene, int32_t surface) {
  return int_at(&scene.surfaces.rows[size_t(surface) * kSurfaceFields], kFlags) & kHair;
}

}  // namespace

void set_cutout_filter(rtc::Geometry geometry, const CutoutGroup& cutouts) { set_filter(geometry, cutouts, filter); }
void set_tube_filter(rtc::Geometry geometry, const CutoutGroup& cutouts) { set_filter(geometry, cutouts, tube_filter); }

void set_fibre_filter(rtc::Geometry geometry, const CutoutGroup& cutouts, bool holes) {
  const rtc::Api& e = embree();
  e.rtcSetGeometryUserData(geometry, const_cast<CutoutGroup*>(&cutouts));
  e.rtcSetGeometryOccludedFilterFunction(geometry, holes ? fibre_filter<true> : fibre_filter<false>);
}

bool is_fibre(const Scene& scene, size_t segment) { return is_hair(scene, surface_of(scene, scene.curves.run[segment])); }

bool has_fibres(const Scene& scene, const CurveRange& range) {
  return !scene.surfaces.hair.empty() && any_surface(scene, range, [&](int32_t surface) { return is_hair(scene, surface); });
}

bool has_holes(const Scene& scene, const CurveRange& range) {
  return any_surface(scene, range, [&](int32_t surface) {
    const int32_t inputs = scene.surface_inputs_of[size_t(surface)];
    const SurfaceInputs* s = inputs < 0 ? nullptr : &scene.surface_inputs[size_t(inputs)];
    return s && s->constants.opacity_threshold > 0 && s->find(InputField::kOpacity);
  });
}

bool is_end_hole(const Scene& scene, int32_t end, const rtc::RayQueryContext& context) {
  const CurveEnd& e = scene.curves.ends[size_t(end)];
  return is_tube_open(scene, e.segment, e.kind == CurveEndKind::kEnd ? 1.0f : kBeyond, context.inst_id, context.inst_prim_id);
}

}  // namespace primray
