// Construction of Embree scenes over the flat arrays, which are shared, not copied.
#include "accel/build.hpp"

#include "accel/geometry.hpp"
#include "base/error.hpp"
#include "base/time_spans.hpp"

namespace primray {
namespace {

// Number of segments from which on a group of curves takes Embree's compact structures: 45 bytes per segment instead of 122, at
// three fifths of the speed.
constexpr uint32_t kManySegments = 1 << 23;

void attach(rtc::Scene scene, const OwnedGeometry& g, uint32_t id) { embree().rtcAttachGeometryByID(scene, g.get(), id); }

// Returns the pairs among the first `paired` of the group's triangles.
OwnedGeometry make_pairs(const Scene& scene, const Group& group, uint32_t paired) {
  OwnedGeometry g = over_positions(rtc::kQuad, scene, group);
  embree().rtcSetSharedGeometryBuffer(g.get(), rtc::kIndexBuffer, 0, rtc::kUint4, scene.indices.data(),
                                      size_t(group.triangle_base) * 12 + 8, 24, paired / 2);
  return g;
}

uint32_t paired_in(const Scene& scene, const Group& group) {
  return count_paired({scene.indices.data() + size_t(group.triangle_base) * 3, size_t(group.triangle_count) * 3});
}

// Attaches the group's triangles without a filter, the first `paired` of them as pairs.
void attach_triangles(rtc::Scene target, const Scene& scene, const Group& group, uint32_t paired) {
  if (paired > 0) {
    const OwnedGeometry g = make_pairs(scene, group, paired);
    embree().rtcCommitGeometry(g.get());
    attach(target, g, kPairGeometry);
  }
  if (const uint32_t alone = group.triangle_count - paired; alone > 0) {
    const OwnedGeometry g = make_triangles(scene, group, paired, alone);
    embree().rtcCommitGeometry(g.get());
    attach(target, g, kTriangleGeometry);
  }
}

// Attaches triangles with a filter that tests whether a triangle is present; `first` is the first of them in the group.
void attach_cutouts(rtc::Scene target, Scene& scene, const Group& group, OwnedGeometry g, uint32_t first, uint32_t id) {
  scene.cutouts.push_back({&scene, uint32_t(&group - scene.groups.data()), first});
  set_cutout_filter(g.get(), scene.cutouts.back());
  embree().rtcCommitGeometry(g.get());
  attach(target, g, id);
}

// Attaches the group's triangles with moving vertices.
void attach_moving(rtc::Scene target, Scene& scene, const Group& group) {
  const uint32_t first = group.still_count();
  const int steps = vertex_steps(scene, group);
  if (group.moving_count > 0) {
    const OwnedGeometry g = make_triangles(scene, group, first, group.moving_count, steps);
    embree().rtcCommitGeometry(g.get());
    attach(target, g, kMovingGeometry);
  }
  if (group.moving_cutout_count > 0)
    attach_cutouts(target, scene, group,
                   make_triangles(scene, group, first + group.moving_count, group.moving_cutout_count, steps),
                   first + group.moving_count, kMovingCutoutGeometry);
}

void attach_curves(rtc::Scene target, Scene& scene, const Group& group, const CurveRange& range, int steps, uint32_t tubes,
                   uint32_t ends) {
  if (range.segments > 0) {
    const OwnedGeometry g = make_tubes(scene, group, range, steps);
    const bool holes = has_holes(scene, range), fibres = has_fibres(scene, range);
    if (holes || fibres) scene.cutouts.push_back({&scene, uint32_t(&group - scene.groups.data()), range.segment});
    if (holes) set_tube_filter(g.get(), scene.cutouts.back()), scene.has_cutouts = true;
    if (fibres) set_fibre_filter(g.get(), scene.cutouts.back(), holes);
    embree().rtcCommitGeometry(g.get());
    attach(target, g, tubes);
  }
  if (range.ends == 0) return;
  scene.tube_ends.push_back({&scene, uint32_t(&group - scene.groups.data()), range.end, range.ends, steps});
  attach(target, make_tube_ends(&scene.tube_ends.back()), ends);
}

OwnedGeometry make_placement(Scene& scene, size_t placement) {
  const rtc::Api& e = embree();
  const bool last = placement + 1 == scene.placement_group.size();
  const size_t first = scene.placement_instance[placement],
               end = last ? scene.world_from_group.size() / 12 : size_t(scene.placement_instance[placement + 1]);
  const Group& group = scene.groups[scene.placement_group[placement]];
  const float* matrices = scene.world_from_group.data() + first * 12;
  if (needs_placed_geometry(scene, placement)) {
    scene.placed.push_back(make_placed(scene, placement, uint32_t(first), uint32_t(end)));
    return make_placed_geometry(&scene.placed.back());
  }
  OwnedGeometry g(e.rtcNewGeometry(embree_device(), rtc::kInstanceArray));
  e.rtcSetGeometryInstancedScene(g.get(), group.accel.get());
  e.rtcSetSharedGeometryBuffer(g.get(), rtc::kTransformBuffer, 0, rtc::kFloat3x4ColumnMajor, matrices, 0, 48, end - first);
  e.rtcCommitGeometry(g.get());
  return g;
}

void attach_all_curves(rtc::Scene target, Scene& scene, const Group& group) {
  attach_curves(target, scene, group, group.curves.still, 1, kCurveGeometry, kCurveEndGeometry);
  attach_curves(target, scene, group, group.curves.moving, vertex_steps(scene, group), kMovingCurveGeometry,
                kMovingCurveEndGeometry);
}

// Curves of the world have an Embree scene of their own. They need no robust mode, as there is no edge at which two of them
// meet, and take three quarters of the time without it. Single rays then have other bits than packets where a ray touches a
// box's side, so there are no packets in that scene.
void build_world_curves(Scene& scene, Group& world, int compact) {
  world.curve_accel = new_embree_scene(compact);
  attach_all_curves(world.curve_accel.get(), scene, world);
  embree().rtcCommitScene(world.curve_accel.get());
}

void build_group(Scene& scene, Group& group) {
  const int compact = group.curves.still.segments > kManySegments ? rtc::kCompact : 0;
  const bool curves_apart = &group == &scene.groups[0] && group.curves.any();
  if (curves_apart) build_world_curves(scene, group, compact);
  group.accel = new_embree_scene(rtc::kRobust | (curves_apart ? 0 : compact));
  rtc::Scene target = group.accel.get();
  group.paired_count = paired_in(scene, group);
  scene.has_pairs |= group.paired_count > 0;
  attach_triangles(target, scene, group, group.paired_count);
  if (group.cutout_count > 0)
    attach_cutouts(target, scene, group, make_triangles(scene, group, group.triangle_count, group.cutout_count),
                   group.triangle_count, kCutoutGeometry);
  attach_moving(target, scene, group);
  for_curved_kinds([&]<class K>(K) {
    const CurvedRange& r = group.curved.of<K>();
    if (r.count > 0) attach(target, K::geometry(&scene.curved.records<K>()[r.first], r.count), K::kGeometry);
  });
  if (!curves_apart) attach_all_curves(target, scene, group);
  for (uint32_t i = 0; i < group.placement_count; ++i)
    attach(target, make_placement(scene, group.placement_base + i), kFirstPlacement + i);
  embree().rtcCommitScene(target);
  check_embree();
}

// Builds the world without Embree, if possible; returns whether it did.
bool build_without_embree(Scene& scene) {
  const Group& world = scene.groups[0];
  if (world.all_triangles() > world.triangle_count || world.placement_count > 0 || world.curved.any() || world.curves.any())
    return false;
  const TriangleSoup soup{scene.positions.data() + 3 * size_t(world.vertex_base),
                          scene.indices.data() + 3 * size_t(world.triangle_base), world.triangle_count,
                          paired_in(scene, world)};
  if (soup.paired == 0)  // pairs mean many
    scene.few_triangles = gather_few(soup.positions, soup.indices, soup.count);
  if (!scene.few_triangles.any()) scene.triangle_bvh = build_triangle_bvh(soup);
  return scene.few_triangles.any() || scene.triangle_bvh.any();
}

}  // namespace

void build_accel(Scene& scene) {
  const TimeSpan span("build the hierarchy");
  // Build shapes, then prototypes of them (which the builder was given later), and finally the world.
  for (size_t i = 1; i < scene.groups.size(); ++i) build_group(scene, scene.groups[i]);
  if (!build_without_embree(scene)) build_group(scene, scene.groups[0]);
}

EmbreeWorld::EmbreeWorld(const Scene& scene) : scene_(scene.accel()) {
  if (scene_) return;
  const Group& world = scene.groups[0];
  paired_ = paired_in(scene, world);
  own_ = new_embree_scene(), scene_ = own_.get();
  attach_triangles(scene_, scene, world, paired_);
  embree().rtcCommitScene(scene_);
  check_embree();
}

}  // namespace primray
