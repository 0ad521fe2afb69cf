// Construction of mip_pyramid.hpp.
#include "texture/mip_pyramid.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#ifdef __F16C__
#include <immintrin.h>
#endif

#include "base/error.hpp"
#include "base/time_spans.hpp"

namespace primray {
namespace {

constexpr float kUnormSteps = 65535, kLargestHalf = 65504;
constexpr size_t kMaxChannels = size_t(1) << 31;  // gathers address channels by 32-bit signed numbers

int half_of(int n) { return std::max(1, n / 2); }

// Rounded to nearest, ties to even; |f| <= 65504.
uint16_t half_from_float(float f) {
  const uint32_t all = std::bit_cast<uint32_t>(f), sign = all >> 16 & 0x8000;
  uint32_t x = all & 0x7fffffff;
  if (x < 0x38800000) return uint16_t(sign | uint32_t(std::lrint(double(std::fabs(f)) * 0x1p24)));
  x += 0xfff + (x >> 13 & 1);
  return uint16_t(sign | std::min<uint32_t>((x - (112u << 23)) >> 13, 0x7bff));
}

// Rounded to nearest, ties to even, without a call that would keep loops from being vectorised; |f| <= 1.
uint16_t unorm_from_float(float f) { return uint16_t(std::bit_cast<uint64_t>(double(f) * kUnormSteps + 0x1.8p52)); }

}  // namespace

void store_halves(std::span<const float> from, uint16_t* to) {
  size_t i = 0;
#ifdef __F16C__
  for (; i + 8 <= from.size(); i += 8) {
    const __m128i halves = _mm256_cvtps_ph(_mm256_loadu_ps(&from[i]), _MM_FROUND_TO_NEAREST_INT);
    _mm_storeu_si128(reinterpret_cast<__m128i*>(to + i), halves);
  }
#endif
  for (; i < from.size(); ++i) to[i] = half_from_float(from[i]);
}

void store_unorms(std::span<const float> from, uint16_t* to) {
  for (size_t i = 0; i < from.size(); ++i) to[i] = unorm_from_float(from[i]);
}

namespace {

// Weights of `from` texels in each of `to` texels: the share of its extent that is in each.
struct Spans {
  struct Span {
    int first, count;
    float weight[4];
  };
  std::vector<Span> of;
  Spans(int from, int to) {
    const double size = double(from) / to;
    for (int i = 0; i < to; ++i) {
      const double a = i * size, b = (i + 1) * size;
      Span s{int(a), 0, {}};
      // At most 3 / 1 to 1: never more than four.
      for (int k = s.first; k < from && k < b - 1e-9 && s.count < 4; ++k)
        s.weight[s.count++] = float((std::min<double>(k + 1, b) - std::max<double>(k, a)) / size);
      of.push_back(s);
    }
  }
};

// For even sizes: all weights are a half, which rounds nothing.
template <int C>
std::vector<float> halved_evenly(const float* from, int width, int height) {
  const int w = width / 2, h = height / 2;
  std::vector<float> to(size_t(w) * h * C);
  for (int y = 0; y < h; ++y) {
    const float *first = from + size_t(2 * y) * width * C, *second = first + size_t(width) * C;
    float* target = &to[size_t(y) * w * C];
    for (int x = 0; x < w; ++x) {
      for (int c = 0; c < C; ++c) {
        const int i = 2 * x * C + c;
        const float upper = 0.5f * first[i] + 0.5f * first[i + C], lower = 0.5f * second[i] + 0.5f * second[i + C];
        target[x * C + c] = 0.5f * upper + 0.5f * lower;
      }
    }
  }
  return to;
}

std::vector<float> halved(std::span<const float> from, int width, int height, int channels) {
  if (width % 2 == 0 && height % 2 == 0)
    return channels == 1 ? halved_evenly<1>(from.data(), width, height) : halved_evenly<3>(from.data(), width, height);
  const int w = half_of(width), h = half_of(height);
  const Spans columns(width, w), rows(height, h);
  std::vector<float> to(size_t(w) * h * channels, 0.0f), line(size_t(w) * channels);
  for (int y = 0; y < h; ++y) {
    for (int j = 0; j < rows.of[y].count; ++j) {
      const float* source = &from[size_t(rows.of[y].first + j) * width * channels];
      for (int x = 0; x < w; ++x) {
        const Spans::Span& span = columns.of[x];
        for (int c = 0; c < channels; ++c) {
          float sum = 0;
          for (int i = 0; i < span.count; ++i) sum += span.weight[i] * source[size_t(span.first + i) * channels + c];
          line[size_t(x) * channels + c] = sum;
        }
      }
      float* target = &to[size_t(y) * w * channels];
      for (size_t i = 0; i < line.size(); ++i) target[i] += rows.of[y].weight[j] * line[i];
    }
  }
  return to;
}

}  // namespace

void measure(std::span<const float> pixels, TextureImage& image) {
  const int channels = image.channels;
  double sum[3] = {};
  for (int c = 0; c < channels; ++c) image.low[c] = INFINITY, image.high[c] = -INFINITY;
  bool unorm = true, half = true;
  for (size_t i = 0; i < pixels.size(); i += channels) {
    for (int c = 0; c < channels; ++c) {
      const float v = pixels[i + c];
      sum[c] += v, image.low[c] = std::min(image.low[c], v), image.high[c] = std::max(image.high[c], v);
      half &= std::fabs(v) <= kLargestHalf;
      if (unorm) unorm = v >= 0 && v <= 1 && std::fabs(float(unorm_from_float(v)) / kUnormSteps - v) <= 0x1p-24f;
    }
  }
  const double n = double(pixels.size()) / channels;
  for (int c = 0; c < channels; ++c) image.mean[c] = float(sum[c] / n);
  for (int c = channels; c < 3; ++c) image.mean[c] = image.mean[0], image.low[c] = image.low[0], image.high[c] = image.high[0];
  image.format = unorm ? TexelFormat::kUnorm16 : half ? TexelFormat::kHalf : TexelFormat::kFloat;
}

namespace {

// Appends a level, reversing the order of its rows.
void keep(std::span<const float> level, int number, int width, int height, TextureImage& image) {
  const size_t row = size_t(width) * image.channels;
  image.level_width[number] = width, image.level_height[number] = height;
  image.level_offset[number] = int32_t(image.small.size() + image.large.size());
  const size_t first = image.small.size();
  if (image.format != TexelFormat::kFloat) image.small.resize(first + row * height);
  for (int y = 0; y < height; ++y) {
    const std::span<const float> from = level.subspan(size_t(height - 1 - y) * row, row);
    switch (image.format) {
      case TexelFormat::kUnorm16:
        store_unorms(from, &image.small[first + y * row]);
        break;
      case TexelFormat::kHalf:
        store_halves(from, &image.small[first + y * row]);
        break;
      case TexelFormat::kFloat:
        image.large.insert(image.large.end(), from.begin(), from.end());
        break;
    }
  }
}

// Channels of levels [first, last] together.
size_t channels_of(int width, int height, int channels, int first, int last) {
  size_t sum = 0;
  for (int level = 0; level <= last; ++level, width = half_of(width), height = half_of(height))
    if (level >= first) sum += size_t(width) * height * channels;
  return sum;
}

}  // namespace

int last_level_of(int width, int height) {
  int level = 0;
  for (; width > 1 || height > 1; ++level) width = half_of(width), height = half_of(height);
  return level;
}

void for_levels(std::span<const float> pixels, int width, int height, int channels, int last,
                const std::function<void(int, std::span<const float>, int, int)>& see) {
  std::vector<float> coarser;
  for (int level = 0;; ++level, width = half_of(width), height = half_of(height)) {
    const std::span<const float> now = level == 0 ? pixels : std::span<const float>(coarser);
    see(level, now, width, height);
    if (level == last) break;
    coarser = halved(now, width, height, channels);
  }
}

TextureImage make_image(std::span<const float> pixels, int width, int height, int channels, int first_level, bool one_level) {
  const TimeSpan span("make a texture's levels");
  TextureImage image;
  image.width = width, image.height = height, image.channels = channels;
  const int coarsest = last_level_of(width, height);
  image.first_level = std::clamp(first_level, 0, coarsest);
  image.last_level = one_level ? image.first_level : coarsest;
  const size_t total = channels_of(width, height, channels, image.first_level, image.last_level);
  if (total >= kMaxChannels) throw Error("too-large", "a texture's kept levels have more than 2147 million values");
  measure(pixels, image);
  if (image.format == TexelFormat::kFloat) {
    image.large.reserve(total + 1);
  } else {
    image.small.reserve(total + 1);
  }
  for_levels(pixels, width, height, channels, image.last_level, [&](int level, std::span<const float> now, int w, int h) {
    if (level >= image.first_level) keep(now, level, w, h, image);
  });
  if (image.format == TexelFormat::kFloat) {
    image.large.push_back(0);
  } else {
    image.small.push_back(0);
  }
  return image;
}

}  // namespace primray
