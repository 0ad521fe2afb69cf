// Learning of the guide in passes of paths spread over the frame, each of twice as many as the one before and guided by what
// was found so far. Pilots decide beforehand whether there is anything to gain, after each pass whether to continue, and at the
// end whether the guide is used.
//
// What is learnt are sums of integers by cell and bin, from which regions are made after each pass: they take no more memory
// for more paths, and threads may add to them in any order.
#include "guiding/pilot/learning.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <mutex>
#include <numeric>
#include <thread>

#include "base/time_spans.hpp"
#include "guiding/caustic_guide.hpp"
#include "guiding/pilot/pilot.hpp"

namespace primray {
namespace {

constexpr uint32_t kSeed = 0x6c078965u;
// Error of a pilot with 32 samples per pixel below which a guide is not needed: such images converge soon, and learning takes a
// quarter of a second on one thread.
constexpr double kHard = 0.002;
// Pixels that pilots leave out.
constexpr int kLeftOut = 5;
// Largest share of the error with one scattering event for which indirect light is what is hard; but direct light of a dome,
// which rays look for, may be guided as well: to windows.
constexpr double kMostDirect = 0.3;
// Relative cost of a guided ray, for its tables.
constexpr double kGuidedCost = 1.15;
// Pairs of pilots where the first does not show at once that a guide pays: the ratio of a single pair, with and without a
// guide, is a fifth to a half chance.
constexpr int kPairs = 4;
constexpr double kSure = 0.65;
// Share of sharp photons below which they are not worth their time beside a guide, which finds large lights as well.
constexpr float kFewSharp = 0.05f;
// Cost ratio at which the little that has been learnt so far decides against a guide.
constexpr double kHopeless = 1.25;
// Tasks of the first pass, of which each later one has twice as many as the one before; one is 16 x 16 pixels with 2 x 16
// samples. After kFirstPasses it is known whether a guide pays.
constexpr int kFirstTasks = 4, kFirstPasses = 3, kPasses = 7;
constexpr int kFirstPassesTasks = kFirstTasks * ((1 << kFirstPasses) - 1);
// Learning continues while its rays are at most kLearningShare of those that take a picture to an error of kTarget.
constexpr double kLearningShare = 0.05, kTarget = 0.02;
// A region is halved while it holds twice as many records, inside media the second; below kFewest it is left to the BSDF.
constexpr int kEnough = 3000, kEnoughInside = 4000, kFewest = 200;
// The rest beside the guide's share of the rays falls with this power of the learning paths: 0.58 is the share with 124 tasks,
// 0.65 with 508. Error (relMSE) x CPU seconds relative to a half: a door ajar 0.97, 0.91; a window 0.97, 0.83; an attic 0.96,
// 0.96.
constexpr double kShareGrows = 0.125;
// Upper limit of a record's value relative to the mean: one found by a rare path would outweigh the rest.
constexpr float kMostOfMean = 50;
// Records from everywhere that are added to a region's inside media. The noise of bins is a variance of weights, of which a
// path in dense smoke multiplies many. Error (relMSE) x CPU seconds of 64 x 48 pixels at 16 samples, with 0, 64, 128, 256 of
// them: smoke of optical depth 18 behind a window 0.099, 0.034, 0.027, 0.026 (without a guide inside 0.023); a foggy room
// beyond a door 0.082, 0.089, 0.092, 0.103; one with sun through a window 0.0064, 0.0063, 0.0066, 0.0067.
constexpr double kEven = 128;
// Records with light, weighted as by blur(), from which on a bin is not blurred further; and the most steps. Cross entropy of
// what is found from the first vertex, ajar of the benchmark: one step for all 1.174, no step 1.214, 10 records 1.154,
// 30 1.151.
constexpr double kClear = 30;
constexpr int kBlurs = 3;

struct Record {
  float p[3], d[3];
  // Estimate of the radiance from direction `d`, on surfaces times the cosine, divided by its sampling density.
  float value;
  float paths;  // number of paths that it represents: others from there ended
  int8_t side;
};

vvec3<1> vector_of(const float (&x)[3]) { return {vfloat<1>(x[0]), vfloat<1>(x[1]), vfloat<1>(x[2])}; }

// Bin of a record's direction, on surfaces as seen from the middle of its block.
int bin_of(const Record& r, const Guide::Grid& grid) {
  const vvec3<1> d = vector_of(r.d);
  if (r.side == Guide::kInside) return Guide::bin_of<true>(d).number[0];
  const vint<1> side(r.side);
  const vvec3<1> from = Guide::from_middle<1>(Guide::aside_of<1>(grid, side, vector_of(r.p)), d).d;
  return Guide::bin_of<false>(Guide::to_side<1>(side, from)).number[0];
}

struct Found {
  std::vector<Record> records;
  double rays = 0;
};

Found run_task(const Scene& scene, IntegratorSettings settings, TaskFunction task, int number) {
  if (settings.is_cancelled()) return {};
  settings.splits = settings.light_samples = 1;
  settings.seed = kSeed + uint32_t(number);
  const int w = scene.camera.width, h = scene.camera.height;
  TileBlock block{0, 0, w, h, 0, 0};
  block.stride_x = std::max(1, w / kTile), block.stride_y = std::max(1, h / kTile);
  block.x0 = number * 7 % block.stride_x, block.y0 = number * 5 % block.stride_y;
  for (int& n : block.count) n = kBlock;
  GuideLog log(Worker::kSlots);
  settings.guide_log = &log;
  const auto worker = std::make_unique<Worker>();
  Film film(kTile, kTile);
  task(scene, settings, block, *worker, film, nullptr);
  Found found{{}, double(film.tile_rays[0])};
  std::vector<Record>& records = found.records;
  for (int slot = 0; slot < Worker::kSlots; ++slot) {
    for (int i = 0; i < log.counts[size_t(slot)]; ++i) {
      const GuideRecord& r = log.records[size_t(slot) * GuideLog::kMost + size_t(i)];
      const float value = r.found * r.cosine / (r.pdf * r.survival);
      if (!std::isfinite(value) || !(r.beta > 0)) continue;
      Record record{{r.p[0], r.p[1], r.p[2]}, {r.d[0], r.d[1], r.d[2]}, value, 1 / r.survival, int8_t(Guide::kInside)};
      if (!r.in_medium) {
        const vint<1> side = Guide::side_of<1>(vector_of(r.n));
        record.side = int8_t(side[0]);
        // Directions outside the hemisphere only show that the region is known.
        if (!(Guide::to_side<1>(side, vector_of(r.d)).z[0] > 0)) record.value = 0;
      }
      records.push_back(record);
    }
  }
  return found;
}

// Halves boxes of cells until each holds about as many records.
struct Regions {
  const std::vector<int64_t>& counts;  // by orientation and cell
  const float* extent;
  int enough;
  Guide& guide;
  int regions = 0;

