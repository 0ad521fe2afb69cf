// Camera: maps a point on the film, drawn from the pixel filter, and a point on the lens to a ray.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/features.hpp"
#include "math/matrix.hpp"
#include "math/transcendental.hpp"
#include "math/vec3.hpp"
#include "motion/clock.hpp"
#include "motion/pose_segment.hpp"
#include "sampler/sampler.hpp"
#include "scene/distortion.hpp"

namespace primray {

// Flaws of real lenses beside distortion: vignetting and chromatic aberration.
struct LensFlaws {
  bool natural = false;                    // natural vignetting: light falls off with cos^4 of a ray's angle to the axis
  float rim_distance = 0, rim_radius = 0;  // mechanical vignetting: a second aperture at that distance before the lens, about
                                           // the axis; radius 0: none
  float magnification[3] = {1, 1, 1};      // scale of a channel's image about the axis
  float focus_shift[3] = {0, 0, 0};        // shift of a channel's plane of focus, away from the camera
  bool is_chromatic = false;               // the last two differ from their defaults

  bool any() const { return natural || rim_radius > 0 || is_chromatic; }

  // Share of the light of a ray from `o` on the lens along unit `d` that passes; the camera looks along -z.
  float passed(const vec3& o, const vec3& d) const {
    if (rim_radius > 0) {
      if (!(d.z < 0)) return 0;
      const float t = rim_distance / -d.z, x = o.x + t * d.x, y = o.y + t * d.y;
      if (!(x * x + y * y <= rim_radius * rim_radius)) return 0;
    }
    if (!natural) return 1;
    const float c = std::max(-d.z, 0.0f);
    return c * c * c * c;
  }
};

// Importance sampling of a symmetric pixel filter: offset in pixels from u in [0,1). Every sample then has weight 1 and is
// added to its own pixel only (Ernst, Stamminger, Greiner 2006, "Filter Importance Sampling").
struct PixelFilter {
  static constexpr int kCells = 512;
  float box_width = 1;             // used if the table is empty
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

  // False outside the field of view of a distorting lens.
  vbool<W> exists() const { return tfar >= vfloat<W>(0.0f); }
};

// Width of camera ray cones in pixels. Half a pixel, since a pixel's samples average over it anyway: textures stay as sharp as
// the pixel filter, and four neighbouring samples still cover them.
constexpr float kConePixels = 0.5f;

// Pixels from (x, y) on, counted from the upper left of the frame; some may be outside of the frame.
struct PixelWindow {
  int x = 0, y = 0, width = 0, height = 0;
};

// Cuts off the half-space a x + b y + c z + d < 0 in camera space (UsdGeomCamera, clippingPlanes).
struct ClippingPlane {
  float a, b, c, d;
};

// A camera at one of its motion samples: the parts that may move, in double, in the core's lengths.
struct CameraPose {
  PoseSegment turning;
  double left, bottom, right, top, near, far, back, lens_radius, focus_distance;
};

// Sides of the window in double, where floats do not suffice.
struct ExactWindow {
  double left, right, bottom, top;
};

struct CameraPath {
  MotionClock clock;
  std::vector<CameraPose> poses;
};

struct Camera {
  int width = 0, height = 0;  // of the frame, which the screen window covers
  PixelWindow pixels;         // pixels that are rendered: the film's
  bool orthographic = false;
  Affine<float> world_from_camera;                 // orthonormal axes, in the core's space
  float left = 0, bottom = 0, right = 0, top = 0;  // at unit distance, or in the core's lengths (orthographic)
  float near = 0, far = 0;                         // along the view direction, where rays begin and end
  float back = 0;                                  // distance behind the camera from which an orthographic one sees
  float lens_radius = 0, focus_distance = 1;
  int blades = 0;                      // number of sides of a regular polygonal aperture, its corners on the circle; 0: a disc
  float first_corner = 0;              // direction of one corner, in turns from +x towards +y
  Fact<built::kMotion> moves = false;  // moves by `path`; the fields above then hold at the frame time
  CameraPath path;
  const Distortion* distortion = nullptr;  // owned by the scene; its film is the window
  ExactWindow window{-1, 1, -1, 1};
  float finest = 1;  // pixel size at the distortion's finest place, relative to the middle
  LensFlaws flaws;
  bool flawed = false;      // it has lens flaws
  bool lens_opens = false;  // anywhere on the shutter interval
  std::vector<ClippingPlane> clipping_planes;
  PixelFilter filter;

  // Ray cone: its width at the camera, and its growth per unit of distance (Akenine-Moller et al. 2021, "Improved Shader and
  // Texture Level of Detail Using Ray Cones").
  float cone_width() const { return orthographic ? kConePixels * pixel_size() : 0.0f; }
  float cone_spread() const { return orthographic ? 0.0f : kConePixels * finest * pixel_size(); }
  float pixel_size() const { return std::sqrt((right - left) / float(width) * ((top - bottom) / float(height))); }

  // Projects a point in the core's space through the centre of the lens to pixels of the frame, right and down; false if it is
  // not visible. `pixel`: on entry, an initial guess.
  bool project(const dvec3& point, double (&pixel)[2]) const;

