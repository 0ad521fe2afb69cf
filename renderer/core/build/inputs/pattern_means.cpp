// Estimation of pattern_means.hpp.
#include "build/inputs/pattern_means.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "surface/run_pattern.hpp"

namespace primray {
namespace {

constexpr size_t kTries = 64;  // per surface

// Triangles with a surface that has a tape: up to kTries, evenly selected.
struct Worn {
  size_t count = 0;
  std::vector<size_t> tried;
};

std::vector<Worn> worn_triangles(const Scene& s) {
  std::vector<Worn> worn(s.surface_inputs.size());
  const auto of = [&](size_t triangle) -> Worn* {
    const int32_t inputs = s.surface_inputs_of[size_t(s.meshes.surface[size_t(s.triangle_mesh[triangle])])];
    return inputs >= 0 && s.surface_inputs[size_t(inputs)].tape >= 0 ? &worn[size_t(inputs)] : nullptr;
  };
  for (size_t t = 0; t < s.triangle_mesh.size(); ++t)
    if (Worn* w = of(t)) ++w->count;
  std::vector<size_t> met(worn.size(), 0);
  for (size_t t = 0; t < s.triangle_mesh.size(); ++t) {
    Worn* w = of(t);
    if (w && met[size_t(w - worn.data())]++ % ((w->count - 1) / kTries + 1) == 0) w->tried.push_back(t);
  }
  return worn;
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

void note_pattern_means(Scene& s) {
  const std::vector<Worn> worn = worn_triangles(s);
  for (size_t i = 0; i < worn.size(); ++i) {
    if (worn[i].tried.empty()) continue;
    SurfaceInputs& inputs = s.surface_inputs[i];
    double sum[kMostOutputs][3] = {};
    for (size_t k = 0; k < worn[i].tried.size(); ++k) add_outputs(s, s.tapes[size_t(inputs.tape)], worn[i].tried[k], k, sum);
    for (InputSource& source : inputs.sources)
      for (int c = 0; c < 3 && source.output >= 0; ++c)
        source.fallback[c] = float(sum[source.output][c] / double(worn[i].tried.size()));
  }
}

}  // namespace primray
