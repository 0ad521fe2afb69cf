// Implementation of tile_file.hpp.
#include "texture/tile_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <utility>

#include "base/error.hpp"
#include "texture/mip_pyramid.hpp"

namespace primray {
namespace {

constexpr int64_t kHeaderBytes = 4096;
constexpr int64_t kMaxChannels = int64_t(1) << 31;  // gathers address channels by 32-bit signed numbers
constexpr char kMagic[8] = {'p', 'r', 'i', 'm', 't', 'i', 'l', 'e'};
constexpr uint32_t kVersion = 1;

struct Header {
  char magic[8];
  uint32_t version;
  uint32_t byte_order;  // 0x01020304
  char key[128];
  int32_t width, height, channels, format, first_level, last_level, tiles, tile_bytes;
  float mean[3], low[3], high[3];
  uint32_t spare;
  uint64_t checksum;  // FNV-1a of all bytes before it
};
static_assert(sizeof(Header) <= kHeaderBytes);

uint64_t checksum_of(const Header& h) {
  uint64_t sum = 14695981039346656037u;
  const auto* bytes = reinterpret_cast<const unsigned char*>(&h);
  for (size_t i = 0; i < offsetof(Header, checksum); ++i) sum = (sum ^ bytes[i]) * 1099511628211u;
  return sum;
}

[[noreturn]] void refuse(const std::string& why) { throw Error("texture-cache", why); }

void write_fully(int file, const void* data, size_t bytes, int64_t at) {
  const char* from = static_cast<const char*>(data);
  while (bytes > 0) {
    const ssize_t n = pwrite(file, from, bytes, off_t(at));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) refuse(std::strerror(errno));
    from += n, at += n, bytes -= size_t(n);
  }
}

void store(std::span<const float> from, TexelFormat format, char* to) {
  switch (format) {
    case TexelFormat::kUnorm16:
      store_unorms(from, reinterpret_cast<uint16_t*>(to));
      break;
    case TexelFormat::kHalf:
      store_halves(from, reinterpret_cast<uint16_t*>(to));
      break;
    case TexelFormat::kFloat:
      std::memcpy(to, from.data(), from.size_bytes());
      break;
  }
}

int tile_bytes_of(const TextureImage& image) { return TextureTiles::kTexels * image.channels * image.channel_bytes(); }

// Writes the levels of one image, which come from the finest on.
class Writer {
 public:
  Writer(int file, const TextureImage& image, const TextureTiles::Layout& layout)
      : file_(file), image_(image), layout_(layout), texel_(size_t(image.channels * image.channel_bytes())) {}

  void add(int level, std::span<const float> texels, int width, int height) {
    constexpr int kEdge = TextureTiles::kEdge;
    const bool is_tail = layout_.first[level] == 0;
    if (is_tail) tail_.resize(TextureTiles::kTexels * texel_);
    for (int bottom = 0; bottom < height; bottom += kEdge) {
      // A row of tiles, whose texels are together in the file
      const int across = layout_.across[level], rows = std::min(kEdge, height - bottom);
      std::vector<char>& to = is_tail ? tail_ : row_;
      if (!is_tail) row_.assign(size_t(across) * TextureTiles::kTexels * texel_, 0);
      for (int y = 0; y < rows; ++y) {
        const float* from = &texels[size_t(height - 1 - bottom - y) * size_t(width) * size_t(image_.channels)];
        for (int tile = 0; tile < across; ++tile) {
          const int columns = std::min(kEdge, width - tile * kEdge);
          const size_t at = size_t(tile) * TextureTiles::kTexels + size_t(y) * kEdge + size_t(layout_.column[level]);
          store({from + size_t(tile) * kEdge * size_t(image_.channels), size_t(columns) * size_t(image_.channels)},
                image_.format, &to[at * texel_]);
        }
      }
      if (is_tail) continue;
      const int64_t tile = layout_.first[level] + int64_t(bottom / kEdge) * across;
      write_fully(file_, row_.data(), row_.size(), kHeaderBytes + tile * TextureTiles::kTexels * int64_t(texel_));
    }
  }
  void finish() { write_fully(file_, tail_.data(), tail_.size(), kHeaderBytes); }

 private:
  int file_;
  const TextureImage& image_;
  const TextureTiles::Layout& layout_;
  size_t texel_;
  std::vector<char> row_, tail_;
};

struct File {
  int number;
  ~File() {
    if (number >= 0) close(number);
  }
  int release() { return std::exchange(number, -1); }
};

void read_at(int file, void* to, size_t bytes, int64_t at) {
  for (char* p = static_cast<char*>(to); bytes > 0;) {
    const ssize_t n = pread(file, p, bytes, off_t(at));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) refuse(n < 0 ? std::strerror(errno) : "the file is too short");
    p += n, at += n, bytes -= size_t(n);
  }
}

Header header_of(int file, const std::string& key) {
  Header h;
  read_at(file, &h, sizeof h, 0);
  if (std::memcmp(h.magic, kMagic, sizeof kMagic) != 0 || h.version != kVersion || h.byte_order != 0x01020304)
    refuse("it is no file of tiles of this version");
  if (h.checksum != checksum_of(h)) refuse("its header is damaged");
  if (key != std::string(h.key, strnlen(h.key, sizeof h.key))) refuse("it is of another image");
  struct stat about;
  if (fstat(file, &about) != 0) refuse(std::strerror(errno));
  if (about.st_size != kHeaderBytes + int64_t(h.tiles) * h.tile_bytes) refuse("its size is not that of its tiles");
  return h;
}

