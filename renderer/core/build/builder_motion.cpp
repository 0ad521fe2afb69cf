// Part of SceneBuilder that adds motion: steps of meshes, matrices of instances, the camera's path.
#include <algorithm>

#include "base/error.hpp"
#include "build/builder.hpp"
#include "motion/clock.hpp"

namespace primray {
namespace {

constexpr size_t kMostNumbers = size_t(1) << 31;

}  // namespace

void SceneBuilder::set_exposure(double opens, double closes, double frame) {
  MotionTable& motion = scene_->motion;
  motion.opens = float(opens), motion.length = float(closes - opens), motion.frame = float(frame);
}

void SceneBuilder::set_rolling_shutter(double per_column, double per_row) {
  MotionTable& motion = scene_->motion;
  motion.per_column = float(per_column), motion.per_row = float(per_row);
  motion.rolls = per_column != 0 || per_row != 0;
}

void SceneBuilder::take_clock(std::span<const float> times) {
  Scene& s = *scene_;
  Group& group = s.groups.back();
  const MotionClock clock = clock_of_times(times);
  const int32_t number = s.motion.clock_of(clock);
  if (group.clock >= 0 && group.clock != number)
    throw Error("internal", "shapes of one group have different motion sample times");
  if (s.groups.size() == 1 && !clock.uniform)
    throw Error("internal", "shapes of the world group need evenly spaced motion samples");
  group.clock = number, s.motion.any_points = true;
}

void SceneBuilder::add_mesh_steps(const MeshInput& mesh, const daffine& group_from_object) {
  Scene& s = *scene_;
  Group& group = s.groups.back();
  take_clock(mesh.times);
  const size_t points = mesh.points.size();
  group.moving_vertex_count += uint32_t(points / 3);
  later_points_.resize(mesh.times.size() - 1);
  for (size_t k = 0; k < later_points_.size(); ++k) {
    const float* from = &mesh.step_points[(k + 1) * points];
    for (size_t i = 0; i < points; i += 3) {
      const dvec3 p = to_group(group_from_object.point({from[i], from[i + 1], from[i + 2]}));
      later_points_[k].insert(later_points_[k].end(), {float(p.x), float(p.y), float(p.z)});
    }
  }
}

void SceneBuilder::end_group() {
  std::vector<float>& to = scene_->positions;
  for (std::vector<float>& step : later_points_) {
    if (to.size() + step.size() >= kMostNumbers) throw Error("too-large", "more than 715 million points of moving meshes");
    to.insert(to.end(), step.begin(), step.end());
    std::vector<float>().swap(step);
  }
  later_points_.clear();
  std::vector<float>& controls = scene_->curves.points;
  for (std::vector<float>& step : later_controls_) {
    if (controls.size() + step.size() >= kMostNumbers) throw Error("too-large", "more than 536 million control points");
    controls.insert(controls.end(), step.begin(), step.end());
    std::vector<float>().swap(step);
  }
  later_controls_.clear();
}

std::vector<int64_t> SceneBuilder::add_moving_instances(std::span<const float> times, bool turns,
                                                        std::span<const double> rows) {
  Scene& s = *scene_;
  MotionTable& table = s.motion;
  const size_t steps = times.size(), count = rows.size() / (12 * steps);
  MovingInstances m{
      int32_t(s.world_from_group.size() / 12), 0, 0, turns, turns ? table.turning.size() : table.linear.size() / 12, undo_};
  m.clock = table.clock_of(clock_of_times(times));
  std::vector<int64_t> left_out;
  std::vector<daffine> path(steps);
  std::vector<PoseSegment> turning(steps);
  for (size_t i = 0; i < count; ++i) {
    bool finite = true, regular = false;
    for (size_t k = 0; k < steps; ++k) {
      const daffine given = affine_from_rows(&rows[12 * (k * count + i)]);
      finite &= is_finite(given), regular |= is_regular(given);
      path[k] = redo_ * (turns ? given : given * undo_);
    }
    if (!finite || !regular) {
      left_out.push_back(int64_t(i));
      continue;
    }
    if (turns) {
      make_pose_segments(path.data(), steps, turning.data());
      table.turning.insert(table.turning.end(), turning.begin(), turning.end());
    } else {
      for (const daffine& at : path) {
        float row[12];
        put_columns(at, row);
        table.linear.insert(table.linear.end(), row, row + 12);
      }
    }
    ++m.count;
    float middle[12];
    put_columns(table.at(m, uint32_t(m.count - 1), 0.5f), middle);
    s.world_from_group.insert(s.world_from_group.end(), middle, middle + 12);
  }
  if (m.count == 0) return left_out;
  table.instances.push_back(m), table.any_instances = true;
  return left_out;
}

void SceneBuilder::set_camera_path(const CameraInput& c) {
  const Scene& s = *scene_;
  Camera& camera = scene_->camera;
  const size_t steps = c.times.size();
  camera.path.clock = clock_of_times(c.times), camera.moves = true;
  std::vector<daffine> matrices(steps);
  std::vector<PoseSegment> turning(steps);
  for (size_t k = 0; k < steps; ++k) {
    matrices[k] = affine_from_rows(&c.pose_matrices[12 * k]);
    matrices[k].o = (matrices[k].o - s.origin) * s.scale;
  }
  make_pose_segments(matrices.data(), steps, turning.data());
  const double unit = c.orthographic ? s.scale : 1.0;
  for (size_t k = 0; k < steps; ++k) {
    const double* n = &c.pose_numbers[8 * k];
    const double back = std::max(0.0, -n[4]);
    camera.path.poses.push_back({turning[k], n[0] * unit, n[2] * unit, n[1] * unit, n[3] * unit, (n[4] + back) * s.scale,
                                 (n[5] + back) * s.scale, back * s.scale, n[6] * s.scale, n[7] * s.scale});
    camera.lens_opens |= n[6] > 0;
  }
}

}  // namespace primray