  static size_t at(int side, int x, int y, int z) {
    return ((size_t(side) * Guide::kGrid + size_t(z)) * Guide::kGrid + size_t(y)) * Guide::kGrid + size_t(x);
  }
  template <class F>
  void each(int side, const std::array<int, 3>& a, const std::array<int, 3>& b, F f) {
    for (int z = a[2]; z < b[2]; ++z)
      for (int y = a[1]; y < b[1]; ++y)
        for (int x = a[0]; x < b[0]; ++x) f(at(side, x, y, z));
  }
  void halve(int side, std::array<int, 3> a, std::array<int, 3> b) {
    int64_t count = 0;
    each(side, a, b, [&](size_t i) { count += counts[i]; });
    int axis = 0;
    for (int k = 1; k < 3; ++k)
      if (extent[k] * float(b[size_t(k)] - a[size_t(k)]) > extent[axis] * float(b[size_t(axis)] - a[size_t(axis)])) axis = k;
    const size_t k = size_t(axis);
    if (count >= 2 * enough && b[k] - a[k] > 1) {
      auto middle = b;
      middle[k] = (a[k] + b[k]) / 2;
      halve(side, a, middle);
      a[k] = middle[k];
      halve(side, a, b);
      return;
    }
    const int number = count >= kFewest ? regions++ : -1;
    each(side, a, b, [&](size_t i) { guide.region[i] = number; });
  }
};

using Bins = std::array<double, Guide::kBins>;

// Adds to each bin, four times, its neighbours.
Bins blur(const Bins& bins) {
  Bins sums;
  for (int z = 0; z < Guide::kCosine; ++z) {
    for (int a = 0; a < Guide::kAzimuth; ++a) {
      const int left = (a + Guide::kAzimuth - 1) % Guide::kAzimuth, right = (a + 1) % Guide::kAzimuth;
      const int below = std::max(z - 1, 0), above = std::min(z + 1, Guide::kCosine - 1);
      const auto at = [&](int i, int j) { return bins[size_t(i * Guide::kAzimuth + j)]; };
      sums[size_t(z * Guide::kAzimuth + a)] = 4 * at(z, a) + at(z, left) + at(z, right) + at(below, a) + at(above, a);
    }
  }
  return sums;
}

// Means of bins and their neighbours, two by two along both directions and then blurred once: for media, where noise of bins is
// a variance of weights that multiply.
void blur_coarsely(Bins& bins) {
  constexpr int kRows = Guide::kCosine / 2, kColumns = Guide::kAzimuth / 2;
  const auto sum = [&](int z, int a) {
    const int at = 2 * (z * Guide::kAzimuth + a), above = at + Guide::kAzimuth;
    return bins[size_t(at)] + bins[size_t(at + 1)] + bins[size_t(above)] + bins[size_t(above + 1)];
  };
  Bins blurred;
  for (int z = 0; z < kRows; ++z) {
    for (int a = 0; a < kColumns; ++a) {
      const double around = sum(z, (a + kColumns - 1) % kColumns) + sum(z, (a + 1) % kColumns);
      const double beside = sum(std::max(z - 1, 0), a) + sum(std::min(z + 1, kRows - 1), a);
      for (int i : {0, 1, Guide::kAzimuth, Guide::kAzimuth + 1})
        blurred[size_t(2 * (z * Guide::kAzimuth + a) + i)] = 4 * sum(z, a) + around + beside;
    }
  }
  bins = blurred;
}

// Blurs bins with their neighbours where few records have filled them, the farther the fewer, or noise would be taken for
// light.
void soften(Bins& bins, Bins counts) {
  Bins blurred = bins;
  std::array<bool, Guide::kBins> done;
  for (size_t i = 0; i < done.size(); ++i) done[i] = counts[i] >= kClear;
  for (int step = 0; step < kBlurs; ++step) {
    blurred = blur(blurred), counts = blur(counts);
    for (size_t i = 0; i < done.size(); ++i) {
      blurred[i] *= 0.125;
      if (!done[i]) bins[i] = blurred[i];
      done[i] |= counts[i] >= kClear;
    }
  }
}

// Blends bins that `count` records have filled with kEven records from everywhere.
void even_out(double count, Bins& bins) {
  const double total = std::accumulate(bins.begin(), bins.end(), 0.0);
  for (double& b : bins) b = (total > 0 ? b / total * count : 0.0) + kEven / Guide::kBins;
}

// Returns a grid over the positions of records, surfaces' or media's, and sets `extent` to its sizes. Media that fill the
// world have no bounds: of their records all but a sixty-fourth at each end of an axis are within the grid, and cells at its
// sides have the rest.
Guide::Grid grid_of(const std::vector<Record>& records, bool in_media, float (&extent)[3]) {
  Guide::Grid grid;
  std::vector<float> at;
  for (int k = 0; k < 3; ++k) {
    at.clear();
    for (const Record& r : records)
      if ((r.side == Guide::kInside) == in_media) at.push_back(r.p[k]);
    float low = kInfinity, high = -kInfinity;
    if (in_media) {
      const size_t left_out = at.size() / 64;
      std::sort(at.begin(), at.end());
      if (!at.empty()) low = at[left_out], high = at[at.size() - 1 - left_out];
    } else {
      for (const float x : at) low = std::min(low, x), high = std::max(high, x);
    }
    extent[k] = std::max(high - low, 1e-20f);
    grid.low[k] = low, grid.cells_per_unit[k] = Guide::kGrid / extent[k];
  }
  const float radius = Guide::kRadius * std::max({extent[0], extent[1], extent[2]});
  for (int k = 0; k < 3; ++k) grid.radii_per_block[k] = extent[k] * (float(Guide::kBlock) / Guide::kGrid) / radius;
  return grid;
}

// Sums of what learning paths found in cells, or in regions of them. Values are in units of 2^-kUnitBits of the first pass's
// mean.
constexpr int kUnitBits = 20, kPathBits = 8, kSquareShift = 10;
constexpr double kMostUnits = 0x1p30;

struct CellSums {
  static constexpr int kMostLit = 0xffff;
  std::array<int64_t, Guide::kBins> bins{};
  std::array<uint16_t, Guide::kBins> lit{};  // records with light, kMostLit at most
  int64_t count = 0, paths = 0, squares = 0;

