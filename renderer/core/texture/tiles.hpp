// Images whose levels are read by tile from a file while rays ask for them, within a budget of memory.
//
// An image reserves addresses for all of its tiles, and memory for those alone that are resident. Values never depend on what
// is resident: a lookup that misses a tile reads it in place and continues. Nothing is pinned. A reader copies texels and then
// looks at the tile's state again: if the tile was evicted meanwhile, the copy is discarded (a sequence lock for each tile).
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

namespace primray {

class TextureTiles;

// The tiles of all images that share a budget.
class TileMemory {
 public:
  struct Counts {
    int64_t images = 0;            // read by tile
    int64_t reads = 0;             // tiles read, some of them again
    int64_t read_bytes = 0;        // of those
    int64_t read_nanoseconds = 0;  // in all threads
    int64_t evictions = 0;
    int64_t resident_bytes = 0, peak_bytes = 0;
  };

  explicit TileMemory(int64_t budget_bytes) : budget_(budget_bytes) {}
  Counts counts() const;
  int64_t budget_bytes() const { return budget_; }
  // Sets the part of the budget that images take which are held whole. Tiles keep at least kLeastBytes.
  void hold(int64_t bytes);
  // Describes the first tile that could not be read since the last call; empty where all could.
  std::string take_fault();

 private:
  friend class TextureTiles;
  struct Entry {
    TextureTiles* tiles;
    int32_t tile;
  };
  static constexpr int64_t kLeastBytes = 1 << 20;

  // Accounts for a tile that is about to be read, and evicts others that were not used lately.
  void admit(TextureTiles& tiles, int32_t tile);
  void forget(const TextureTiles& tiles);
  void report_fault(const std::string& what);

  const int64_t budget_;
  std::atomic<int64_t> images_{0}, reads_{0}, read_bytes_{0}, read_nanoseconds_{0}, evictions_{0};
  std::atomic<int> releasing_{0};  // threads that free memory of tiles which they have evicted
  mutable std::mutex mutex_;
  // Guarded by mutex_. The hand goes around the ring of resident tiles: those that were used since it passed stay (second
  // chance).
  std::vector<Entry> ring_;
  size_t hand_ = 0;
  int64_t held_ = 0, resident_ = 0, peak_ = 0;
  std::string fault_;
};

// Tiles of one image. A tile has 64 x 64 texels, row by row; levels of at most 32 x 32 share tile 0. Coarse levels come first.
class TextureTiles {
 public:
  static constexpr int kLog2Edge = 6, kEdge = 1 << kLog2Edge, kTexels = kEdge * kEdge, kTailEdge = kEdge / 2;
  static constexpr int kMaxLevels = 24;
  // Bits of a tile's state; those above count its evictions.
  static constexpr int32_t kResident = 1, kUsed = 2, kBusy = 4, kEviction = 8;

  // By level: its first tile, its tiles in a row, and the column of its first texel in the tile (only levels in tile 0 have
  // one).
  struct Layout {
    int32_t first[kMaxLevels] = {}, across[kMaxLevels] = {}, column[kMaxLevels] = {};
    int32_t count = 0;  // of all tiles
    // `finest`: the finest level that has tiles, of an image of that size.
    Layout(int width, int height, int finest);
  };

  // Takes over the file, whose tiles begin at byte `offset`. Throws Error where no addresses can be reserved.
  TextureTiles(std::shared_ptr<TileMemory> memory, std::string path, int file, int64_t offset, const Layout& layout,
               int tile_bytes);
  ~TextureTiles();
  TextureTiles(const TextureTiles&) = delete;
  TextureTiles& operator=(const TextureTiles&) = delete;

  const Layout& layout() const { return layout_; }
  TileMemory& memory() const { return *memory_; }
  const void* texels() const { return texels_; }
  const int32_t* states() const { return states_; }
  // Copies `bytes` bytes at byte `at` of a tile to `to`, and reads the tile from the file where it is not resident.
  void copy(int32_t tile, int32_t at, int32_t bytes, void* to);

 private:
  friend class TileMemory;
  std::atomic_ref<int32_t> state(int32_t tile) const { return std::atomic_ref<int32_t>(states_[tile]); }
  void load(int32_t tile);
  // Frees a tile's memory; its state is kBusy.
  void release(int32_t tile);

  const std::shared_ptr<TileMemory> memory_;
  const std::string path_;
  const int file_;
  const int64_t offset_;
  const Layout layout_;
  const int tile_bytes_;
  size_t reserved_ = 0;
  char* texels_ = nullptr;
  int32_t* states_ = nullptr;  // after the texels, in the same reservation
};

}  // namespace primray
