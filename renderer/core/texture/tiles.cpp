// Implementation of tiles.hpp.
#include "texture/tiles.hpp"

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <thread>
#include <utility>

#include "base/error.hpp"

namespace primray {
namespace {

constexpr size_t kPage = 4096;
constexpr size_t kGatherSpare = 8;  // bytes that a gather of the last texel may read beyond it

size_t whole_pages(size_t bytes) { return (bytes + kPage - 1) / kPage * kPage; }

// Reads all bytes; returns an errno, or 0.
int read_fully(int file, char* to, size_t bytes, int64_t at) {
  while (bytes > 0) {
    const ssize_t n = pread(file, to, bytes, off_t(at));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return errno;
    if (n == 0) return ENODATA;
    to += n, at += n, bytes -= size_t(n);
  }
  return 0;
}

}  // namespace

TextureTiles::Layout::Layout(int width, int height, int finest) {
  int widths[kMaxLevels], heights[kMaxLevels], last = 0;
  for (int w = width, h = height;; ++last, w = std::max(1, w / 2), h = std::max(1, h / 2)) {
    widths[last] = w, heights[last] = h;
    if (w == 1 && h == 1) break;
  }
  count = 1;
  for (int level = last; level >= finest; --level) {
    const int longest = std::max(widths[level], heights[level]);
    if (longest <= kTailEdge) {
      // Levels of at most 32, 16, 8 ... texels are side by side in the rows of tile 0.
      int span = 1;
      while (span < longest) span *= 2;
      first[level] = 0, across[level] = 1, column[level] = kEdge - 2 * span;
    } else {
      across[level] = (widths[level] + kEdge - 1) / kEdge;
      first[level] = count;
      count += across[level] * ((heights[level] + kEdge - 1) / kEdge);
    }
  }
}

TextureTiles::TextureTiles(std::shared_ptr<TileMemory> memory, std::string path, int file, int64_t offset, const Layout& layout,
                           int tile_bytes)
    : memory_(std::move(memory)),
      path_(std::move(path)),
      file_(file),
      offset_(offset),
      layout_(layout),
      tile_bytes_(tile_bytes) {
  const size_t texels = whole_pages(size_t(layout.count) * size_t(tile_bytes) + kGatherSpare);
  reserved_ = texels + whole_pages(size_t(layout.count) * sizeof(int32_t));
  void* at = mmap(nullptr, reserved_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (at == MAP_FAILED) {
    const std::string why = std::strerror(errno);
    close(file_);
    throw Error("texture-cache", "no addresses for the texture's tiles: " + why);
  }
  madvise(at, reserved_, MADV_NOHUGEPAGE);  // a tile must not take the 2 MiB around it
  texels_ = static_cast<char*>(at);
  states_ = reinterpret_cast<int32_t*>(texels_ + texels);
  memory_->images_ += 1;
}

TextureTiles::~TextureTiles() {
  memory_->forget(*this);
  munmap(texels_, reserved_);
  close(file_);
}

void TextureTiles::copy(int32_t tile, int32_t at, int32_t bytes, void* to) {
  const std::atomic_ref<int32_t> now = state(tile);
  for (;;) {
    int32_t seen = now.load(std::memory_order_acquire);
    if (seen & kResident) {
      std::memcpy(to, texels_ + size_t(tile) * size_t(tile_bytes_) + at, size_t(bytes));
      std::atomic_thread_fence(std::memory_order_acquire);
      const int32_t after = now.load(std::memory_order_relaxed);
      if (uint32_t(after ^ seen) >= uint32_t(kBusy)) continue;  // evicted meanwhile, perhaps read again
      if (!(after & kUsed)) now.fetch_or(kUsed, std::memory_order_relaxed);
      return;
    }
    if (seen & kBusy) {
      now.wait(seen, std::memory_order_acquire);
      continue;
    }
    if (!now.compare_exchange_strong(seen, seen | kBusy, std::memory_order_acquire)) continue;
    load(tile);
    // Copied before others see the tile: however small the budget, each load serves the lane that asked for it.
    std::memcpy(to, texels_ + size_t(tile) * size_t(tile_bytes_) + at, size_t(bytes));
    now.store((seen & ~(kBusy | kUsed)) | kResident | kUsed, std::memory_order_release);
    now.notify_all();
    return;
  }
}

void TextureTiles::load(int32_t tile) {
  memory_->admit(*this, tile);
  const auto start = std::chrono::steady_clock::now();
  char* to = texels_ + size_t(tile) * size_t(tile_bytes_);
  if (const int error = read_fully(file_, to, size_t(tile_bytes_), offset_ + int64_t(tile) * tile_bytes_)) {
    std::memset(to, 0, size_t(tile_bytes_));  // the pass fails at its end
    memory_->report_fault("tile " + std::to_string(tile) + " of " + path_ + ": " + std::strerror(error));
  }
  const auto spent = std::chrono::steady_clock::now() - start;
  memory_->reads_ += 1, memory_->read_bytes_ += tile_bytes_;
  memory_->read_nanoseconds_ += std::chrono::duration_cast<std::chrono::nanoseconds>(spent).count();
}

void TextureTiles::release(int32_t tile) {
  madvise(texels_ + size_t(tile) * size_t(tile_bytes_), size_t(tile_bytes_), MADV_DONTNEED);
  const std::atomic_ref<int32_t> now = state(tile);
  now.fetch_and(~kBusy, std::memory_order_release);
  now.notify_all();
}

void TileMemory::admit(TextureTiles& tiles, int32_t tile) {
  std::vector<Entry> evicted;
  {
    const std::scoped_lock lock(mutex_);
    resident_ += tiles.tile_bytes_;
    const int64_t allowed = std::max(budget_ - held_, kLeastBytes);
    bool placed = false;
    // Twice around: the first time takes away what was used, the second time evicts. Tiles that are being read stay.
    for (size_t steps = 2 * ring_.size() + 1; resident_ > allowed && !ring_.empty() && steps > 0; --steps) {
      hand_ = hand_ < ring_.size() ? hand_ : 0;
      const Entry entry = ring_[hand_];
      const std::atomic_ref<int32_t> state = entry.tiles->state(entry.tile);
      int32_t seen = state.load(std::memory_order_relaxed);
      if (!(seen & TextureTiles::kResident)) {
        ++hand_;
      } else if (seen & TextureTiles::kUsed) {
        state.fetch_and(~TextureTiles::kUsed, std::memory_order_relaxed);
        ++hand_;
      } else if (state.compare_exchange_strong(
                     seen, int32_t(uint32_t(seen & ~TextureTiles::kResident) + TextureTiles::kEviction) | TextureTiles::kBusy,
                     std::memory_order_acq_rel)) {
        evicted.push_back(entry);
        resident_ -= entry.tiles->tile_bytes_;
        if (!placed) {
          ring_[hand_++] = {&tiles, tile};
          placed = true;
        } else {
          ring_[hand_] = ring_.back();
          ring_.pop_back();
        }
      }
    }
    if (!placed) ring_.push_back({&tiles, tile});
    peak_ = std::max(peak_, resident_);
    evictions_ += int64_t(evicted.size());
    releasing_ += 1;
  }
  for (const Entry& entry : evicted) entry.tiles->release(entry.tile);
  releasing_ -= 1;
}

void TileMemory::hold(int64_t bytes) {
  const std::scoped_lock lock(mutex_);
  held_ = bytes;
}

void TileMemory::forget(const TextureTiles& tiles) {
  const std::scoped_lock lock(mutex_);
  while (releasing_ > 0) std::this_thread::yield();  // one of the tiles may be among those
  const auto left = std::ranges::remove_if(ring_, [&](const Entry& e) { return e.tiles == &tiles; });
  resident_ -= int64_t(left.size()) * tiles.tile_bytes_;
  ring_.erase(left.begin(), left.end());
  images_ -= 1;
}

void TileMemory::report_fault(const std::string& what) {
  const std::scoped_lock lock(mutex_);
  if (fault_.empty()) fault_ = what;
}

std::string TileMemory::take_fault() {
  const std::scoped_lock lock(mutex_);
  return std::exchange(fault_, {});
}

TileMemory::Counts TileMemory::counts() const {
  const std::scoped_lock lock(mutex_);
  return {images_, reads_, read_bytes_, read_nanoseconds_, evictions_, resident_, peak_};
}

}  // namespace primray
