// Emissive geometry in moving instances, evaluated at a time. Its light rows (kPassing) have the bounding spheres of its path,
// since lights are chosen without a time.
#pragma once

#include "light/light.hpp"
#include "scene/scene.hpp"

namespace primray {

// World from the frame of `light`, which moves, at a time.
inline daffine emitter_stance(const Scene& scene, int light, float time) {
  const EmitterTable& table = scene.emitters;
  const int32_t instance = table.moving_instance[size_t(light)];
  const MovingInstances& in = *scene.motion.find(instance);
  return scene.motion.at(in, uint32_t(instance - in.first), time) * table.frames[size_t(scene.lights.row(light)[kSize1])];
}

}  // namespace primray
