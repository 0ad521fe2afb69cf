// Learning of the guide in three passes of paths spread over the frame, each guided by what the previous ones found. Pilots
// decide beforehand whether there is anything to gain, after each pass whether to continue, and at the end whether the guide is
// used.
#include "guiding/pilot/learning.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numeric>
#include <thread>

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
// Tasks of the passes; one is 16 x 16 pixels with 2 x 16 samples.
constexpr int kPasses = 3, kTasks[kPasses] = {4, 8, 16};
// A region is halved while it holds twice as many records; below kFewest it is left to the BSDF.
constexpr int kEnough = 2000, kFewest = 200;
// Upper limit of a record's value relative to the mean: one found by a rare path would outweigh the rest.
constexpr float kMostOfMean = 50;
// Records from everywhere that are added to a region's inside media. The noise of bins is a variance of weights, of which a
// path in dense smoke multiplies many. Error (relMSE) x CPU seconds of 64 x 48 pixels at 16 samples, with 0, 64, 128, 256 of
// them: smoke of optical depth 18 behind a window 0.099, 0.034, 0.027, 0.026 (without a guide inside 0.023); a foggy room
// beyond a door 0.082, 0.089, 0.092, 0.103; one with sun through a window 0.0064, 0.0063, 0.0066, 0.0067.
constexpr double kEven = 128;

struct Record {
  float p[3];
  // Estimate of the radiance from the direction of its bin, on surfaces times the cosine, divided by its sampling density.
  float value;
  float paths;  // number of paths that it represents: others from there ended
  int16_t bin;
  int8_t side;
};

std::vector<Record> run_task(const Scene& scene, IntegratorSettings settings, TaskFunction task, int number) {
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
  std::vector<Record> records;
  for (int slot = 0; slot < Worker::kSlots; ++slot) {
    for (int i = 0; i < log.counts[size_t(slot)]; ++i) {
      const GuideRecord& r = log.records[size_t(slot) * GuideLog::kMost + size_t(i)];
      const float value = r.found * r.cosine / (r.pdf * r.survival);
      if (!std::isfinite(value) || !(r.beta > 0)) continue;
      const vvec3<1> d{vfloat<1>(r.d[0]), vfloat<1>(r.d[1]), vfloat<1>(r.d[2])};
      if (r.in_medium) {
        const int bin = Guide::bin_of<true>(d).number[0];
        records.push_back({{r.p[0], r.p[1], r.p[2]}, value, 1 / r.survival, int16_t(bin), int8_t(Guide::kInside)});
        continue;
      }
      const vvec3<1> n{vfloat<1>(r.n[0]), vfloat<1>(r.n[1]), vfloat<1>(r.n[2])};
      const vint<1> side = Guide::side_of<1>(n);
      const vvec3<1> local = Guide::to_side<1>(side, d);
      // Directions outside the hemisphere only show that the region is known.
      const bool before = local.z[0] > 0;
      const int bin = before ? Guide::bin_of<false>(local).number[0] : 0;
      records.push_back({{r.p[0], r.p[1], r.p[2]}, before ? value : 0.0f, 1 / r.survival, int16_t(bin), int8_t(side[0])});
    }
  }
  return records;
}