  bool has_lens() const { return lens_radius > 0 || lens_opens; }
  // The camera as it is at a time.
  Camera at(float time) const;
  // Its axes at a time.
  Affine<float> pose_at(float time) const;

  // Ray through pixel (x, y), counted from the upper left; u_film, u_lens in [0,1)^2. Directions have unit length. `time`: for
  // cameras that move. Rays through a distorting lens may not exist.
  template <int W>
  PRIMRAY_INLINE CameraRay<W> ray(vint<W> x, vint<W> y, vfloat<W> u0, vfloat<W> u1, vfloat<W> lens0, vfloat<W> lens1,
                                  vfloat<W> time) const {
    const vfloat<W> fx = to_float(x) + 0.5f + filter.sample<W>(u0), fy = to_float(y) + 0.5f + filter.sample<W>(u1);
    if (moves) return moving_ray(fx, fy, lens0, lens1, time);
    return ray_through(fx, fy, lens0, lens1);
  }

  // Ray with the lens's flaws: `channel` in [0,1) selects the colour channel that the ray carries, `weight` is the factor of
  // its light. One lane at a time.
  template <int W>
  PRIMRAY_RARE CameraRay<W> flawed_ray(vint<W> x, vint<W> y, Pair<W> film, Pair<W> lens, vfloat<W> time, vfloat<W> channel,
                                       vvec3<W>& weight) const {
    const vfloat<W> fx = to_float(x) + 0.5f + filter.sample<W>(film.u), fy = to_float(y) + 0.5f + filter.sample<W>(film.v);
    alignas(64) float rows[11][W];
    Camera now = unposed();
    if (!moves) now.copy_pose(*this);
    for (int i = 0; i < W; ++i) {
      if (moves) now.set_pose(path, time[i]);
      vec3 share;
      const CameraRay<1> r = now.ray_of_channel({fx[i], fy[i], lens.u[i], lens.v[i]}, flaws, channel[i], share);
      const float own[11] = {r.o.x[0],   r.o.y[0],  r.o.z[0], r.d.x[0], r.d.y[0], r.d.z[0],
                             r.tnear[0], r.tfar[0], share.x,  share.y,  share.z};
      for (int c = 0; c < 11; ++c) rows[c][i] = own[c];
    }
    const auto lanes = [&](int c) { return load<W>(rows[c]); };
    weight = {lanes(8), lanes(9), lanes(10)};
    return {{lanes(0), lanes(1), lanes(2)}, {lanes(3), lanes(4), lanes(5)}, lanes(6), lanes(7)};
  }

 private:
  // A point of the film, in pixels, and one of the lens.
  struct Drawn {
    float fx, fy, lens0, lens1;
  };
  CameraRay<1> ray_of_channel(const Drawn& drawn, const LensFlaws& lens, float channel, vec3& weight);

  // Ray through a point of the film, in pixels from the upper left.
  template <int W>
  PRIMRAY_INLINE CameraRay<W> ray_through(vfloat<W> fx, vfloat<W> fy, vfloat<W> lens0, vfloat<W> lens1) const {
    if (distortion) return distorted_ray(fx, fy, lens0, lens1);
    const vfloat<W> sx = left + fx * ((right - left) / float(width)), sy = top - fy * ((top - bottom) / float(height));
    vvec3<W> o(vfloat<W>(0.0f)), d(sx, sy, vfloat<W>(-1.0f));
    if (orthographic) o = {sx, sy, vfloat<W>(back)}, d = {vfloat<W>(0.0f), vfloat<W>(0.0f), vfloat<W>(-1.0f)};
    return ray_along(o, d, lens0, lens1);
  }

  // Depths are in lengths of `d`.
  template <int W>
  PRIMRAY_INLINE CameraRay<W> ray_along(vvec3<W> o, vvec3<W> d, vfloat<W> lens0, vfloat<W> lens1) const {
    if (lens_radius > 0) {
      // All rays of one film point meet on the plane (or the sphere) of focus.
      const vvec3<W> lens = lens_point(lens0, lens1);
      d = d - lens * (1.0f / focus_distance);
      o += lens;
    }
    vfloat<W> from(near), to(far);  // depths
    if (!clipping_planes.empty()) clip(o, d, from, to);
    const vfloat<W> len = length(d);
    const auto rotate = [&](const vvec3<W>& v) {
      const Affine<float>& m = world_from_camera;
      return vvec3<W>(v.x * m.x.x + v.y * m.y.x + v.z * m.z.x, v.x * m.x.y + v.y * m.y.y + v.z * m.z.y,
                      v.x * m.x.z + v.y * m.y.z + v.z * m.z.z);
    };
    const vec3 c = world_from_camera.o;
    return {rotate(o) + vvec3<W>(vfloat<W>(c.x), vfloat<W>(c.y), vfloat<W>(c.z)), rotate(d) * (1.0f / len), len * from,
            len * to};
  }