TextureImage image_of(const Header& h) {
  TextureImage image;
  image.width = h.width, image.height = h.height, image.channels = h.channels, image.format = TexelFormat(h.format);
  image.first_level = h.first_level, image.last_level = h.last_level;
  std::copy_n(h.mean, 3, image.mean), std::copy_n(h.low, 3, image.low), std::copy_n(h.high, 3, image.high);
  return image;
}

// Reads the kept levels of an image into its own arrays.
void read_whole(int file, const TextureTiles::Layout& layout, TextureImage& image) {
  const size_t texel = size_t(image.channels * image.channel_bytes());
  size_t texels = 0;
  for (int level = image.first_level; level <= image.last_level; ++level) {
    image.level_offset[level] = int32_t(texels * size_t(image.channels));
    texels += size_t(image.level_width[level]) * size_t(image.level_height[level]);
  }
  const size_t channels = texels * size_t(image.channels) + 1;
  if (int64_t(channels) > kMaxChannels) throw Error("too-large", "a texture's kept levels have more than 2147 million values");
  char* to;
  if (image.format == TexelFormat::kFloat) {
    image.large.resize(channels);
    to = reinterpret_cast<char*>(image.large.data());
  } else {
    image.small.resize(channels);
    to = reinterpret_cast<char*>(image.small.data());
  }
  std::vector<char> row;
  for (int level = image.first_level; level <= image.last_level; ++level) {
    constexpr int kEdge = TextureTiles::kEdge;
    const int width = image.level_width[level], height = image.level_height[level], across = layout.across[level];
    for (int y = 0; y < height; ++y) {
      if (y % kEdge == 0) {
        row.resize(size_t(across) * TextureTiles::kTexels * texel);
        const int64_t tile = layout.first[level] + int64_t(y / kEdge) * across;
        read_at(file, row.data(), row.size(), kHeaderBytes + tile * TextureTiles::kTexels * int64_t(texel));
      }
      for (int x = 0; x < width; x += kEdge) {
        const size_t bytes = size_t(std::min(kEdge, width - x)) * texel;
        const size_t at = size_t(x / kEdge) * TextureTiles::kTexels + size_t(y % kEdge) * kEdge + size_t(layout.column[level]);
        std::memcpy(to, &row[at * texel], bytes);
        to += bytes;
      }
    }
  }
}

}  // namespace

void write_tile_file(int file, const std::string& key, std::span<const float> pixels, int width, int height, int channels,
                     int first_level) {
  TextureImage image;
  image.width = width, image.height = height, image.channels = channels;
  image.last_level = last_level_of(width, height);
  image.first_level = std::clamp(first_level, 0, image.last_level);
  measure(pixels, image);
  const TextureTiles::Layout layout(width, height, image.first_level);
  if (int64_t(layout.count) * TextureTiles::kTexels * channels >= kMaxChannels)
    throw Error("too-large", "a texture's kept levels have more than 2147 million values");
  Writer writer(file, image, layout);
  for_levels(pixels, width, height, channels, image.last_level, [&](int level, std::span<const float> texels, int w, int h) {
    if (level >= image.first_level) writer.add(level, texels, w, h);
  });
  writer.finish();
  Header h{};
  std::memcpy(h.magic, kMagic, sizeof kMagic);
  h.version = kVersion, h.byte_order = 0x01020304;
  if (key.size() > sizeof h.key) refuse("the key is too long");
  std::memcpy(h.key, key.data(), key.size());
  h.width = width, h.height = height, h.channels = channels, h.format = int32_t(image.format);
  h.first_level = image.first_level, h.last_level = image.last_level, h.tiles = layout.count;
  h.tile_bytes = tile_bytes_of(image);
  std::copy_n(image.mean, 3, h.mean), std::copy_n(image.low, 3, h.low), std::copy_n(image.high, 3, h.high);
  h.checksum = checksum_of(h);
  char block[kHeaderBytes] = {};
  std::memcpy(block, &h, sizeof h);
  write_fully(file, block, sizeof block, 0);
}

TextureImage tile_file_header(const std::string& path, const std::string& key) {
  const File file{open(path.c_str(), O_RDONLY | O_CLOEXEC)};
  if (file.number < 0) refuse(std::strerror(errno));
  return image_of(header_of(file.number, key));
}

TextureImage open_tile_file(const std::string& path, const std::string& key, std::shared_ptr<TileMemory> memory,
                            int first_level, bool one_level) {
  File file{open(path.c_str(), O_RDONLY | O_CLOEXEC)};
  if (file.number < 0) refuse(std::strerror(errno));
  const Header h = header_of(file.number, key);
  if (first_level < h.first_level) refuse("it has not all levels that rays ask for");
  TextureImage image = image_of(h);
  // Levels by tile cost nothing before rays ask for them: the scene may keep those that the file has.
  image.first_level = memory && !one_level ? h.first_level : std::min(first_level, h.last_level);
  image.last_level = one_level ? image.first_level : h.last_level;
  for (int level = 0, w = h.width, ht = h.height; level <= image.last_level; ++level) {
    if (level >= image.first_level) image.level_width[level] = w, image.level_height[level] = ht;
    w = std::max(1, w / 2), ht = std::max(1, ht / 2);
  }
  const TextureTiles::Layout layout(h.width, h.height, h.first_level);
  if (layout.count != h.tiles || tile_bytes_of(image) != h.tile_bytes) refuse("its header contradicts itself");
  if (memory) {
    image.tiles = std::make_shared<TextureTiles>(std::move(memory), path, file.release(), kHeaderBytes, layout, h.tile_bytes);
  } else {
    read_whole(file.number, layout, image);
  }
  return image;
}

}  // namespace primray