// Halves boxes of cells until each holds about as many records.
struct Regions {
  const std::vector<int>& counts;  // by orientation and cell
  const float* extent;
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
    int count = 0;
    each(side, a, b, [&](size_t i) { count += counts[i]; });
    int axis = 0;
    for (int k = 1; k < 3; ++k)
      if (extent[k] * float(b[size_t(k)] - a[size_t(k)]) > extent[axis] * float(b[size_t(axis)] - a[size_t(axis)])) axis = k;
    const size_t k = size_t(axis);
    if (count >= 2 * kEnough && b[k] - a[k] > 1) {
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

// Blurs a bin with its neighbours, or noise would be taken for light.
void soften(const double* bins, double* soft) {
  for (int z = 0; z < Guide::kCosine; ++z) {
    for (int a = 0; a < Guide::kAzimuth; ++a) {
      const int left = (a + Guide::kAzimuth - 1) % Guide::kAzimuth, right = (a + 1) % Guide::kAzimuth;
      const int below = std::max(z - 1, 0), above = std::min(z + 1, Guide::kCosine - 1);
      const auto at = [&](int i, int j) { return bins[i * Guide::kAzimuth + j]; };
      soft[z * Guide::kAzimuth + a] = 4 * at(z, a) + at(z, left) + at(z, right) + at(below, a) + at(above, a);
    }
  }
}

// What was found in a region.
struct Found {
  double paths = 0, sum = 0, squares = 0;
  bool inside = false;

  void add(double value, double of_paths, bool in_medium) {
    paths += of_paths, sum += value, squares += value * value, inside = in_medium;
  }
  // Number of records of one value that would be as uncertain.
  double count() const { return squares > 0 ? sum * sum / squares : 0; }
};

// Blends bins that `count` records have filled with kEven records from everywhere.
void even_out(double count, std::array<double, Guide::kBins>& bins) {
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
  return grid;
}

std::unique_ptr<Guide> build(const std::vector<Record>& records) {
  auto guide = std::make_unique<Guide>();
  float extent[2][3];
  guide->surfaces = grid_of(records, false, extent[0]), guide->media = grid_of(records, true, extent[1]);
  const auto inside = [](const Record& r) { return r.side == Guide::kInside; };
  guide->has_media = std::any_of(records.begin(), records.end(), inside);
  const int sides = guide->has_media ? Guide::kInside + 1 : Guide::kSides;
  const size_t cells = size_t(sides) * Guide::kGrid * Guide::kGrid * Guide::kGrid;
  guide->region.assign(cells, -1);
  std::vector<int> counts(cells), cell_of(records.size());
  double sums[2] = {}, all[2] = {}, all_paths = 0;  // on surfaces, and in media
  for (size_t i = 0; i < records.size(); ++i) {
    const Record& r = records[i];
    const vvec3<1> p{vfloat<1>(r.p[0]), vfloat<1>(r.p[1]), vfloat<1>(r.p[2])};
    cell_of[i] = Guide::cell_of<1>(inside(r) ? guide->media : guide->surfaces, vint<1>(r.side), p)[0];
    ++counts[size_t(cell_of[i])];
    sums[inside(r)] += double(r.value), all[inside(r)] += 1, all_paths += double(r.paths);
  }
  Regions regions{counts, extent[0], *guide};
  for (int side = 0; side < sides; ++side) {
    if (side == Guide::kInside) regions.extent = extent[1];
    regions.halve(side, {0, 0, 0}, {Guide::kGrid, Guide::kGrid, Guide::kGrid});
  }
  if (regions.regions == 0) return nullptr;
  std::vector<double> bins(size_t(regions.regions) * Guide::kBins);
  std::vector<Found> found(size_t(regions.regions));
  for (size_t i = 0; i < records.size(); ++i) {
    const Record& r = records[i];
    const int region = guide->region[size_t(cell_of[i])];
    if (region < 0) continue;
    const double most = kMostOfMean * sums[inside(r)] / all[inside(r)];
    const double value = std::min(double(r.value), most);
    bins[size_t(region) * Guide::kBins + size_t(r.bin)] += value;
    found[size_t(region)].add(value, double(r.paths), inside(r));
  }
  guide->usual = float((sums[0] + sums[1] / 4) / all_paths / kPi);
  guide->cdf.resize(size_t(regions.regions) * (Guide::kBins + 1));
  guide->received.resize(size_t(regions.regions));
  std::array<double, Guide::kBins> soft;
  for (int region = 0; region < regions.regions; ++region) {
    const double* own = &bins[size_t(region) * Guide::kBins];
    const Found& of = found[size_t(region)];
    const double mean = std::accumulate(own, own + Guide::kBins, 0.0) / of.paths / kPi;
    guide->received[size_t(region)] = float(of.inside ? mean / 4 : mean);
    soften(own, soft.data());
    if (of.inside) even_out(of.count(), soft);
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
  // Error times cost of paths with a guide, relative to paths without.
  double ratio() const {
    return kGuidedCost * std::accumulate(with.begin(), with.end(), 0.0) / std::accumulate(without.begin(), without.end(), 0.0);
  }
};

}  // namespace

std::unique_ptr<Guide> learn_guide(const Scene& scene, const IntegratorSettings& settings, TaskFunction task) {
  if (settings.max_depth < 2) return nullptr;
  std::vector<Record> records;
  std::unique_ptr<Guide> guide;
  double cost = 1;  // relative to paths without a guide
  const auto work = [&] {
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
    bool in_media = true;  // until it is found not to pay
    int first = 0;
    for (int pass = 0; pass < kPasses; ++pass) {
      const int tasks = kTasks[pass];
      std::vector<std::vector<Record>> found{size_t(tasks)};
      IntegratorSettings guided = settings;
      guided.guide = guide.get();
      on_two_threads(0, tasks, [&](int i) { found[size_t(i)] = run_task(scene, guided, task, first + i); });
      for (const auto& f : found)
        std::copy_if(f.begin(), f.end(), std::back_inserter(records),
                     [&](const Record& r) { return in_media || r.side != Guide::kInside; });
      guide = records.empty() ? nullptr : build(records);
      const bool last = pass + 1 == kPasses;
      cost = guide ? comparison.judge(scene, settings, task, *guide, last) : 1;
      // One on surfaces alone may pay more.
      if (guide && guide->has_media && (last || !(cost < kHopeless))) {
        std::vector<Record> on_surfaces;
        std::copy_if(records.begin(), records.end(), std::back_inserter(on_surfaces),
                     [](const Record& r) { return r.side != Guide::kInside; });
        std::unique_ptr<Guide> other = on_surfaces.empty() ? nullptr : build(on_surfaces);
        const double without_media = other ? comparison.judge(scene, settings, task, *other, last) : 1;
        if (without_media < cost)
          guide = std::move(other), records = std::move(on_surfaces), cost = without_media, in_media = false;
      }
      if (!(cost < (last ? 1 : kHopeless))) return;
      first += tasks;
    }
    guide->alone = settings.caustics && settings.caustics->sharp < kFewSharp;
  };
  std::thread(work).join();
  return cost < 1 ? std::move(guide) : nullptr;
}

}  // namespace primray
