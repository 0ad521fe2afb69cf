// How a camera that moves stands at a time: between two poses its rotation turns at constant speed, the rest is linear.
#include "scene/camera.hpp"

namespace primray {

Camera Camera::stance() const {
  Camera c;
  c.width = width, c.height = height, c.pixels = pixels, c.orthographic = orthographic;
  c.blades = blades, c.first_corner = first_corner;
  c.clipping_planes = clipping_planes;
  return c;
}

void Camera::stand(const CameraPath& along, float time) {
  const Moment now = along.clock.at(time);
  const CameraPose &a = along.poses[size_t(now.segment)], &b = along.poses[size_t(now.segment) + 1];
  const double t = now.within;
  const daffine m = between(a.turning, b.turning, t);
  world_from_camera = {vec3(m.x), vec3(m.y), vec3(m.z), vec3(m.o)};
  const auto mix = [&](double CameraPose::* f) { return float(a.*f + (b.*f - a.*f) * t); };
  left = mix(&CameraPose::left), right = mix(&CameraPose::right), bottom = mix(&CameraPose::bottom),
  top = mix(&CameraPose::top);
  near = mix(&CameraPose::near), far = mix(&CameraPose::far), back = mix(&CameraPose::back);
  lens_radius = mix(&CameraPose::lens_radius), focus_distance = mix(&CameraPose::focus_distance);
}

Camera Camera::at(float time) const {
  Camera c = stance();
  c.filter = filter;
  c.stand(path, time);
  return c;
}

}  // namespace primray
