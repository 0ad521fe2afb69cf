// A dome: radiance from all directions, constant or from a lat-long image; sampled where its image exceeds its mean.
//
// Orientation: UsdLux DomeLight, pole +y, image centre +z, s = 0.5 - atan2(x, z) / 2 pi, t from the top = acos(y) / pi. Texels
// are read bilinearly. Sampling chooses a texel by a row and a column distribution, then uniformly in its solid angle. What is
// at or below the mean is left to the BSDF's own rays ("MIS compensation": Karlik et al. 2019, "MIS Compensation: Optimizing
// Sampling Techniques in Multiple Importance Sampling"); a constant dome so needs no light samples at all.
#pragma once

#include <vector>

#include "light/local_shape.hpp"
#include "math/matrix.hpp"

namespace primray {

struct Dome {
  Affine<float> world_from_light;  // rotation
  vec3 tint{1.0f, 1.0f, 1.0f};
  int width = 0, height = 0;  // 0: constant
  std::vector<float> texels;  // 3 (width) (height) floats
  // Sampling: cumulative probabilities of rows, and of columns in each row; probability density of each texel per steradian.
  std::vector<float> row_cdf, column_cdf, density;  // height + 1, height (width + 1), height width
  // Of each row, at its upper and lower edge, 1 - |cos| of the angle from the pole that it is nearer to (the upper one, if to
  // both): there cosines themselves have no digits for rows that are a thousandth of a radian high.
  std::vector<float> row_edges;  // 2 height
  int upper_rows() const { return (height + 1) / 2; }
  bool sampled = false;
  double irradiance = 0;  // upper estimate from what is sampled, for choosing among lights
};

// Fills the distributions from the texels.
void build_dome_distribution(Dome& dome);
// The same for a dome that nothing but light sampling finds: all of its light is sampled, also a constant one's.
void build_whole_dome_distribution(Dome& dome);

// The last i in [0, n) with cdf[base + i] <= u, for cdf ascending from 0.
template <int W>
PRIMRAY_INLINE vint<W> find_interval(const float* cdf, vint<W> base, int n, vfloat<W> u) {
  vint<W> lo(0);
  for (int step = 1 << (31 - __builtin_clz(unsigned(n))); step > 0; step >>= 1) {
    const vint<W> mid = lo + vint<W>(step);
    const vbool<W> inside = mid < vint<W>(n);
    const vfloat<W> c = gather<W>(cdf, base + select(inside, mid, vint<W>(0)));
    lo = select(inside & (c <= u), mid, lo);
  }
  return lo;
}

template <int W>
PRIMRAY_INLINE vvec3<W> dome_local(const Dome& dome, const vvec3<W>& w) {
  const Affine<float>& m = dome.world_from_light;
  return {w.x * m.x.x + w.y * m.x.y + w.z * m.x.z, w.x * m.y.x + w.y * m.y.y + w.z * m.y.z,
          w.x * m.z.x + w.y * m.z.y + w.z * m.z.z};
}

template <int W>
struct DomeCoordinates {
  vfloat<W> s, t;
  PRIMRAY_INLINE DomeCoordinates(const Dome& dome, const vvec3<W>& world) {
    const vvec3<W> w = dome_local(dome, world);
    s = clamp(0.5f - atan2(w.x, w.z) * (0.5f * kInvPi), 0.0f, 0x1.fffffep-1f);
    // By the tangent: close to a pole the cosine has no digits.
    t = clamp(atan2(sqrt(w.x * w.x + w.z * w.z), w.y) * kInvPi, 0.0f, 0x1.fffffep-1f);
  }
};

template <int W>
PRIMRAY_INLINE vvec3<W> dome_radiance(const Dome& dome, const DomeCoordinates<W>& c) {
  const vvec3<W> tint(vfloat<W>(dome.tint.x), vfloat<W>(dome.tint.y), vfloat<W>(dome.tint.z));
  const vfloat<W> x = c.s * float(dome.width) - 0.5f, y = c.t * float(dome.height) - 0.5f;
  const vint<W> xi = floor_to_int(x), yi = floor_to_int(y);
  const vfloat<W> fx = x - to_float(xi), fy = y - to_float(yi);
  const vint<W> width(dome.width), last(dome.height - 1);
  const vint<W> x0 = select(xi < vint<W>(0), xi + width, xi),
                x1 = select(xi + vint<W>(1) >= width, vint<W>(0), xi + vint<W>(1));
  const vint<W> y0 = max(yi, 0) * width, y1 = min(yi + vint<W>(1), last) * width;
  vvec3<W> L;
  const float* texels = dome.texels.data();
  const auto bilinear = [&](int channel) {
    const auto at = [&](vint<W> row, vint<W> column) { return gather<W>(texels + channel, (row + column) * vint<W>(3)); };
    const vfloat<W> top = at(y0, x0) * (1.0f - fx) + at(y0, x1) * fx, bottom = at(y1, x0) * (1.0f - fx) + at(y1, x1) * fx;
    return top * (1.0f - fy) + bottom * fy;
  };
  L.x = bilinear(0), L.y = bilinear(1), L.z = bilinear(2);
  return L * tint;
}

// Radiance from unit direction `w` and the density with which dome_sample chooses it.
template <int W>
PRIMRAY_INLINE vvec3<W> dome_eval(const Dome& dome, const vvec3<W>& w, vfloat<W>& pdf) {
  if (dome.width == 0) {
    pdf = vfloat<W>(0.0f);
    return {vfloat<W>(dome.tint.x), vfloat<W>(dome.tint.y), vfloat<W>(dome.tint.z)};
  }
  const DomeCoordinates<W> c(dome, w);
  pdf = vfloat<W>(0.0f);
  if (dome.sampled) {
    const vint<W> x = truncate(c.s * float(dome.width)), y = truncate(c.t * float(dome.height));
    pdf = gather<W>(dome.density.data(), min(y, dome.height - 1) * vint<W>(dome.width) + min(x, dome.width - 1));
  }
  return dome_radiance(dome, c);
}

// Direction in world space with its density; only for a dome that is sampled.
template <int W>
PRIMRAY_INLINE vvec3<W> dome_sample(const Dome& dome, vfloat<W> u, vfloat<W> v) {
  const float *rows = dome.row_cdf.data(), *columns = dome.column_cdf.data();
  const vint<W> y = find_interval<W>(rows, vint<W>(0), dome.height, u);
  const vfloat<W> r0 = gather<W>(rows, y), r1 = gather<W>(rows + 1, y);
  const vint<W> base = y * vint<W>(dome.width + 1);
  const vint<W> x = find_interval<W>(columns, base, dome.width, v);
  const vfloat<W> c0 = gather<W>(columns, base + x), c1 = gather<W>(columns + 1, base + x);
  const vfloat<W> fy = clamp((u - r0) / max(r1 - r0, 1e-30f), 0.0f, 1.0f),
                  fx = clamp((v - c0) / max(c1 - c0, 1e-30f), 0.0f, 1.0f);
  const vfloat<W> edge0 = gather<W>(dome.row_edges.data(), y * vint<W>(2)),
                  edge1 = gather<W>(dome.row_edges.data() + 1, y * vint<W>(2));
  const vfloat<W> from_pole = edge0 + fy * (edge1 - edge0);
  const vfloat<W> cos_theta = select(y < vint<W>(dome.upper_rows()), 1.0f - from_pole, from_pole - 1.0f);
  const vfloat<W> turn = 0.5f - (to_float(x) + fx) * (1.0f / float(dome.width));
  const vfloat<W> sin_theta = safe_sqrt(from_pole * (2.0f - from_pole));
  const SinCos<W> phi = sincos_turns(turn);
  const vvec3<W> w{sin_theta * phi.sin, cos_theta, sin_theta * phi.cos};
  const Affine<float>& m = dome.world_from_light;
  return {w.x * m.x.x + w.y * m.y.x + w.z * m.z.x, w.x * m.x.y + w.y * m.y.y + w.z * m.z.y,
          w.x * m.x.z + w.y * m.y.z + w.z * m.z.z};
}

}  // namespace primray
