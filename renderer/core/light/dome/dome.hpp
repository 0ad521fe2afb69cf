// Dome light: radiance from all directions, constant or from an image, importance sampled where the image exceeds its mean.
//
// Orientation: UsdLux DomeLight, pole +y, image centre +z, s = 0.5 - atan2(x, z) / 2 pi, t from the top = acos(y) / pi; other
// formats are in dome_format.hpp. Texels are interpolated bilinearly. Sampling chooses a cell of a lat-long grid, which is the
// image's own grid if that is lat-long, by a row and a column distribution, then a point uniformly in its solid angle. Part of
// the radiance is left to BSDF-sampled rays everywhere (dome_compensation.cpp); a constant dome needs no light samples at all.
#pragma once

#include <span>
#include <vector>

#include "light/dome/cdf.hpp"
#include "light/dome/dome_format.hpp"
#include "light/shape/bilinear.hpp"
#include "light/shape/local_shape.hpp"
#include "math/matrix.hpp"

namespace primray {

// MIS compensation of domes: how much of a dome's radiance is left to BSDF-sampled rays.

// Returns the radiance that is left to BSDF-sampled rays everywhere; light samples go where there is more ("MIS compensation":
// Karlik et al. 2019). Infinity: under a smooth sky light samples are not worth their cost. `luminance`: of rows x columns
// cells in lat-long order, the first row at a pole, with its mean; `solid_angle`: of each row's cells.
double dome_compensation(std::span<const double> luminance, std::span<const double> solid_angle, int columns, double mean);

struct Dome {
  Affine<float> world_from_light;  // a rotation
  vec3 tint{1.0f, 1.0f, 1.0f};
  DomeFormat format = DomeFormat::kLatLong;
  int width = 0, height = 0;  // 0: constant
  std::vector<float> texels;  // 3 (width) (height) floats
  // Sampling: cumulative probabilities of rows, and of columns in each row; probability density of each cell per steradian.
  int columns = 0, rows = 0;                        // of the grid of cells
  std::vector<float> row_cdf, column_cdf, density;  // rows + 1, rows (columns + 1), rows columns
  std::vector<int32_t> row_cuts, column_cuts;       // guide tables of those; column tables row by row
  // 1 - |cos| of the angle from the nearer pole (the upper one for a row that touches both) at the upper and lower edge of each
  // row: cosines themselves have no precision for rows that are a thousandth of a radian high.
  std::vector<float> row_edges;  // 2 rows
  int upper_rows() const { return (rows + 1) / 2; }
  bool sampled = false;
  double mean = 0;        // luminance over all directions
  double irradiance = 0;  // upper estimate for the sampled part, used in choosing among lights
};

// Prepares the texels of formats other than lat-long, and the size of the grid. Must be called first.
void finish_dome_image(Dome& dome);
// Builds the sampling distributions from the texels.
void build_dome_distribution(Dome& dome);
// Builds them for a dome that only light sampling finds: all of its light is sampled, even if it is constant.
void build_whole_dome_distribution(Dome& dome);

template <int W>
PRIMRAY_INLINE vvec3<W> dome_local(const Dome& dome, const vvec3<W>& w) {
  const Affine<float>& m = dome.world_from_light;
  return {w.x * m.x.x + w.y * m.x.y + w.z * m.x.z, w.x * m.y.x + w.y * m.y.y + w.z * m.y.z,
          w.x * m.z.x + w.y * m.z.y + w.z * m.z.z};
}

template <int W>
struct DomeCoordinates {
  vfloat<W> s, t;
  // Maps `w`, in the dome's frame, to image coordinates.
  PRIMRAY_INLINE explicit DomeCoordinates(const vvec3<W>& w) {
    s = clamp(0.5f - atan2(w.x, w.z) * (0.5f * kInvPi), 0.0f, 0x1.fffffep-1f);
    // Uses the tangent: close to a pole the cosine has no precision.
    t = clamp(atan2(sqrt(w.x * w.x + w.z * w.z), w.y) * kInvPi, 0.0f, 0x1.fffffep-1f);
  }
};

template <int W>
PRIMRAY_INLINE vvec3<W> dome_radiance(const Dome& dome, const DomeCoordinates<W>& c) {
  const vvec3<W> tint(vfloat<W>(dome.tint.x), vfloat<W>(dome.tint.y), vfloat<W>(dome.tint.z));
  return tint * read_bilinear(dome.texels.data(), dome.width, BilinearAxis<W>::around(c.s * float(dome.width), dome.width),
                              BilinearAxis<W>(c.t * float(dome.height), dome.height));
}

// Radiance of an image that is not lat-long, from unit `w` in the dome's frame.
template <int W>
PRIMRAY_RARE vvec3<W> folded_radiance(const Dome& dome, const vvec3<W>& w) {
  const vvec3<W> tint(vfloat<W>(dome.tint.x), vfloat<W>(dome.tint.y), vfloat<W>(dome.tint.z));
  const ImagePoint<W> p = image_point(dome.format, w, dome.width, dome.height);
  return tint *
         read_bilinear(dome.texels.data(), dome.width, BilinearAxis<W>(p.x, dome.width), BilinearAxis<W>(p.y, dome.height));
}

// Radiance from unit direction `w`, and the density with which dome_sample() chooses it.
template <int W>
PRIMRAY_INLINE vvec3<W> dome_eval(const Dome& dome, const vvec3<W>& world, vfloat<W>& pdf) {
  if (dome.width == 0) {
    pdf = vfloat<W>(0.0f);
    return {vfloat<W>(dome.tint.x), vfloat<W>(dome.tint.y), vfloat<W>(dome.tint.z)};
  }
  const vvec3<W> w = dome_local(dome, world);
  const DomeCoordinates<W> c(w);
  pdf = vfloat<W>(0.0f);
  if (dome.sampled) {
    const vint<W> x = truncate(c.s * float(dome.columns)), y = truncate(c.t * float(dome.rows));
    pdf = gather<W>(dome.density.data(), min(y, dome.rows - 1) * vint<W>(dome.columns) + min(x, dome.columns - 1));
  }
  return dome.format == DomeFormat::kLatLong ? dome_radiance(dome, c) : folded_radiance(dome, w);
}

// Samples a direction in world space, with its density; only for a dome that is sampled.
template <int W>
PRIMRAY_INLINE vvec3<W> dome_sample(const Dome& dome, vfloat<W> u, vfloat<W> v) {
  const float *rows = dome.row_cdf.data(), *columns = dome.column_cdf.data();
  const vint<W> y = find_interval<W>(rows, vint<W>(0), dome.row_cuts.data(), vint<W>(0), pieces_of(dome.rows), u);
  const vfloat<W> r0 = gather<W>(rows, y), r1 = gather<W>(rows + 1, y);
  const vint<W> base = y * vint<W>(dome.columns + 1);
  const int pieces = pieces_of(dome.columns);
  const vint<W> x = find_interval<W>(columns, base, dome.column_cuts.data(), y * vint<W>(pieces + 1), pieces, v);
  const vfloat<W> c0 = gather<W>(columns, base + x), c1 = gather<W>(columns + 1, base + x);
  const vfloat<W> fy = clamp((u - r0) / max(r1 - r0, 1e-30f), 0.0f, 1.0f),
                  fx = clamp((v - c0) / max(c1 - c0, 1e-30f), 0.0f, 1.0f);
  const vfloat<W> edge0 = gather<W>(dome.row_edges.data(), y * vint<W>(2)),
                  edge1 = gather<W>(dome.row_edges.data() + 1, y * vint<W>(2));
  const vfloat<W> from_pole = edge0 + fy * (edge1 - edge0);
  const vfloat<W> cos_theta = select(y < vint<W>(dome.upper_rows()), 1.0f - from_pole, from_pole - 1.0f);
  const vfloat<W> turn = 0.5f - (to_float(x) + fx) * (1.0f / float(dome.columns));
  const vfloat<W> sin_theta = safe_sqrt(from_pole * (2.0f - from_pole));
  const SinCos<W> phi = sincos_turns(turn);
  const vvec3<W> w{sin_theta * phi.sin, cos_theta, sin_theta * phi.cos};
  const Affine<float>& m = dome.world_from_light;
  return {w.x * m.x.x + w.y * m.y.x + w.z * m.z.x, w.x * m.x.y + w.y * m.y.y + w.z * m.z.y,
          w.x * m.x.z + w.y * m.y.z + w.z * m.z.z};
}

}  // namespace primray
