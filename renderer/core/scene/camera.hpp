// The camera: from a point on the film, drawn from the pixel filter, and a point on the lens to a ray.
#pragma once

#include <cmath>
#include <vector>

#include "math/matrix.hpp"
#include "math/transcendental.hpp"

namespace primray {

// Importance sampling of a symmetric pixel filter: offset in pixels from u in [0,1). Every sample then has weight 1
// and adds to its own pixel alone (Ernst, Stamminger, Greiner 2006, "Filter Importance Sampling").
struct PixelFilter {
  static constexpr int kCells = 512;
  float box_width = 1;             // used when table is empty
  std::vector<float> inverse_cdf;  // kCells + 2 offsets at u = i / kCells

  template <int W>
  PRIMRAY_INLINE vfloat<W> sample(vfloat<W> u) const {
    if (inverse_cdf.empty()) return (u - 0.5f) * box_width;
    const vfloat<W> x = u * float(kCells);
    const vint<W> i = truncate(x);
    const vfloat<W> a = gather<W>(inverse_cdf.data(), i), b = gather<W>(inverse_cdf.data() + 1, i);
    return a + (b - a) * (x - to_float(i));
  }
};

template <int W>
struct CameraRay {
  vvec3<W> o, d;
  vfloat<W> tnear, tfar;
};

// Footprints of camera rays, in pixels across. Half a pixel, since a pixel's samples average over it anyway: textures stay as
// sharp as the pixel filter, and four neighbouring samples still cover them.
constexpr float kConePixels = 0.5f;

struct Camera {
  int width = 0, height = 0;
  bool orthographic = false;
  Affine<float> world_from_camera;                 // axes orthonormal, in the core's space
  float left = 0, bottom = 0, right = 0, top = 0;  // at unit distance, or in the core's lengths (orthographic)
  float near = 0, far = 0;
  float lens_radius = 0, focus_distance = 1;
  PixelFilter filter;

  // A ray's cone: its width at the camera, and how much wider it gets per distance (Akenine-Moller et al. 2021, "Improved
  // Shader and Texture Level of Detail Using Ray Cones").
  float cone_width() const { return orthographic ? kConePixels * pixel_size() : 0.0f; }
  float cone_spread() const { return orthographic ? 0.0f : kConePixels * pixel_size(); }
  float pixel_size() const { return std::sqrt((right - left) / float(width) * ((top - bottom) / float(height))); }

  // Ray through pixel (x, y), counted from the upper left; u_film, u_lens in [0,1)^2. Directions have unit length.
  template <int W>
  PRIMRAY_INLINE CameraRay<W> ray(vint<W> x, vint<W> y, vfloat<W> u0, vfloat<W> u1, vfloat<W> lens0, vfloat<W> lens1) const {
    const vfloat<W> fx = to_float(x) + 0.5f + filter.sample<W>(u0), fy = to_float(y) + 0.5f + filter.sample<W>(u1);
    const vfloat<W> sx = left + fx * ((right - left) / float(width)), sy = top - fy * ((top - bottom) / float(height));
    vvec3<W> o(vfloat<W>(0.0f)), d(sx, sy, vfloat<W>(-1.0f));
    if (orthographic) o = {sx, sy, vfloat<W>(0.0f)}, d = {vfloat<W>(0.0f), vfloat<W>(0.0f), vfloat<W>(-1.0f)};
    if (lens_radius > 0) {
      // All rays of one film point meet on the plane of focus.
      const vfloat<W> r = sqrt(lens0) * lens_radius;
      const SinCos<W> phi = sincos_turns(lens1);
      const vvec3<W> lens(r * phi.cos, r * phi.sin, vfloat<W>(0.0f));
      d = d - lens * (1.0f / focus_distance);
      o += lens;
    }
    const vfloat<W> len = length(d);
    const auto rotate = [&](const vvec3<W>& v) {
      const Affine<float>& m = world_from_camera;
      return vvec3<W>(v.x * m.x.x + v.y * m.y.x + v.z * m.z.x, v.x * m.x.y + v.y * m.y.y + v.z * m.z.y,
                      v.x * m.x.z + v.y * m.y.z + v.z * m.z.z);
    };
    const vec3 c = world_from_camera.o;
    return {rotate(o) + vvec3<W>(vfloat<W>(c.x), vfloat<W>(c.y), vfloat<W>(c.z)), rotate(d) * (1.0f / len), len * near,
            len * far};
  }
};

}  // namespace primray