  void operator+=(const CellSums& other) {
    for (size_t i = 0; i < bins.size(); ++i) {
      bins[i] += other.bins[i];
      lit[i] = uint16_t(std::min(int(lit[i]) + int(other.lit[i]), kMostLit));
    }
    count += other.count, paths += other.paths, squares += other.squares;
  }
  int64_t value() const { return std::accumulate(bins.begin(), bins.end(), int64_t(0)); }
  // Number of records of one value that would be as uncertain.
  double even_count() const {
    const double sum = double(value() >> kSquareShift);
    return squares > 0 ? sum * sum / double(squares) : 0;
  }
};

bool is_inside(const Record& r) { return r.side == Guide::kInside; }

// Everything that was learnt. The first pass chooses the grids and the unit of values; the mean of what was found before a pass
// limits the values of its records.
class Learnt {
 public:
  double rays = 0;

  bool empty() const { return cells_.empty(); }
  bool has_media() const { return count_[1] > 0; }

  // Begins with the records of the first pass, in the order of its tasks.
  void begin(const std::vector<Found>& first) {
    std::vector<Record> records;
    for (const Found& f : first) records.insert(records.end(), f.records.begin(), f.records.end());
    if (records.empty()) return;
    grids_[0] = grid_of(records, false, extent_[0]), grids_[1] = grid_of(records, true, extent_[1]);
    cell_index_.assign(size_t(Guide::kSides + 1) * kCells, -1);
    tasks_ = int(first.size());
    for (const Found& f : first) count_pass({total_of(f)});
    const double mean = (sums_[0] + sums_[1]) / double(count_[0] + count_[1]);
    unit_ = mean > 0 ? mean * std::exp2(-kUnitBits) : 1;
    set_limits();
    for (const Found& f : first) add(f.records);
  }
  // Adds a later pass: `run(i)` returns what task i finds. Threads add in any order.
  template <class Run, class Each>
  void add_pass(int first, int tasks, bool in_media, Run run, Each each) {
    std::vector<Total> totals{size_t(tasks)};
    std::mutex mutex;
    each(0, tasks, [&](int i) {
      Found found = run(first + i);
      if (!in_media) std::erase_if(found.records, is_inside);
      totals[size_t(i)] = total_of(found);
      const std::lock_guard lock(mutex);
      add(found.records);
    });
    tasks_ += tasks;
    count_pass(totals);
    set_limits();
  }

