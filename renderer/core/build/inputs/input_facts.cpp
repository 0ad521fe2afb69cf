// Computation of ranges and means of surfaces' inputs.

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/error.hpp"
#include "build/inputs/input_facts.hpp"
#include "surface/evaluate_inputs.hpp"
#include "surface/run_pattern.hpp"

namespace primray {

namespace {

constexpr size_t kTries = 64;  // per surface

// Triangles with a surface that has a tape: up to kTries, evenly selected.
struct TexturedTriangles {
  size_t count = 0;
  std::vector<size_t> tried;
};

std::vector<TexturedTriangles> textured_triangles(const Scene& s) {
  std::vector<TexturedTriangles> triangles(s.surface_inputs.size());
  const auto of = [&](size_t triangle) -> TexturedTriangles* {
    const int32_t inputs = s.surface_inputs_of[size_t(s.meshes.surface[size_t(s.triangle_mesh[triangle])])];
    return inputs >= 0 && s.surface_inputs[size_t(inputs)].tape >= 0 ? &triangles[size_t(inputs)] : nullptr;
  };
  for (size_t t = 0; t < s.triangle_mesh.size(); ++t)
    if (TexturedTriangles* w = of(t)) ++w->count;
  std::vector<size_t> visited(triangles.size(), 0);
  for (size_t t = 0; t < s.triangle_mesh.size(); ++t) {
    TexturedTriangles* w = of(t);
    if (w && visited[size_t(w - triangles.data())]++ % ((w->count - 1) / kTries + 1) == 0) w->tried.push_back(t);
  }
  return triangles;
}

size_t group_of(const Scene& s, size_t triangle) {
  size_t g = 0;
  while (g + 1 < s.groups.size() && triangle >= s.groups[g + 1].triangle_base) ++g;
  return g;
}

int first_placement(const Scene& s, size_t group) {
  const auto found = std::find(s.placement_group.begin(), s.placement_group.end(), int32_t(group));
  return found == s.placement_group.end() ? -1 : int(found - s.placement_group.begin());
}

// Adds the outputs at one point of a triangle, the k-th try; values are clamped to [0, 1e30].
void add_outputs(const Scene& s, const Tape& tape, size_t triangle, size_t k, double (&sum)[kMostOutputs][3]) {
  const auto part = [&](double step) { return float(double(k + 1) * step - std::floor(double(k + 1) * step)); };
  float u = part(0.7548776662466927), v = part(0.5698402909980532);  // Roberts's sequence
  if (u + v > 1) u = 1 - u, v = 1 - v;
  const size_t g = group_of(s, triangle);
  const vbool<1> yes(true);
  const SurfacePoint<1> point(s, yes, vint<1>(int32_t(triangle)), vint<1>(int32_t(s.groups[g].vertex_base)),
                              vint<1>(g == 0 ? -1 : first_placement(s, g)), vint<1>(0), vfloat<1>(u), vfloat<1>(v));
  vvec3<1> outputs[kMostOutputs];
  run_pattern<1>({s, yes, point, vfloat<1>(0.0f)}, tape, int(tape.code.size()), outputs);
  for (size_t o = 0; o < tape.outputs.size(); ++o) {
    const vvec3<1> x = outputs[o];
    const float c[3] = {x.x[0], x.y[0], x.z[0]};
    for (int i = 0; i < 3; ++i) sum[o][i] += std::min(std::max(0.0, double(c[i])), 1e30);
  }
}

}  // namespace

void set_pattern_means(Scene& s) {
  // A scene that was built for a nearer camera has finer levels, which would give other means than those of a new one.
  std::vector<int> kept;
  for (Texture& texture : s.textures) {
    for (TextureImage& image : texture.images) {
      kept.push_back(image.first_level);
      image.first_level = std::clamp(finest_level(texture, image.width, image.height), image.first_level, image.last_level);
    }
  }
  const std::vector<TexturedTriangles> triangles = textured_triangles(s);
  for (size_t i = 0; i < triangles.size(); ++i) {
    if (triangles[i].tried.empty()) continue;
    SurfaceInputs& inputs = s.surface_inputs[i];
    double sum[kMostOutputs][3] = {};
    for (size_t k = 0; k < triangles[i].tried.size(); ++k)
      add_outputs(s, s.tapes[size_t(inputs.tape)], triangles[i].tried[k], k, sum);
    for (InputSource& source : inputs.sources)
      for (int c = 0; c < 3 && source.output >= 0; ++c)
        source.fallback[c] = float(sum[source.output][c] / double(triangles[i].tried.size()));
  }
  auto first = kept.begin();
  for (Texture& texture : s.textures)
    for (TextureImage& image : texture.images) image.first_level = *first++;
}

namespace {

// Lower bound of a source's first channel; 0 if it is unknown.
float lower_bound(const Scene& scene, const InputSource& source) {
  if (source.texture < 0) return 0;
  const Texture& texture = scene.textures[source.texture];
  float least = texture.udim ? source.missing[0] : INFINITY;
  const auto see = [&](float v) { least = std::min(least, v * source.scale[0] + source.bias[0]); };
  for (const TextureImage& image : texture.images) see(image.low[0]), see(image.high[0]);
  if (source.wrap_s == Wrap::kBlack || source.wrap_t == Wrap::kBlack) see(0);
  return least;
}

vec3 mean_of(const Scene& scene, const InputSource& source) {
  double sum[3] = {}, weight = 0;
  if (source.texture >= 0) {
    for (const TextureImage& image : scene.textures[source.texture].images) {
      for (int c = 0; c < 3; ++c) sum[c] += double(image.mean[c]) * source.scale[c] + source.bias[c];
      weight += 1;
    }
  } else if (source.primvar >= 0) {
    const PrimvarTable& t = scene.primvars;
    for (const std::vector<int32_t>* of : {&t.of_mesh, &t.of_curved, &t.of_placement}) {
      for (size_t i = source.primvar; i < of->size(); i += t.names) {
        const int32_t p = (*of)[i];
        if (p < 0) continue;
        const size_t end = size_t(p) + 1 < t.base.size() ? t.base[p + 1] : t.values.size();
        for (size_t at = t.base[p]; at + t.width[p] <= end; at += t.width[p], weight += 1)
          for (int c = 0; c < 3; ++c) sum[c] += t.values[at + std::min(c, t.width[p] - 1)];
      }
    }
  }
  if (weight == 0) return {source.fallback[0], source.fallback[1], source.fallback[2]};
  return {float(sum[0] / weight), float(sum[1] / weight), float(sum[2] / weight)};
}

}  // namespace

void set_input_features(Scene& scene) {
  scene.has_inputs = !scene.surface_inputs.empty();
  const auto check = [&](int texture) {
    if (texture >= 0 && !scene.textures[texture].udim && scene.textures[texture].images.empty())
      throw Error("internal", "a texture has no image");
  };
  for (const Tape& tape : scene.tapes)
    for (const PatternImage& image : tape.images) check(image.color), check(image.alpha);
  if (!scene.tapes.empty()) set_pattern_means(scene);
  for (const SurfaceInputs& inputs : scene.surface_inputs) {
    for (const InputSource& source : inputs.sources) check(source.texture);
    scene.has_emission |= inputs.find(InputField::kEmissiveColor) != nullptr;
    const InputSource* opacity = inputs.find(InputField::kOpacity);
    const SurfaceInput& s = inputs.constants;
    if (opacity && !(s.opacity_threshold > 0) && (s.presence || s.thin))
      scene.shadows_need_hits |= lower_bound(scene, *opacity) < 1;
  }
}

vec3 average_emission(const Scene& scene, int32_t surface) {
  const int32_t inputs = scene.surface_inputs_of[surface];
  const InputSource* source = inputs < 0 ? nullptr : scene.surface_inputs[inputs].find(InputField::kEmissiveColor);
  if (source) {
    const vec3 mean = mean_of(scene, *source);
    return {std::max(mean.x, 0.0f), std::max(mean.y, 0.0f), std::max(mean.z, 0.0f)};
  }
  const float* row = &scene.surfaces.rows[size_t(surface) * kSurfaceFields + kEmission];
  return {row[0], row[1], row[2]};
}

namespace {

// Inputs of a surface with varying inputs, all at their means.
struct MeanInputs {
  const SurfaceInput& constants;
  SurfaceValues<1> values;
  std::optional<OpenPbrValues<1>> open;
  std::optional<HairValues<1>> hair;

