// Part of SceneBuilder that sets a distorting lens.
#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include "base/error.hpp"
#include "build/builder.hpp"

namespace primray {
namespace {

DistortionModel model_of(std::string_view name) {
  constexpr std::array<std::pair<std::string_view, DistortionModel>, 4> kModels{{
      {"rational", DistortionModel::kRational},
      {"angle-to-radius", DistortionModel::kAngleToRadius},
      {"radius-to-angle", DistortionModel::kRadiusToAngle},
      {"table", DistortionModel::kTable},
  }};
  for (const auto& [known, model] : kModels)
    if (known == name) return model;
  throw Error("internal", "unknown distortion model");
}

}  // namespace

void SceneBuilder::set_distortion(const DistortionInput& input) {
  auto made = std::make_unique<Distortion>();
  made->model = model_of(input.model);
  std::copy_n(input.coefficients.begin(), std::min(input.coefficients.size(), size_t(Distortion::kCoefficients)), made->k);
  made->most_angle = input.most_angle;
  const double* w = input.table_window;
  made->table = {input.table_columns,
                 input.table_rows,
                 w[0],
                 w[1],
                 w[2],
                 w[3],
                 std::vector<float>(input.directions.begin(), input.directions.end())};
  if (made->table.directions.size() != 3 * size_t(made->table.columns) * size_t(made->table.rows))
    throw Error("internal", "the table of directions has the wrong size");
  made->limit();
  Camera& camera = scene_->camera;
  scene_->distortion = std::move(made), camera.distortion = scene_->distortion.get();
  const ExactWindow& film = camera.window;
  camera.finest = float(camera.distortion->finest(film.left, film.right, film.bottom, film.top));
}

void SceneBuilder::set_flaws(const CameraInput& c) {
  Camera& camera = scene_->camera;
  const double unit = scene_->scale;
  LensFlaws& f = camera.flaws;
  f.natural = c.natural_vignetting;
  f.rim_distance = float(c.rim_distance * unit), f.rim_radius = float(c.rim_radius * unit);
  for (int i = 0; i < 3; ++i) {
    f.magnification[i] = float(c.magnification[i]), f.focus_shift[i] = float(c.focus_shift[i] * unit);
    f.is_chromatic |= c.magnification[i] != 1 || (c.focus_shift[i] != 0 && camera.has_lens());
  }
  camera.flawed = f.any() && !camera.orthographic;
}

}  // namespace primray