  std::unique_ptr<Guide> build(bool in_media) const;
  void forget_media() {
    for (size_t cell = kCells * Guide::kSides; cell < cell_index_.size(); ++cell) cell_index_[cell] = -1;
    sums_[1] = 0, count_[1] = 0, paths_ -= media_paths_, media_paths_ = 0;
  }

 private:
  static constexpr size_t kCells = size_t(Guide::kGrid) * Guide::kGrid * Guide::kGrid;
  // Sums over a task's records, on surfaces and in media.
  struct Total {
    double sums[2] = {}, paths[2] = {}, rays = 0;
    int64_t count[2] = {};
  };
  static Total total_of(const Found& found) {
    Total t;
    for (const Record& r : found.records)
      t.sums[is_inside(r)] += double(r.value), t.paths[is_inside(r)] += double(r.paths), ++t.count[is_inside(r)];
    t.rays = found.rays;
    return t;
  }
  void count_pass(const std::vector<Total>& totals) {
    for (const Total& t : totals) {
      for (int k = 0; k < 2; ++k) sums_[k] += t.sums[k], count_[k] += t.count[k];
      paths_ += t.paths[0] + t.paths[1], media_paths_ += t.paths[1], rays += t.rays;
    }
  }
  void set_limits() {
    for (int k = 0; k < 2; ++k) most_[k] = count_[k] > 0 ? kMostOfMean * sums_[k] / double(count_[k]) / unit_ : 0;
  }
  void add(const std::vector<Record>& records) {
    for (const Record& r : records) {
      int32_t& at = cell_index_[size_t(Guide::cell_of<1>(grids_[is_inside(r)], vint<1>(r.side), vector_of(r.p))[0])];
      if (at < 0) at = int32_t(cells_.size()), cells_.emplace_back();
      CellSums& cell = cells_[size_t(at)];
      const double units = std::min({double(r.value) / unit_, most_[is_inside(r)], kMostUnits});
      const auto value = int64_t(units);
      const auto bin = size_t(bin_of(r, grids_[is_inside(r)]));
      cell.bins[bin] += value, ++cell.count;
      if (value > 0 && cell.lit[bin] < CellSums::kMostLit) ++cell.lit[bin];
      cell.paths += int64_t(std::lrint(double(r.paths) * (1 << kPathBits)));
      cell.squares += (value >> kSquareShift) * (value >> kSquareShift);
    }
  }

