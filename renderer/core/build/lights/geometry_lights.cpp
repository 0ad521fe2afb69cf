// Radiance and lookup tables of geometry lights.
#include "build/lights/lights.hpp"

#include <algorithm>
#include <cmath>

#include "scene/scene.hpp"

namespace primray {
namespace {

dvec3 vertex(const Scene& s, size_t base, uint32_t index) {
  const float* p = &s.positions[3 * (base + index)];
  return {p[0], p[1], p[2]};
}

uint32_t vertex_base_of(const Scene& s, size_t triangle) {
  for (const Group& g : s.groups)
    if (triangle >= g.triangle_base && triangle < size_t(g.triangle_base) + g.triangle_count + g.cutout_count)
      return g.vertex_base;
  return 0;
}

double curved_area(const Scene& s, const GeometryLight& light, const daffine& m) {
  double area = 0;
  for (const Group& g : s.groups)
    for_curved_kinds([&]<class K>(K) {
      const CurvedRange& r = g.curved.of<K>();
      if (r.has_row(light.curved)) area = K::area(s.curved.records<K>()[r.record_of(light.curved)], m);
    });
  return area;
}

}  // namespace

double world_area(const Scene& s, const GeometryLight& light, const daffine& m) {
  double area = 0;
  for (const auto& [first, end] : light.triangles) {
    const uint32_t base = vertex_base_of(s, first);
    for (size_t t = first; t < end; ++t) {
      const dvec3 p = vertex(s, base, s.indices[3 * t]);
      const dvec3 e1 = vertex(s, base, s.indices[3 * t + 1]) - p, e2 = vertex(s, base, s.indices[3 * t + 2]) - p;
      area += 0.5 * length(cross(m.vector(e1), m.vector(e2)));
    }
  }
  if (light.curved >= 0) area += curved_area(s, light, m);
  return area / (s.scale * s.scale);
}

vec3 placed_radiance(const Scene& s, const GeometryLight& light, const daffine& m) {
  if (!light.normalize) return light.radiance;
  const double area = world_area(s, light, m);
  return area > 0 ? vec3(dvec3(light.radiance) * (1 / area)) : vec3(0.0f);
}

void finish_geometry_lights(Scene& s, const std::vector<daffine>& first_place) {
  GeometryLights& lights = s.geometry_lights;
  lights.of_mesh.resize(s.meshes.surface.size(), -1), lights.of_curved.resize(s.curved.rows(), -1);
  for (size_t i = 0; i < lights.all.size(); ++i) {
    const GeometryLight& light = lights.all[i];
    const vec3 L = placed_radiance(s, light, first_place[i]);
    lights.flags.push_back((light.own ? GeometryLights::kOwn : 0) | (light.shown ? GeometryLights::kShown : 0));
    lights.link.push_back(light.rules.link), lights.ends.push_back(end_number(light.rules.group, kEndLight));
    lights.diffuse.push_back(light.row[kDiffuseFactor]), lights.specular.push_back(light.row[kSpecularFactor]);
    lights.radiance.insert(lights.radiance.end(), {L.x, L.y, L.z});
  }
}

}  // namespace primray
