// Lower bounds of texture footprints. A ray cone only gets wider along its path, and no path to a point is shorter than the
// straight one: at distance d from the camera every ray, whether mirrored, refracted or scattered, is at least as wide as a
// camera ray. That bounds the footprint on every triangle from below, visible or not, without knowing which rays will hit it.
#include "build/inputs/input_facts.hpp"

#include <algorithm>
#include <cmath>
#include <thread>

#include "base/time_spans.hpp"
#include "texture/mip_pyramid.hpp"

namespace primray {
namespace {

dvec3 position(const Scene& s, uint32_t vertex) {
  const float* p = &s.positions[3 * size_t(vertex)];
  return {p[0], p[1], p[2]};
}

// Smallest width of a cone at a distance of `d` or more from the camera's centre.
double cone_at(const Camera& c, double d) {
  return c.cone_width() + double(c.cone_spread()) * std::max(d - c.lens_radius, double(c.near));
}

// Upper bound of a matrix's largest stretch: the square root of the largest row sum of |M^T M|.
double largest_stretch(const dvec3 (&m)[3]) {
  double most = 0;
  for (const dvec3& a : m) most = std::max(most, std::fabs(dot(a, m[0])) + std::fabs(dot(a, m[1])) + std::fabs(dot(a, m[2])));
  return std::sqrt(most);
}

// Smallest width of any cone on the instances of a group, in the group's own lengths; infinite without instances.
std::vector<double> widths_on_instances(const Scene& s) {
  const dvec3 camera(s.camera.world_from_camera.o);
  std::vector<double> least(s.groups.size(), INFINITY);
  std::vector<dvec3> center(s.groups.size(), dvec3(0.0));
  std::vector<double> radius(s.groups.size(), 0.0);
  for (size_t g = 1; g < s.groups.size(); ++g) {
    const Group& group = s.groups[g];
    dvec3 lo(INFINITY), hi(-INFINITY);
    for (uint32_t v = group.vertex_base; v < group.vertex_base + group.vertex_count; ++v) {
      const dvec3 p = position(s, v);
      lo = {std::min(lo.x, p.x), std::min(lo.y, p.y), std::min(lo.z, p.z)};
      hi = {std::max(hi.x, p.x), std::max(hi.y, p.y), std::max(hi.z, p.z)};
    }
    if (group.vertex_count == 0) continue;
    center[g] = (lo + hi) * 0.5, radius[g] = length(hi - lo) * 0.5;
  }
  const size_t instances = s.world_from_group.size() / 12;
  for (size_t p = 0; p < s.placement_group.size(); ++p) {
    const size_t end = p + 1 < s.placement_instance.size() ? size_t(s.placement_instance[p + 1]) : instances;
    const int g = s.placement_group[p];
    // With two levels of instances the inner ones may be anywhere.
    if (p - s.groups[0].placement_base >= s.groups[0].placement_count) least[g] = 0;
    for (size_t i = s.placement_instance[p]; i < end; ++i) {
      const daffine m = affine_from_columns(&s.world_from_group[12 * i]);
      const dvec3 c = m.point(center[g]);
      const double stretch = largest_stretch({m.x, m.y, m.z});
      if (!(stretch > 0)) continue;
      least[g] = std::min(least[g], cone_at(s.camera, length(c - camera) - stretch * radius[g]) / stretch);
    }
  }
  return least;
}

// A texture that a surface reads: the primvar that gives its st (-1: none), and its transform.
struct TextureRead {
  int texture, primvar;
  const float* st_transform;
};

template <class F>
void for_reads(const Scene& s, const SurfaceInputs& inputs, const F& f) {
  for (const InputSource& source : inputs.sources)
    if (source.texture >= 0) f(TextureRead{source.texture, source.primvar, source.st_transform});
  if (inputs.tape < 0) return;
  for (const PatternImage& image : s.tapes[size_t(inputs.tape)].images)
    for (const int32_t texture : {image.color, image.alpha})
      if (texture >= 0) f(TextureRead{texture, image.primvar, image.st_transform});
}

// Accounts for one triangle with the texture; `width`: of the narrowest cone on it, in its own lengths.
void add_triangle(const Scene& s, const TextureRead& source, float& least, uint32_t mesh, size_t triangle,
                  const uint32_t* corner, double area2, double width) {
  const PrimvarTable& t = s.primvars;
  const int32_t primvar = source.primvar < 0 ? -1 : t.of_mesh[size_t(mesh) * t.names + source.primvar];
  const PrimvarKind kind = primvar < 0 ? PrimvarKind::kConstant : PrimvarKind(t.kind[primvar]);
  if (kind != PrimvarKind::kPoint && kind != PrimvarKind::kCorner) {
    least = 0;  // single texels are read, at the finest level
    return;
  }
  double st[3][2];
  for (int k = 0; k < 3; ++k) {
    const int64_t row = kind == PrimvarKind::kPoint ? int64_t(corner[k]) - s.meshes.vertex_base[mesh]
                                                    : 3 * (int64_t(triangle) - s.meshes.triangle_base[mesh]) + k;
    const float* value = &t.values[size_t(t.base[primvar]) + size_t(row) * t.width[primvar]];
    st[k][0] = value[0], st[k][1] = value[std::min(1, t.width[primvar] - 1)];
  }
  const double st_area2 = (st[1][0] - st[0][0]) * (st[2][1] - st[0][1]) - (st[2][0] - st[0][0]) * (st[1][1] - st[0][1]);
  const float* m = source.st_transform;
  const double stretch = double(m[0]) * m[4] - double(m[1]) * m[3];
  if (!(width > 0)) least = 0;
  const double st_area = std::fabs(st_area2 * stretch);
  // A triangle that shows a line or a point of the texture requires no level: those of the others do.
  if (!(st_area > 0)) return;
  least = std::min(least, float(st_area / area2 * width * width));
}

// Triangles that are worth a second thread.
constexpr size_t kManyTriangles = 1 << 16;

// Accounts for the triangles [first, end) of group g; `least`: the least footprint by texture.
void add_triangles(const Scene& s, size_t g, size_t first, size_t end, double width_on_instances, std::vector<float>& least) {
  const dvec3 camera(s.camera.world_from_camera.o);
  const Group& group = s.groups[g];
  for (size_t t = first; t < end; ++t) {
    const uint32_t mesh = uint32_t(s.triangle_mesh[t]);
    const int32_t inputs = s.surface_inputs_of[s.meshes.surface[mesh]];
    if (inputs < 0) continue;
    uint32_t corner[3];
    for (int k = 0; k < 3; ++k) corner[k] = group.vertex_base + s.indices[3 * t + k];
    const dvec3 p = position(s, corner[0]), e1 = position(s, corner[1]) - p, e2 = position(s, corner[2]) - p;
    const dvec3 n = cross(e1, e2), to = p - camera;
    const double area2 = length(n);
    if (!(area2 > 0)) continue;
    // A triangle is no nearer than its plane, nor than a sphere about its corner that contains it.
    const double distance = std::max(std::fabs(dot(n, to)) / area2, length(to) - std::max(length(e1), length(e2)));
    const double width = g == 0 ? cone_at(s.camera, distance) : width_on_instances;
    for_reads(s, s.surface_inputs[inputs], [&](const TextureRead& read) {
      add_triangle(s, read, least[size_t(read.texture)], mesh, t, corner, area2, width);
    });
  }
}

}  // namespace

void measure_footprints(Scene& s) {
  const TimeSpan span("measure footprints of textures");
  if (s.moves()) {  // between samples it may come nearer than at any of them
    for (Texture& t : s.textures) t.least_footprint = 0;
    return;
  }
  const std::vector<double> on_instances = widths_on_instances(s);
  std::vector<float> least(s.textures.size(), INFINITY), other = least;
  for (size_t g = 0; g < s.groups.size(); ++g) {
    const Group& group = s.groups[g];
    const size_t first = group.triangle_base, end = first + group.triangle_count + group.cutout_count;
    const size_t middle = end - first < kManyTriangles ? end : first + (end - first) / 2;
    std::thread rest;
    if (middle < end) rest = std::thread([&] { add_triangles(s, g, middle, end, on_instances[g], other); });
    add_triangles(s, g, first, middle, on_instances[g], least);
    if (rest.joinable()) rest.join();
  }
  for (size_t i = 0; i < s.textures.size(); ++i) s.textures[i].least_footprint = std::min(least[i], other[i]);
  // Curved shapes share one st; an instance's primvar may serve as st as well.
  for (const int32_t surface : s.curved.surface) {
    const int32_t inputs = s.surface_inputs_of[surface];
    if (inputs < 0) continue;
    for_reads(s, s.surface_inputs[inputs],
              [&](const TextureRead& read) { s.textures[size_t(read.texture)].least_footprint = 0; });
  }
  for (const SurfaceInputs& inputs : s.surface_inputs) {
    for_reads(s, inputs, [&](const TextureRead& read) {
      if (read.primvar < 0) return;
      for (size_t i = size_t(read.primvar); i < s.primvars.of_placement.size(); i += size_t(s.primvars.names))
        if (s.primvars.of_placement[i] >= 0) s.textures[size_t(read.texture)].least_footprint = 0;
    });
  }
}

int finest_level(const Texture& texture, int width, int height) {
  if (texture.finest_only || !(texture.least_footprint > 0)) return 0;
  // A twentieth of a level covers coarse_log2 and the rounding of single precision.
  const double level = 0.5 * std::log2(double(texture.least_footprint) * width * height) - 0.05;
  return int(std::clamp(std::floor(level), 0.0, double(last_level_of(width, height))));
}

std::vector<int> pattern_levels(const Scene& scene) {
  std::vector<char> is_read(scene.textures.size(), 0);
  for (const Tape& tape : scene.tapes)
    for (const PatternImage& image : tape.images)
      for (const int32_t texture : {image.color, image.alpha})
        if (texture >= 0) is_read[size_t(texture)] = 1;
  std::vector<int> levels;
  for (size_t i = 0; i < is_read.size(); ++i) {
    if (!is_read[i]) continue;
    const Texture& texture = scene.textures[i];
    for (const TextureImage& image : texture.images) levels.push_back(finest_level(texture, image.width, image.height));
  }
  return levels;
}

bool has_needed_levels(const Texture& texture, const Texture& made) {
  return std::ranges::all_of(made.images, [&](const TextureImage& image) {
    return image.first_level <= finest_level(texture, image.width, image.height);
  });
}

}  // namespace primray
