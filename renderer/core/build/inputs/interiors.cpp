// Detection of media and of the ones around the camera.
#include "build/inputs/input_facts.hpp"

#include <algorithm>
#include <map>
#include <numeric>
#include <set>

#include "accel/query.hpp"
#include "medium/medium_stack.hpp"
#include "medium/volume_sets.hpp"
#include "surface/interaction.hpp"

namespace primray {
namespace {

// Limits of the boundaries that a ray is traced through, and of the lights that are tested one by one.
constexpr int kMostBoundaries = 256, kMostLights = 4096;

bool has(const float* row, int color) { return std::max({row[color], row[color + 1], row[color + 2]}) > 0; }

// Writes the medium inside an object with an interface to the columns `open` of its OpenPBR row.
void fill(const VolumeInput& volume, float* open) {
  const vec3 e = volume.extinction, s = volume.scattering;
  open[kOpenExtinction] = e.x, open[kOpenExtinction + 1] = e.y, open[kOpenExtinction + 2] = e.z;
  open[kOpenScattering] = s.x, open[kOpenScattering + 1] = s.y, open[kOpenScattering + 2] = s.z;
  open[kOpenPhase] = volume.phase;
}

// Joins the surfaces of each mesh that has several, represented by the first of them.
void join_objects(const Scene& scene, Interiors& interiors) {
  const MeshTable& meshes = scene.meshes;
  std::vector<int32_t> first(interiors.bounds_medium.size());
  std::iota(first.begin(), first.end(), 0);
  const auto root = [&](int32_t s) {
    while (first[size_t(s)] != s) s = first[size_t(s)];
    return s;
  };
  bool joined = false;
  for (size_t i = 1; i < meshes.surface.size(); ++i) {
    const int32_t a = meshes.surface[i - 1], b = meshes.surface[i];
    if (meshes.vertex_base[i] != meshes.vertex_base[i - 1] || !interiors.bounds_medium[size_t(a)] ||
        !interiors.bounds_medium[size_t(b)])
      continue;
    const int32_t low = std::min(root(a), root(b)), high = std::max(root(a), root(b));
    first[size_t(high)] = low, joined |= low != high;
  }
  if (!joined) return;
  for (size_t i = 0; i < first.size(); ++i) first[i] = root(int32_t(i));
  interiors.object_of = std::move(first);
}

// Surface of an object that contains `p`, found by a ray, and the distance to its boundary.
struct Found {
  float distance;
  int32_t surface;
};

// Objects that a ray leaves without having entered them, and volumes (medium/volume_sets.hpp).
std::vector<Found> objects_along(const Scene& scene, const vec3& p, const vec3& d, std::vector<VolumeObject>& volumes) {
  const vfloat<1> far(kInfinity), zero(0.0f);
  const auto lane = [](const vec3& v) { return vvec3<1>(vfloat<1>(v.x), vfloat<1>(v.y), vfloat<1>(v.z)); };
  const vbool<1> one(true);
  Rays<1> ray{lane(p), lane(d), zero, far};
  std::map<int32_t, int> depth;
  std::map<VolumeObject, int> volume_depth;
  std::vector<Found> found;
  for (int k = 0; k < kMostBoundaries; ++k) {
    const Hits<1> hits = intersect(scene, false, one, ray);
    if (hits.geom[0] == -1) break;
    const Interaction<1> it = interact(scene, one, ray, hits);
    const bool front = dot(it.ng, ray.d)[0] < 0;
    const int32_t surface = it.surface[0];
    if (scene.interiors.has_bounded() && scene.interiors.volume_of[size_t(surface)] >= 0) {
      const VolumeObject object = volume_object_at(scene, HitGroup<1>(scene, one, hits), surface, 0);
      int& entered = volume_depth[object];
      if (front) {
        ++entered;
      } else if (--entered < 0) {
        volumes.push_back(object), entered = 0;
      }
    }
    if (scene.interiors.bounds_medium[size_t(surface)]) {
      int& entered = depth[scene.interiors.object_of.empty() ? surface : scene.interiors.object_of[size_t(surface)]];
      if (front) {
        ++entered;
      } else if (--entered < 0) {
        found.push_back({length(it.p - lane(p))[0], surface});
        entered = 0;
      }
    }
    ray.o = it.p + it.ng * (it.offset * (front ? -1.0f : 1.0f));
  }
  return found;
}

// What contains a point: surfaces of objects, the innermost first, and volumes. Two of three rays must find it: one may slip
// past an edge, or through an open mesh.
struct Around {
  std::vector<Found> objects;
  std::vector<VolumeObject> volumes;
};

Around objects_around(const Scene& scene, const vec3& p) {
  const vec3 directions[3] = {{0.4621f, 0.7214f, 0.5158f}, {-0.8037f, 0.2113f, 0.5562f}, {0.1873f, -0.5229f, -0.8316f}};
  std::map<int32_t, std::vector<float>> seen;
  std::map<VolumeObject, int> volumes_seen;
  for (const vec3& d : directions) {
    std::map<int32_t, float> nearest;
    std::vector<VolumeObject> volumes;
    for (const Found& f : objects_along(scene, p, d * (1 / std::sqrt(dot(d, d))), volumes))
      nearest.emplace(f.surface, f.distance);
    for (const VolumeObject& object : std::set<VolumeObject>(volumes.begin(), volumes.end())) ++volumes_seen[object];
    for (const auto& [surface, distance] : nearest) seen[surface].push_back(distance);
  }
  Around around;
  std::vector<Found>& objects = around.objects;
  for (const auto& [object, rays] : volumes_seen)
    if (rays >= 2) around.volumes.push_back(object);
  for (auto& [surface, distances] : seen)
    if (distances.size() >= 2) objects.push_back({*std::min_element(distances.begin(), distances.end()), surface});
  std::sort(objects.begin(), objects.end(), [](const Found& a, const Found& b) { return a.distance < b.distance; });
  return around;
}

// Stack of objects, of which the innermost is the first.
MediumStack<1> stack_of(const Scene& scene, const std::vector<Found>& objects) {
  MediumStack<1> stack;
  for (size_t i = objects.size(); i-- > 0;) stack.add(scene, vbool<1>(true), vint<1>(objects[i].surface));
  return stack;
}

}  // namespace

MediaAround media_around(const Scene& scene, const vec3& p) {
  MediaAround around;
  const Around found = objects_around(scene, p);
  const MediumStack<1> stack = stack_of(scene, found.objects);
  for (int k = 0; k < kMaxNestedMedia; ++k) around.surfaces[k] = stack.surfaces[k][0];
  around.volumes = found.volumes;
  return around;
}

void mark_media_boundaries(Scene& scene) {
  Interiors& interiors = scene.interiors;
  Interiors given;
  given.priorities = std::move(interiors.priorities);
  given.volume_of = std::move(interiors.volume_of), given.volumes = std::move(interiors.volumes);
  given.filled = std::move(interiors.filled), given.fog = interiors.fog;
  interiors = std::move(given);
  if (interiors.has_added()) {
    interiors.followed = scene.shadows_need_hits = true;
    if (interiors.has_bounded()) interiors.volume_of.resize(scene.surfaces.rows.size() / kSurfaceFields, -1);
    for (const Volume& v : interiors.volumes) interiors.emits |= has(&v.emission.x, 0);
    interiors.emits |= interiors.fog.emits();
    // Lanes without a path, and scenes without shapes, read a surface as well.
    if (scene.surfaces.rows.empty()) scene.surfaces.add(SurfaceInput()), scene.surface_inputs_of.push_back(-1);
    // Where media are followed, all surfaces are shaded as if they could be OpenPBR's: there must be a row to read.
    if (scene.surfaces.open_pbr.empty()) scene.surfaces.open_pbr.resize(kOpenPbrFields, 0.0f);
  }
  if (scene.surfaces.open_pbr.empty()) return;
  const size_t count = scene.surfaces.rows.size() / kSurfaceFields;
  interiors.per_length = float(1 / scene.scale);
  interiors.bounds_medium.assign(count, 0);
  int boundaries = 0;
  bool media = interiors.has_added();
  const float per_length = interiors.per_length;
  for (const auto& [surface, volume] : interiors.filled) {
    if (!has(&volume.emission.x, 0)) continue;
    interiors.emission.resize(count, vec3(0.0f)), interiors.emits = true;
    interiors.emission[size_t(surface)] = volume.emission * per_length;
  }
  for (size_t i = 0; i < count; ++i) {
    const float* row = &scene.surfaces.rows[i * kSurfaceFields];
    const int flags = int_at(row, kFlags);
    if (!(flags & kOpenPbr) || (flags & kThin)) continue;
    float* open = &scene.surfaces.open_pbr[size_t(int_at(row, kOpenPbrRow)) * kOpenPbrFields];
    if (scene.surface_inputs_of[i] >= 0) average_interior(scene, int32_t(i), open);
    media |= open[kOpenSubsurface] > 0, interiors.walks |= open[kOpenSubsurface] > 0;
    if (!(row[kTransmission] > 0)) continue;
    for (const auto& [surface, volume] : interiors.filled)
      if (size_t(surface) == i) fill(volume, open);
    interiors.bounds_medium[i] = 1, ++boundaries;
    const bool filled = has(open, kOpenExtinction) || (!interiors.emission.empty() && has(&interiors.emission[i].x, 0));
    media |= filled;
    scene.shadows_need_hits |= filled && open[kOpenEta] == 1;
  }
  interiors.followed = media || boundaries > 1;
  if (boundaries > 1) join_objects(scene, interiors);
}

void find_camera_media(Scene& scene) {
  Interiors& interiors = scene.interiors;
  std::fill_n(interiors.camera, kMaxNestedMedia, -1);
  interiors.camera_index2 = 1, interiors.camera_volumes.clear(), interiors.lit = false;
  const bool any_boundary = std::count(interiors.bounds_medium.begin(), interiors.bounds_medium.end(), 1) > 0;
  if (!interiors.followed || !(any_boundary || interiors.has_bounded())) return;
  const Around found = objects_around(scene, scene.camera.world_from_camera.o);
  interiors.camera_volumes = found.volumes;
  if (!any_boundary) return;
  const MediumStack<1> stack = stack_of(scene, found.objects);
  for (int k = 0; k < kMaxNestedMedia; ++k) interiors.camera[k] = stack.surfaces[k][0];
  const float index = ior_in(scene, stack)[0];
  interiors.camera_index2 = index * index;
  const LightTable& lights = scene.lights;
  interiors.lit = scene.emitters.any() || lights.analytic_count > kMostLights;
  for (int i = 0; i < lights.analytic_count && !interiors.lit; ++i) {
    const float* row = lights.row(i);
    const LightType type = LightType(int_at(row, kType));
    if (type == LightType::kDistant || type == LightType::kDome) continue;
    interiors.lit = !objects_around(scene, {row[kOrigin], row[kOrigin + 1], row[kOrigin + 2]}).objects.empty();
  }
}

}  // namespace primray