  MeanInputs(const Scene& scene, const SurfaceInputs& inputs) : constants(inputs.constants), values(inputs.constants) {
    if (inputs.constants.open_pbr) open.emplace(*inputs.constants.open_pbr);
    if (inputs.constants.hair) hair.emplace(*inputs.constants.hair);
    for (const InputSource& source : inputs.sources) {
      const vec3 m = mean_of(scene, source);
      const vvec3<1> mean{vfloat<1>(m.x), vfloat<1>(m.y), vfloat<1>(m.z)};
      if (source.field < InputField::kOpenPbr)
        values.set(source.field, mean);
      else if (open)
        open->set(source.field, mean);
      else if (hair)
        hair->set(source.field, mean);
    }
  }
};

}  // namespace

void average_row(const Scene& scene, int32_t surface, float (&row)[kSurfaceFields]) {
  const int32_t number = scene.surface_inputs_of[surface];
  if (number < 0) {
    std::copy_n(&scene.surfaces.rows[size_t(surface) * kSurfaceFields], int(kSurfaceFields), row);
    return;
  }
  const MeanInputs means(scene, scene.surface_inputs[number]);
  vfloat<1> columns[kSurfaceFields], open_columns[kOpenPbrFields];
  if (means.open) {
    reduce_open_pbr(*means.open, means.constants.thin, open_columns);
    const vint<1> at(int_at(&scene.surfaces.rows[size_t(surface) * kSurfaceFields], kOpenPbrRow));
    reduce_surface(means.constants, means.values, *means.open, open_columns, at, columns);
  } else if (means.hair) {
    const vint<1> at(int_at(&scene.surfaces.rows[size_t(surface) * kSurfaceFields], kOpenPbrRow));
    reduce_surface(means.constants, means.values, *means.hair, at, columns);
  } else {
    reduce_surface(means.constants, means.values, columns);
  }
  for (int i = 0; i < kSurfaceFields; ++i) row[i] = columns[i][0];
}

void average_interior(const Scene& scene, int32_t surface, float* open) {
  const MeanInputs means(scene, scene.surface_inputs[scene.surface_inputs_of[surface]]);
  vfloat<1> columns[kOpenPbrFields];
  reduce_open_pbr(*means.open, means.constants.thin, columns);
  for (const int color : {kOpenExtinction, kOpenScattering})
    for (int c = 0; c < 3; ++c) open[color + c] = columns[color + c][0];
  open[kOpenPhase] = columns[kOpenPhase][0];
}

}  // namespace primray
