// Rectangle light with an image: sampled from a mixture of the plain rectangle and of the image's bright parts.
//
// UsdLux RectLight: the image's first column and row are at +x and +y, its last at -x and -y, so that it is upright and not
// mirrored for a viewer whom it faces.
#pragma once

#include "light/types/light_image.hpp"
#include "light/types/rect.hpp"

namespace primray {

// Density of the mixture towards the point (x, y) of the rectangle, `distance` from p; `plain`: density of rect_sample().
template <int W>
PRIMRAY_INLINE vfloat<W> textured_rect_pdf(const LightImage& image, vfloat<W> s, vfloat<W> t, vfloat<W> plain, vfloat<W> hx,
                                           vfloat<W> hy, vfloat<W> distance, vfloat<W> height) {
  const vfloat<W> by_area = image_density(image, s, t) / (4.0f * hx * hy);
  return plain * (1.0f - image.excess) + by_area * (distance * distance * distance / height) * image.excess;
}

// `value`: that of the image at the point.
template <int W>
PRIMRAY_RARE LocalSample<W> textured_rect_sample(const LightImage& image, const vvec3<W>& p, vfloat<W> hx, vfloat<W> hy,
                                                 vfloat<W> u, vfloat<W> v, vvec3<W>& value) {
  const vbool<W> bright = u < vfloat<W>(image.excess);
  const float part = image.excess > 0 ? 1 / image.excess : 0.0f, rest = 1 / (1 - image.excess);
  const vfloat<W> again = min(select(bright, u * part, (u - image.excess) * rest), 0x1.fffffep-1f);
  LocalSample<W> plain = rect_sample(p, hx, hy, again, v);
  vfloat<W> s(0.0f), t(0.0f);
  if (any(bright)) image_sample(image, again, v, s, t);
  const vvec3<W> chosen = plain.w * plain.t + p;  // on the rectangle
  s = select(bright, s, 0.5f - chosen.x / (2.0f * hx)), t = select(bright, t, 0.5f - chosen.y / (2.0f * hy));
  const vvec3<W> to{(1.0f - 2.0f * s) * hx - p.x, (1.0f - 2.0f * t) * hy - p.y, -p.z};
  const vfloat<W> d2 = dot(to, to), d = sqrt(d2);
  const vvec3<W> w = select(bright, to * (1.0f / d), plain.w);
  const vfloat<W> distance = select(bright, d, plain.t);
  value = image_value(image, s, t);
  const vbool<W> front = p.z < vfloat<W>(0.0f);
  const vfloat<W> pdf = textured_rect_pdf(image, s, t, rect_pdf(p, hx, hy, w * distance), hx, hy, distance, -p.z);
  return {w, distance, select(front & (pdf > vfloat<W>(0.0f)) & (pdf < vfloat<W>(kInfinity)), pdf, vfloat<W>(0.0f))};
}

// Density for a ray p + distance w (w unit) that hit the rectangle; `plain` from rect_hit().
template <int W>
PRIMRAY_RARE vfloat<W> textured_rect_hit(const LightImage& image, const vvec3<W>& p, const vvec3<W>& w, vfloat<W> hx,
                                         vfloat<W> hy, vfloat<W> distance, vfloat<W> plain, vvec3<W>& value) {
  const vfloat<W> s = 0.5f - (p.x + w.x * distance) / (2.0f * hx), t = 0.5f - (p.y + w.y * distance) / (2.0f * hy);
  value = image_value(image, s, t);
  return textured_rect_pdf(image, s, t, plain, hx, hy, distance, -p.z);
}

}  // namespace primray
