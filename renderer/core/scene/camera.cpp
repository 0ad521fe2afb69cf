// Pose of a moving camera at a time: between two samples its rotation turns at constant speed, the rest is linear.
#include "scene/camera.hpp"

#include <algorithm>

namespace primray {

Camera Camera::unposed() const {
  Camera c;
  c.width = width, c.height = height, c.pixels = pixels, c.orthographic = orthographic;
  c.blades = blades, c.first_corner = first_corner;
  c.clipping_planes = clipping_planes;
  c.distortion = distortion, c.finest = finest;
  return c;
}

namespace {

Affine<float> axes_between(const CameraPose& a, const CameraPose& b, double t) {
  const daffine m = between(a.turning, b.turning, t);
  return {vec3(m.x), vec3(m.y), vec3(m.z), vec3(m.o)};
}

}  // namespace

Affine<float> Camera::pose_at(float time) const {
  if (!moves) return world_from_camera;
  const Moment now = path.clock.at(time);
  return axes_between(path.poses[size_t(now.segment)], path.poses[size_t(now.segment) + 1], now.within);
}

void Camera::set_pose(const CameraPath& along, float time) {
  const Moment now = along.clock.at(time);
  const CameraPose &a = along.poses[size_t(now.segment)], &b = along.poses[size_t(now.segment) + 1];
  const double t = now.within;
  world_from_camera = axes_between(a, b, t);
  const auto exactly = [&](double CameraPose::* f) { return a.*f + (b.*f - a.*f) * t; };
  const auto mix = [&](double CameraPose::* f) { return float(exactly(f)); };
  window = {exactly(&CameraPose::left), exactly(&CameraPose::right), exactly(&CameraPose::bottom), exactly(&CameraPose::top)};
  left = mix(&CameraPose::left), right = mix(&CameraPose::right), bottom = mix(&CameraPose::bottom),
  top = mix(&CameraPose::top);
  near = mix(&CameraPose::near), far = mix(&CameraPose::far), back = mix(&CameraPose::back);
  lens_radius = mix(&CameraPose::lens_radius), focus_distance = mix(&CameraPose::focus_distance);
}

void Camera::copy_pose(const Camera& still) {
  world_from_camera = still.world_from_camera, window = still.window;
  left = still.left, right = still.right, bottom = still.bottom, top = still.top;
  near = still.near, far = still.far, back = still.back;
  lens_radius = still.lens_radius, focus_distance = still.focus_distance;
}

CameraRay<1> Camera::ray_of_channel(const Drawn& drawn, const LensFlaws& lens, float channel, vec3& weight) {
  const int c = lens.is_chromatic ? std::clamp(int(channel * 3), 0, 2) : 0;
  const float focus = focus_distance;
  float fx = drawn.fx, fy = drawn.fy;
  if (lens.is_chromatic) {
    // Point of this channel's image that the other channels show nearer to the axis, or farther from it.
    const double axis_x = -window.left / (window.right - window.left) * width;
    const double axis_y = window.top / (window.top - window.bottom) * height;
    fx = float(axis_x + (fx - axis_x) / lens.magnification[c]), fy = float(axis_y + (fy - axis_y) / lens.magnification[c]);
    focus_distance = focus + lens.focus_shift[c];
  }
  const vfloat<1> lens0(drawn.lens0), lens1(drawn.lens1);
  const CameraRay<1> ray = ray_through<1>(vfloat<1>(fx), vfloat<1>(fy), lens0, lens1);
  focus_distance = focus;
  const Affine<float>& m = world_from_camera;
  const auto in_camera = [&](const vec3& v) { return vec3(dot(v, m.x), dot(v, m.y), dot(v, m.z)); };
  const vec3 o(ray.o.x[0], ray.o.y[0], ray.o.z[0]), d(ray.d.x[0], ray.d.y[0], ray.d.z[0]);
  const float passed = lens.passed(in_camera(o - m.o), in_camera(d));
  weight = vec3(passed);
  if (lens.is_chromatic) weight = {c == 0 ? 3 * passed : 0, c == 1 ? 3 * passed : 0, c == 2 ? 3 * passed : 0};
  return ray;
}

bool Camera::project(const dvec3& point, double (&pixel)[2]) const {
  const Affine<float>& m = world_from_camera;
  const dvec3 d = point - dvec3(m.o);
  dvec3 film{dot(d, dvec3(m.x)), dot(d, dvec3(m.y)), dot(d, dvec3(m.z))};
  const ExactWindow w = distortion ? window : ExactWindow{left, right, bottom, top};
  const double across = (w.right - w.left) / width, up = (w.top - w.bottom) / height;
  if (distortion) {
    const auto seen = distortion->film_point(film, {w.left + pixel[0] * across, w.top - pixel[1] * up, 0});
    if (!seen) return false;
    film = *seen;
  } else if (!orthographic) {
    if (!(film.z < 0)) return false;
    film = film * (1 / -film.z);
  }
  pixel[0] = (film.x - w.left) / across, pixel[1] = (w.top - film.y) / up;
  return true;
}

Camera Camera::at(float time) const {
  Camera c = unposed();
  c.filter = filter;
  c.set_pose(path, time);
  return c;
}

}  // namespace primray
