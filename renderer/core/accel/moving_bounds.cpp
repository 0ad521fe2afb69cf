// Computation of moving_bounds.hpp.
#include "accel/moving_bounds.hpp"

#include <algorithm>
#include <cmath>

namespace primray {
namespace {

// More segments give tighter boxes, and hierarchies that need more memory.
constexpr int kMostSegments = 32;
constexpr int kMostSteps = 128;          // limit of Embree
constexpr double kTurnPerSegment = 0.4;  // radians

dvec3 corner_of(const rtc::Bounds& b, int k) {
  return {k & 1 ? b.upper_x : b.lower_x, k & 2 ? b.upper_y : b.lower_y, k & 4 ? b.upper_z : b.lower_z};
}

// Upper bound of the distance of a rotating path, on segment `k` of its motion samples, from its chord over a time `h`: |p''|
// h^2 / 8.
double off_chord(const MotionTable& table, const MovingInstances& moving, size_t first, int k, double h, const rtc::Bounds& b) {
  const std::vector<float>& times = table.clocks[size_t(moving.clock)].times;
  const Turning &from = table.turning[first + size_t(k)], &to = table.turning[first + size_t(k) + 1];
  const double dt = double(times[size_t(k) + 1]) - double(times[size_t(k)]), speed = 2 * from.half_angle / dt;
  double reach = 0, stretching = 0;
  for (int c = 0; c < 8; ++c) {
    const dvec3 p = moving.undo_center.point(corner_of(b, c));
    const auto stretched = [&](const Turning& t) { return t.stretch[0] * p.x + t.stretch[1] * p.y + t.stretch[2] * p.z; };
    const dvec3 a = stretched(from), z = stretched(to);
    reach = std::max({reach, length(a), length(z)}), stretching = std::max(stretching, length(z - a) / dt);
  }
  return (speed * speed * reach + 2 * speed * stretching) * h * h / 8;
}

// Upper bound of the distance of the images of the box's corners from the chord between `begin` and `end`.
double deviation(const MotionTable& table, const MovingInstances& moving, uint32_t instance, double begin, double end,
                 const rtc::Bounds& b) {
  const std::vector<float>& times = table.clocks[size_t(moving.clock)].times;
  const size_t first = moving.base + size_t(instance) * times.size();
  const daffine from = table.at(moving, instance, float(begin)), to = table.at(moving, instance, float(end));
  double kinks = 0, curves = 0;
  for (size_t k = 0; k + 1 < times.size(); ++k) {
    const double low = std::max(begin, double(times[k])), high = std::min(end, double(times[k + 1]));
    if (low >= high) continue;
    if (moving.turns) curves = std::max(curves, off_chord(table, moving, first, int(k), high - low, b));
    if (high >= end) continue;
    const daffine at = table.at(moving, instance, times[k + 1]);
    const double t = (high - begin) / (end - begin);
    for (int c = 0; c < 8; ++c) {
      const dvec3 p = corner_of(b, c);
      kinks = std::max(kinks, length(at.point(p) - (from.point(p) * (1 - t) + to.point(p) * t)));
    }
  }
  return kinks + curves;
}

}  // namespace

rtc::Bounds bounds_around(const daffine& m, const rtc::Bounds& b, double more) {
  const dvec3 lower{b.lower_x, b.lower_y, b.lower_z}, upper{b.upper_x, b.upper_y, b.upper_z};
  const dvec3 center = m.point((lower + upper) * 0.5), half = (upper - lower) * 0.5;
  const double c[] = {center.x, center.y, center.z},
               rows[3][3] = {{m.x.x, m.y.x, m.z.x}, {m.x.y, m.y.y, m.z.y}, {m.x.z, m.y.z, m.z.z}};
  float lo[3], hi[3];
  for (int k = 0; k < 3; ++k) {
    // Arvo 1990, "Transforming Axis-Aligned Bounding Boxes".
    const double r = std::fabs(rows[k][0]) * half.x + std::fabs(rows[k][1]) * half.y + std::fabs(rows[k][2]) * half.z + more;
    const double slack = 1e-6 * (r + std::fabs(c[k]));
    lo[k] = float(c[k] - r - slack), hi[k] = float(c[k] + r + slack);
  }
  return {lo[0], lo[1], lo[2], 0, hi[0], hi[1], hi[2], 0};
}

int bound_segments(const MotionTable& table, const MovingInstances& moving) {
  const MotionClock& clock = table.clocks[size_t(moving.clock)];
  if (!moving.turns)
    return clock.uniform ? std::min(clock.segments(), kMostSteps) : std::min(2 * clock.segments(), kMostSegments);
  double most = 0;
  for (size_t i = 0; i < size_t(moving.count); ++i) {
    double whole = 0;
    for (size_t k = 0; k + 1 < clock.times.size(); ++k)
      whole += 2 * table.turning[moving.base + i * clock.times.size() + k].half_angle;
    most = std::max(most, whole);
  }
  const int wanted = int(std::ceil(std::min(most / kTurnPerSegment, double(kMostSegments))));
  return std::max(std::min(clock.segments(), kMostSegments), wanted);
}

rtc::Bounds moving_bounds(const MotionTable& table, const MovingInstances& moving, int segments, uint32_t instance,
                          uint32_t step, const rtc::Bounds& b) {
  const double now = double(step) / segments, before = std::max(0.0, double(step) - 1) / segments,
               after = std::min(1.0, (double(step) + 1) / segments);
  double more = 0;
  if (before < now) more = std::max(more, deviation(table, moving, instance, before, now, b));
  if (after > now) more = std::max(more, deviation(table, moving, instance, now, after, b));
  return bounds_around(table.at(moving, instance, float(now)), b, more);
}

}  // namespace primray