  Guide::Grid grids_[2] = {};  // of surfaces and of media
  float extent_[2][3] = {};
  int tasks_ = 0;
  double unit_ = 1, most_[2] = {}, sums_[2] = {}, paths_ = 0, media_paths_ = 0;
  int64_t count_[2] = {};
  std::vector<int32_t> cell_index_;  // by orientation and cell; -1: no records
  std::vector<CellSums> cells_;
};

std::unique_ptr<Guide> Learnt::build(bool in_media) const {
  auto guide = std::make_unique<Guide>();
  guide->surfaces = grids_[0], guide->media = grids_[1];
  guide->has_media = in_media && has_media();
  const int sides = guide->has_media ? Guide::kInside + 1 : Guide::kSides;
  const size_t cells = size_t(sides) * kCells;
  guide->region.assign(cells, -1);
  std::vector<int64_t> counts(cells);
  for (size_t i = 0; i < cells; ++i)
    if (cell_index_[i] >= 0) counts[i] = cells_[size_t(cell_index_[i])].count;
  // As in Mueller et al. 2017, regions are halved with the square root of the paths: half of what more paths bring is
  // precision.
  const double more = std::max(1.0, double(tasks_) / kFirstPassesTasks);
  const int enough = int(kEnough * std::sqrt(more));
  Regions regions{counts, extent_[0], enough, *guide};
  for (int side = 0; side < sides; ++side) {
    if (side == Guide::kInside) regions.extent = extent_[1], regions.enough = int(kEnoughInside * std::sqrt(more));
    regions.halve(side, {0, 0, 0}, {Guide::kGrid, Guide::kGrid, Guide::kGrid});
  }
  if (regions.regions == 0) return nullptr;
  guide->share = float(1 - (1 - double(kGuideShare)) * std::pow(more, -kShareGrows));
  std::vector<CellSums> found(size_t(regions.regions));
  const int first_inside =
      guide->has_media ? 1 + *std::max_element(guide->region.begin(), guide->region.begin() + ptrdiff_t(kCells * Guide::kSides))
                       : regions.regions;
  for (size_t i = 0; i < cells; ++i)
    if (cell_index_[i] >= 0 && guide->region[i] >= 0) found[size_t(guide->region[i])] += cells_[size_t(cell_index_[i])];
  const double media_sum = guide->has_media ? sums_[1] / 4 : 0, paths = guide->has_media ? paths_ : paths_ - media_paths_;
  guide->usual = float((sums_[0] + media_sum) / paths / kPi);
  guide->cdf.resize(size_t(regions.regions) * (Guide::kBins + 1));
  guide->received.resize(size_t(regions.regions));
  Bins soft, lit;
  for (int region = 0; region < regions.regions; ++region) {
    const CellSums& of = found[size_t(region)];
    const bool inside = region >= first_inside;
    std::copy(of.bins.begin(), of.bins.end(), soft.begin());
    std::copy(of.lit.begin(), of.lit.end(), lit.begin());
    const double mean = double(of.value()) * unit_ / (double(of.paths) / (1 << kPathBits)) / kPi;
    guide->received[size_t(region)] = float(inside ? mean / 4 : mean);
    if (inside)
      blur_coarsely(soft), even_out(of.even_count(), soft);
    else
      soften(soft, lit);
    double total = 0, run = 0;
    for (double b : soft) total += b;
    float* cdf = &guide->cdf[size_t(region) * (Guide::kBins + 1)];
    for (int i = 0; i < Guide::kBins; ++i) {
      run += total > 0 ? soft[size_t(i)] / total : 1.0 / Guide::kBins;
      cdf[i + 1] = i + 1 == Guide::kBins ? 1.0f : float(run);
    }
  }
  return guide;
}

// Calls f with [first, end), on two threads by turns.
template <class F>
void on_two_threads(int first, int end, F f) {
  const auto half = [&](int begin) {
    const TimeSpan span("paths of the path guide");
    set_float_mode();
    for (int i = begin; i < end; i += 2) f(i);
  };
  std::thread other(half, first + 1);
  half(first);
  other.join();
}

// Error times rays of pairs of pilots, with and without a guide; those without are kept for the next guide.
struct Comparison {
  std::array<std::unique_ptr<Pilot>, kPairs> plain;
  std::array<double, kPairs> with{}, without{};