  // Computes directions one lane at a time.
  template <int W>
  PRIMRAY_RARE CameraRay<W> distorted_ray(vfloat<W> fx, vfloat<W> fy, vfloat<W> lens0, vfloat<W> lens1) const {
    alignas(64) float rows[4][W], eyes[3][W] = {};
    for (int i = 0; i < W; ++i) {
      const dvec3 film = film_point(fx[i], fy[i]);
      const std::optional<dvec3> d = distortion->direction(film.x, film.y);
      const dvec3 ahead = d.value_or(dvec3{0, 0, -1});
      rows[0][i] = float(ahead.x), rows[1][i] = float(ahead.y), rows[2][i] = float(ahead.z), rows[3][i] = d ? 1.0f : 0.0f;
      if (!distortion->has_eyes()) continue;
      const dvec3 eye = distortion->eye(film.x, film.y);
      eyes[0][i] = float(eye.x), eyes[1][i] = float(eye.y), eyes[2][i] = float(eye.z);
    }
    const vvec3<W> o(load<W>(eyes[0]), load<W>(eyes[1]), load<W>(eyes[2])),
        d(load<W>(rows[0]), load<W>(rows[1]), load<W>(rows[2]));
    CameraRay<W> ray = ray_along(o, d, lens0, lens1);
    const vbool<W> exists = load<W>(rows[3]) > vfloat<W>(0.0f);
    ray.tnear = select(exists, ray.tnear, vfloat<W>(0.0f)), ray.tfar = select(exists, ray.tfar, vfloat<W>(-1.0f));
    return ray;
  }
  // Film point (x, y, 0) of a distorting lens, of a point in pixels.
  dvec3 film_point(double fx, double fy) const {
    const ExactWindow& w = window;
    return {w.left + fx * ((w.right - w.left) / width), w.top - fy * ((w.top - w.bottom) / height), 0};
  }

  // One lane at a time, each with its own camera.
  template <int W>
  PRIMRAY_RARE CameraRay<W> moving_ray(vfloat<W> fx, vfloat<W> fy, vfloat<W> lens0, vfloat<W> lens1, vfloat<W> time) const {
    alignas(64) float rows[8][W];
    Camera now = unposed();
    for (int i = 0; i < W; ++i) {
      now.set_pose(path, time[i]);
      const vfloat<1> f0(fx[i]), f1(fy[i]), l0(lens0[i]), l1(lens1[i]);
      const CameraRay<1> r = now.ray_through<1>(f0, f1, l0, l1);
      const float own[8] = {r.o.x[0], r.o.y[0], r.o.z[0], r.d.x[0], r.d.y[0], r.d.z[0], r.tnear[0], r.tfar[0]};
      for (int c = 0; c < 8; ++c) rows[c][i] = own[c];
    }
    const auto lanes = [&](int c) { return load<W>(rows[c]); };
    return {{lanes(0), lanes(1), lanes(2)}, {lanes(3), lanes(4), lanes(5)}, lanes(6), lanes(7)};
  }
  // The camera without its path and filter, posed per ray.
  Camera unposed() const;
  void set_pose(const CameraPath& along, float time);
  void copy_pose(const Camera& still);

  // Uniform on the lens.
  template <int W>
  PRIMRAY_INLINE vvec3<W> lens_point(vfloat<W> u0, vfloat<W> u1) const {
    const vfloat<W> r = sqrt(u0) * lens_radius;
    if (blades == 0) {
      const SinCos<W> phi = sincos_turns(u1);
      return {r * phi.cos, r * phi.sin, vfloat<W>(0.0f)};
    }
    // Choose one of the triangles between the centre and two corners, and a point in it: r is its share of the way from the
    // centre.
    const vfloat<W> n(static_cast<float>(blades)), side = u1 * n;
    const vint<W> k = min(truncate(side), vint<W>(blades - 1));
    const vfloat<W> along = side - to_float(k);
    const auto corner = [&](vint<W> i) { return sincos_turns(to_float(i) / n + first_corner); };
    const SinCos<W> a = corner(k), b = corner(k + vint<W>(1));
    return {r * (a.cos + (b.cos - a.cos) * along), r * (a.sin + (b.sin - a.sin) * along), vfloat<W>(0.0f)};
  }

  // Clips the depths [from, to] of the ray o + depth d to all clipping planes, which may leave nothing.
  template <int W>
  PRIMRAY_INLINE void clip(const vvec3<W>& o, const vvec3<W>& d, vfloat<W>& from, vfloat<W>& to) const {
    const vfloat<W> zero(0.0f);
    for (const ClippingPlane& p : clipping_planes) {
      const vfloat<W> at = o.x * p.a + o.y * p.b + o.z * p.c + p.d, slope = d.x * p.a + d.y * p.b + d.z * p.c;
      const vfloat<W> depth = -at / slope;
      from = select((slope > zero) & (depth > from), depth, from);
      to = select((slope < zero) & (depth < to), depth, to);
      to = select((slope == zero) & (at < zero), from, to);
    }
    // Equal ends hit nothing.
    from = min(from, vfloat<W>(far)), to = max(from, to);
  }
};

}  // namespace primray
