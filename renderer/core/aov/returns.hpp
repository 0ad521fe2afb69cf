// Returns of given rays, as a lidar gets them: every surface that a beam reaches and what that sends back along the beam.
// Independent of the camera, of lights and of the path loop; without random numbers.
//
// A return's strength is pi f(wo, wo) cos(theta), with f the surface's BSDF, weighted by `weights` of R, G and B, times the
// square of what the beam has left when it gets there: a white Lambertian surface that faces the ray has 1. Reflecting lobes
// are at least as wide as `least_alpha`, since a beam has a width and a receiver an aperture.
//
// A beam goes on where a surface is present only in part, and through smooth transmission, where it is refracted by Snell's
// law. Distances are optical: what is travelled inside a medium counts by its index of refraction, as it does in a time of
// flight. Beams pass the boundaries of volumes and what is hidden from the camera; mirrors send nothing on.
#pragma once

#include <cstdint>
#include <vector>

#include "math/vec3.hpp"
#include "scene/scene.hpp"

namespace primray {

struct Return {
  int32_t shape, instance, outer, surface;  // as in FirstHitPlanes
  double distance;                          // optical, from the ray's origin; scene units
  float strength, cosine;                   // cosine: of the angle between the ray and the surface's normal
};

struct ReturnRays {
  std::vector<dvec3> origin, direction;  // world space, scene units; directions of unit length
  std::vector<float> time;               // within the scene's span, [0, 1]
  double near = 0, far = 0;              // scene units: rays begin and end there
  vec3 weights{0.0f};
  float least_alpha = 0, least_strength = 0;  // weaker returns are left out
  static constexpr size_t kTask = 4096;       // rays
  // Results: number of returns by ray, and the returns of rays in order, one task after the other.
  std::vector<uint32_t> count;
  std::vector<std::vector<Return>> by_task;
};

// Finds the returns of all rays on threads, W = `lanes` rays at a time; no bit depends on either.
void find_returns(const Scene& scene, int lanes, int threads, ReturnRays& rays);

}  // namespace primray