  void add(const Scene& scene, const IntegratorSettings& settings, TaskFunction task, const Guide& guide, int first, int end) {
    IntegratorSettings guiding = settings;
    guiding.guide = &guide;
    on_two_threads(first, end, [&](int i) {
      const size_t k = size_t(i);
      if (!plain[k]) plain[k] = std::make_unique<Pilot>(scene, settings, task, i);
      const auto guided = std::make_unique<Pilot>(scene, guiding, task, i);
      const Pilot* both[] = {guided.get(), plain[k].get()};
      with[k] = relative_error(*guided, both, kLeftOut) * guided->rays;
      without[k] = relative_error(*plain[k], both, kLeftOut) * plain[k]->rays;
    });
  }
  // Compares until it is clear whether the guide pays, if it is the `last`; returns ratio().
  double judge(const Scene& scene, const IntegratorSettings& settings, TaskFunction task, const Guide& guide, bool last) {
    with = without = {};
    add(scene, settings, task, guide, 0, 1);
    if (last && ratio() > kSure) add(scene, settings, task, guide, 1, kPairs);
    return ratio();
  }
  // Rays that take a pixel to an error of kTarget, the better of both ways.
  double rays_to_target() const {
    const double pilots = without[kPairs - 1] > 0 ? kPairs : 1;
    const double best =
        std::min(std::accumulate(with.begin(), with.end(), 0.0), std::accumulate(without.begin(), without.end(), 0.0));
    return best / pilots / kTarget / (kTile * kTile);
  }
  // Error times cost of paths with a guide, relative to paths without.
  double ratio() const {
    return kGuidedCost * std::accumulate(with.begin(), with.end(), 0.0) / std::accumulate(without.begin(), without.end(), 0.0);
  }
};

}  // namespace

std::unique_ptr<Guide> learn_guide(const Scene& scene, const IntegratorSettings& asked, TaskFunction task) {
  if (asked.max_depth < 2) return nullptr;
  IntegratorSettings settings = asked;
  if (settings.splits == 0) {
    const Splits chosen = choose_splits(scene, asked, task);
    settings.splits = chosen.paths, settings.light_samples = chosen.lights;
  }
  std::unique_ptr<Guide> guide;
  double cost = 1;  // relative to paths without a guide
  const auto work = [&] {
    const TimeSpan span("learn the path guide");
    set_float_mode();
    Comparison comparison;
    comparison.plain[0] = std::make_unique<Pilot>(scene, settings, task);
    const Pilot* whole[] = {comparison.plain[0].get()};
    const double error = relative_error(*whole[0], whole, kLeftOut);
    if (error < kHard || is_error_of_fibres(*comparison.plain[0])) return;  // hair scatters by its lobes alone
    if (scene.lights.domes.empty()) {
      IntegratorSettings direct = settings;
      direct.max_depth = 1;
      const auto near = std::make_unique<Pilot>(scene, direct, task);
      if (relative_error(*near, whole, kLeftOut) > kMostDirect * error) return;
    }
    Learnt learnt;
    bool in_media = true;  // until it is found not to pay
    const double pixels = double(scene.camera.width) * double(scene.camera.height);
    for (int pass = 0, first = 0, tasks = kFirstTasks; pass < kPasses; ++pass, first += tasks, tasks *= 2) {
      IntegratorSettings guided = settings;
      guided.guide = guide.get();
      const auto run = [&](int i) { return run_task(scene, guided, task, i); };
      if (pass == 0) {
        std::vector<Found> found{size_t(tasks)};
        on_two_threads(0, tasks, [&](int i) { found[size_t(i)] = run(i); });
        learnt.begin(found);
      } else {
        learnt.add_pass(first, tasks, in_media, run, [](int begin, int end, auto f) { on_two_threads(begin, end, f); });
      }
      if (settings.is_cancelled()) {
        cost = 1;
        return;
      }
      guide = learnt.empty() ? nullptr : learnt.build(in_media);
      if (!guide) return;
      const bool decides = pass + 1 >= kFirstPasses;
      cost = comparison.judge(scene, settings, task, *guide, decides);
      if (guide->has_media && (decides || !(cost < kHopeless))) {
        std::unique_ptr<Guide> other = learnt.build(false);  // one on surfaces alone may pay more
        const double without_media = other ? comparison.judge(scene, settings, task, *other, decides) : 1;
        if (without_media < cost) guide = std::move(other), learnt.forget_media(), cost = without_media, in_media = false;
      }
      if (!(cost < kHopeless)) return;
      if (decides && 2 * learnt.rays > kLearningShare * comparison.rays_to_target() * pixels) break;
    }
    if (!(cost < 1)) return;
    guide->alone = settings.caustics && settings.caustics->sharp < kFewSharp;
  };
  std::thread(work).join();
  return cost < 1 ? std::move(guide) : nullptr;
}

}  // namespace primray
