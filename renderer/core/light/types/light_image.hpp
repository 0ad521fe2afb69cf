// Image of a rectangle light: interpolated bilinearly, clamped at the edge, and importance sampled where it exceeds its mean.
//
// The part at or below the mean is left to uniform sampling of the rectangle, so that light samples come from a mixture of both
// (textured_rect.hpp): a constant image is sampled like none, a single small bright spot almost always at the spot.
#pragma once

#include <vector>

#include "light/dome/cdf.hpp"
#include "light/shape/bilinear.hpp"

namespace primray {

struct LightImage {
  int width = 0, height = 0;
  std::vector<float> texels;               // 3 (width) (height), first row at the top
  std::vector<float> row_cdf, column_cdf;  // of the excess over the mean: height + 1, height (width + 1); empty if there is
                                           // none
  float excess = 0;                        // share of light samples drawn from the image
  double mean = 0;                         // luminance
};

// Computes the distributions and the mean from the texels.
void build_light_image(LightImage& image);

// Factor of the radiance at (s, t) in [0, 1], t from the top.
template <int W>
PRIMRAY_INLINE vvec3<W> image_value(const LightImage& image, vfloat<W> s, vfloat<W> t) {
  return read_bilinear(image.texels.data(), image.width, BilinearAxis<W>(s * float(image.width), image.width),
                       BilinearAxis<W>(t * float(image.height), image.height));
}

// Density of image_sample() at (s, t), per unit square; 0 where the image is below its mean. Computed from the distributions,
// so that it matches the sampling to the last bit.
template <int W>
PRIMRAY_INLINE vfloat<W> image_density(const LightImage& image, vfloat<W> s, vfloat<W> t) {
  if (image.row_cdf.empty()) return vfloat<W>(0.0f);
  const vint<W> x = min(truncate(clamp(s, 0.0f, 1.0f) * float(image.width)), image.width - 1);
  const vint<W> y = min(truncate(clamp(t, 0.0f, 1.0f) * float(image.height)), image.height - 1);
  const vint<W> column = y * vint<W>(image.width + 1) + x;
  const vfloat<W> of_row = gather<W>(image.row_cdf.data() + 1, y) - gather<W>(image.row_cdf.data(), y);
  const vfloat<W> of_column = gather<W>(image.column_cdf.data() + 1, column) - gather<W>(image.column_cdf.data(), column);
  return of_row * of_column * (float(image.width) * float(image.height));
}

// Samples (s, t) where the image exceeds its mean: a texel in proportion to its excess, then a uniform point in it.
template <int W>
PRIMRAY_INLINE void image_sample(const LightImage& image, vfloat<W> u, vfloat<W> v, vfloat<W>& s, vfloat<W>& t) {
  const float *rows = image.row_cdf.data(), *columns = image.column_cdf.data();
  const vint<W> y = find_interval<W>(rows, vint<W>(0), image.height, u);
  const vint<W> base = y * vint<W>(image.width + 1);
  const vint<W> x = find_interval<W>(columns, base, image.width, v);
  const auto within = [](vfloat<W> at, vfloat<W> from, vfloat<W> to) {
    return clamp((at - from) / max(to - from, 1e-30f), 0.0f, 0x1.fffffep-1f);
  };
  const vfloat<W> fy = within(u, gather<W>(rows, y), gather<W>(rows + 1, y));
  const vfloat<W> fx = within(v, gather<W>(columns, base + x), gather<W>(columns + 1, base + x));
  s = (to_float(x) + fx) * (1.0f / float(image.width));
  t = (to_float(y) + fy) * (1.0f / float(image.height));
}

}  // namespace primray
