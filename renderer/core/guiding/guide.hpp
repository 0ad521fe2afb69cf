// Path guiding: where light comes from, learnt before the render. For each region of space and orientation of surfaces a
// histogram over a hemisphere of directions, from which scattered rays are sampled beside the BSDF; and for each region of
// participating media one over the whole sphere, beside the phase function. It is only a density: whatever was learnt, the
// image is unbiased.
//
// After Mueller, Gross and Novak 2017, "Practical Path Guiding", with simpler tables: regions are boxes of cells of a grid over
// the vertices of the learning paths, halved until each holds few records; directions fall into fixed bins, by the cosine to
// the orientation's axis and by an azimuth along the diamond |x| + |y| = 1, which needs no arc tangent.
//
// On surfaces directions are parallax-aware (after Ruppert, Herholz and Lensch 2020, "Robust Fitting of Parallax-Aware Mixtures
// for Path Guiding"): what counts is the direction from the middle of a block of cells to the point that a ray reaches on a
// sphere about it. So what was learnt anywhere in a block is aimed at from each of its points.
#pragma once

#include <cstdint>
#include <vector>

#include "math/transcendental.hpp"
#include "math/vec3.hpp"

namespace primray {

// Probability of sampling a scattered ray from a guide of little learning, where it is valid; in media at most.
constexpr float kGuideShare = 0.5f;

// Location of points in the guide: the region, or -1, and the orientation, and the probability of sampling from the guide where
// the BSDF has chosen its diffuse lobe. Regions are of hemispheres on surfaces.
template <int W, bool kInMedium = false>
struct GuideLocation {
  vint<W> region, side;
  float share = kGuideShare;
  vvec3<W> aside;     // from the middle of the block, in radii of its sphere
  vfloat<W> diffuse;  // probability of the diffuse lobe
};
// Inside media regions are of spheres, and the share depends on the phase function.
template <int W>
struct GuideLocation<W, true> {
  vint<W> region;
  vfloat<W> share;
};

struct Guide {
  static constexpr int kGrid = 16, kSides = 6;  // cells along each axis; orientations by the normal's largest component
  static constexpr int kInside = kSides;        // in their place inside media, where the axis is that of the last two
  static constexpr int kCosine = 16, kAzimuthBits = 6, kAzimuth = 1 << kAzimuthBits, kBins = kCosine * kAzimuth;
  // Cells of a block along each axis, and the radius of its sphere as a part of the grid's largest extent. Directions in ajar
  // and window of the benchmark, cross entropy of what is found from the first vertex: blocks of 4, a radius of a half 1.153,
  // 0.893; of 1 1.167, 0.899; of a quarter 1.154, 0.938; blocks of 2 1.154, 0.909; of 8 1.166, 0.922; without 1.174, 0.937.
  static constexpr int kBlock = 4;
  static constexpr float kRadius = 0.5f;

  struct Grid {
    float low[3], cells_per_unit[3];
    float radii_per_block[3];  // size of a block in radii of its sphere
  };
  Grid surfaces, media;
  bool has_media = false;       // `region` has cells for kInside
  std::vector<int32_t> region;  // by orientation and cell; -1 where too little is known
  std::vector<float> cdf;       // kBins + 1 per region, from 0 to 1
  std::vector<float> received;  // by region: mean of the radiance, on surfaces from the hemisphere and weighted by the cosine
  float usual = 0;              // mean over all regions
  float share = kGuideShare;    // on surfaces
  bool alone = false;           // caustic photons are not worth their time beside this guide
  int64_t memory_bytes() const { return int64_t(4 * (region.size() + cdf.size() + received.size())); }

  template <int W>
  static PRIMRAY_INLINE vint<W> side_of(const vvec3<W>& n) {
    const vvec3<W> a = abs(n);
    const vbool<W> by_x = (a.x >= a.y) & (a.x >= a.z), by_y = a.y >= a.z;
    const vint<W> axis = select(by_x, vint<W>(0), select(by_y, vint<W>(1), vint<W>(2)));
    const vfloat<W> largest = select(by_x, n.x, select(by_y, n.y, n.z));
    return axis * vint<W>(2) + select(largest < vfloat<W>(0.0f), vint<W>(1), vint<W>(0));
  }
  template <int W>
  static PRIMRAY_INLINE vint<W> cell_of(const Grid& grid, vint<W> side, const vvec3<W>& p) {
    const auto cell = [&](vfloat<W> x, int axis) {
      return truncate(clamp((x - grid.low[axis]) * grid.cells_per_unit[axis], 0.0f, kGrid - 0.5f));
    };
    return ((side * vint<W>(kGrid) + cell(p.z, 2)) * vint<W>(kGrid) + cell(p.y, 1)) * vint<W>(kGrid) + cell(p.x, 0);
  }
  // Position in a block, from its middle, in radii of its sphere; none along the orientation's axis, so that a hemisphere stays
  // one. At most 0.36.
  template <int W>
  static PRIMRAY_INLINE vvec3<W> aside_of(const Grid& grid, vint<W> side, const vvec3<W>& p) {
    const auto along = [&](vfloat<W> x, int axis) {
      const vfloat<W> at = clamp((x - grid.low[axis]) * grid.cells_per_unit[axis], 0.0f, kGrid - 0x1p-10f) * (1.0f / kBlock);
      return (at - to_float(truncate(at)) - 0.5f) * grid.radii_per_block[axis];
    };
    const vfloat<W> zero(0.0f);
    const vint<W> axis = side >> 1;
    return {select(axis == vint<W>(0), zero, along(p.x, 0)), select(axis == vint<W>(1), zero, along(p.y, 1)),
            select(axis == vint<W>(2), zero, along(p.z, 2))};
  }
  template <int W>
  PRIMRAY_INLINE GuideLocation<W> place_of(const vvec3<W>& p, const vvec3<W>& n) const {
    const vint<W> side = side_of<W>(n);
    return {gather<W>(region.data(), cell_of(surfaces, side, p)), side, share, aside_of(surfaces, side, p), vfloat<W>(1.0f)};
  }
  // Region of points inside media, or -1.
  template <int W>
  PRIMRAY_INLINE vint<W> region_inside(const vvec3<W>& p) const {
    return has_media ? gather<W>(region.data(), cell_of(media, vint<W>(kInside), p)) : vint<W>(-1);
  }

  // Rotates between world axes and those of an orientation, whose last axis is the orientation's: axes are permuted cyclically,
  // then flipped.
  template <int W>
  static PRIMRAY_INLINE vvec3<W> to_side(vint<W> side, const vvec3<W>& d) {
    const vbool<W> x = side < vint<W>(2), y = side < vint<W>(4);
    const vfloat<W> sign = select((side & vint<W>(1)) != vint<W>(0), vfloat<W>(-1.0f), vfloat<W>(1.0f));
    return {select(x, d.y, select(y, d.z, d.x)), select(x, d.z, select(y, d.x, d.y)),
            sign * select(x, d.x, select(y, d.y, d.z))};
  }
  template <int W>
  static PRIMRAY_INLINE vvec3<W> from_side(vint<W> side, const vvec3<W>& d) {
    const vbool<W> x = side < vint<W>(2), y = side < vint<W>(4);
    const vfloat<W> axis = select((side & vint<W>(1)) != vint<W>(0), -d.z, d.z);
    return {select(x, axis, select(y, d.y, d.x)), select(x, d.x, select(y, axis, d.y)), select(x, d.y, select(y, d.x, axis))};
  }

  // Position of directions in the rows of bins by their cosine to the axis, from 0 to 1, and back; even in solid angle.
  template <bool kInMedium, int W>
  static PRIMRAY_INLINE vfloat<W> height_of(vfloat<W> cosine) {
    if constexpr (kInMedium)
      return 0.5f * cosine + 0.5f;
    else
      return cosine;
  }
  template <bool kInMedium, int W>
  static PRIMRAY_INLINE vfloat<W> cosine_at(vfloat<W> height) {
    if constexpr (kInMedium)
      return 2.0f * height - 1.0f;
    else
      return height;
  }

  // Direction from the middle of a block to where a ray along `d` from a point `aside` meets the block's sphere, and how much
  // denser directions from the middle are there.
  template <int W>
  struct FromMiddle {
    vvec3<W> d;
    vfloat<W> density;
  };
  template <int W>
  static PRIMRAY_INLINE FromMiddle<W> from_middle(const vvec3<W>& aside, const vvec3<W>& d) {
    const vfloat<W> along = dot(aside, d), cosine = sqrt(along * along + (1.0f - dot(aside, aside))), t = cosine - along;
    return {aside + d * t, t * t / cosine};
  }

  // Bin of direction `d` in an orientation's axes (valid where d.z > 0, or inside media), and the density per solid angle of
  // choosing a bin and a direction in it uniformly.
  template <int W>
  struct Bin {
    vint<W> number;
    vfloat<W> density;
  };
  template <bool kInMedium, int W>
  static PRIMRAY_INLINE Bin<W> bin_of(const vvec3<W>& d) {
    const vfloat<W> zero(0.0f), x = abs(d.x), y = abs(d.y), sum = max(x + y, 1e-20f), part = y / sum;
    // A full turn is 4: part of a quadrant, forwards or backwards.
    const vfloat<W> around =
        select(d.y >= zero, select(d.x >= zero, part, 2.0f - part), select(d.x < zero, 2.0f + part, 4.0f - part));
    const vint<W> a = truncate(clamp(around * (kAzimuth / 4.0f), 0.0f, kAzimuth - 0.5f));
    const vint<W> c = truncate(clamp(height_of<kInMedium>(d.z) * float(kCosine), 0.0f, kCosine - 0.5f));
    const vfloat<W> rest = 1.0f - part;
    return {c * vint<W>(kAzimuth) + a, (kInMedium ? 0.125f : 0.25f) * (part * part + rest * rest)};
  }

  // Density of directions `d` (world space) per solid angle, in valid regions.
  template <bool kInMedium, int W>
  PRIMRAY_INLINE vfloat<W> pdf(const GuideLocation<W, kInMedium>& at, const vvec3<W>& d) const {
    const auto mass_of = [&](vint<W> bin) {
      const vint<W> i = at.region * vint<W>(kBins + 1) + bin;
      return (gather<W>(cdf.data() + 1, i) - gather<W>(cdf.data(), i)) * float(kBins);
    };
    if constexpr (kInMedium) {
      const Bin<W> bin = bin_of<kInMedium>(d);
      return mass_of(bin.number) * bin.density;
    } else {
      const FromMiddle<W> from = from_middle(at.aside, d);
      const vvec3<W> local = to_side(at.side, from.d);
      const Bin<W> bin = bin_of<kInMedium>(local);
      return select(local.z > vfloat<W>(0.0f), mass_of(bin.number) * bin.density * from.density, vfloat<W>(0.0f));
    }
  }

  // Learnt radiance from directions `d`, in valid regions.
  template <bool kInMedium, int W>
  PRIMRAY_INLINE vfloat<W> radiance(const GuideLocation<W, kInMedium>& at, const vvec3<W>& d) const {
    const vfloat<W> mean = gather<W>(received.data(), at.region);
    if constexpr (kInMedium) {
      return mean * (4 * kPi) * pdf(at, d);
    } else {
      // The pdf is that of radiance times cosine; in the lowest bin the cosine is too small to divide by.
      const vfloat<W> cosine = max(abs(to_side(at.side, d).z), 1.0f / kCosine);
      return mean * kPi * pdf(at, d) / cosine;
    }
  }

  template <bool kInMedium, int W>
  PRIMRAY_INLINE vvec3<W> sample(const GuideLocation<W, kInMedium>& at, vfloat<W> u, vfloat<W> v) const {
    const vint<W> base = at.region * vint<W>(kBins + 1);
    vint<W> bin(0);
    for (int step = kBins / 2; step > 0; step /= 2) {
      const vint<W> next = bin + vint<W>(step);
      bin = select(gather<W>(cdf.data(), base + next) <= u, next, bin);
    }
    const vfloat<W> begin = gather<W>(cdf.data(), base + bin), end = gather<W>(cdf.data() + 1, base + bin);
    const vfloat<W> within = clamp((u - begin) / max(end - begin, 1e-20f), 0.0f, 0x1.fffffep-1f);
    const vint<W> c = bin >> kAzimuthBits, a = bin & vint<W>(kAzimuth - 1);
    const vfloat<W> cosine = cosine_at<kInMedium>((to_float(c) + within) * (1.0f / kCosine));
    const vfloat<W> around = (to_float(a) + v) * (4.0f / kAzimuth);
    // Along the diamond, and out to the circle.
    const vfloat<W> x = abs(around - 2.0f) - 1.0f,
                    y = 1.0f - abs(select(around > vfloat<W>(3.0f), around - 5.0f, around - 1.0f));
    const vfloat<W> ring = sqrt(max(1.0f - cosine * cosine, 0.0f) / (x * x + y * y));
    const vvec3<W> local(x * ring, y * ring, cosine);
    if constexpr (kInMedium)
      return local;
    else
      return normalize(from_side(at.side, local) - at.aside);
  }
};

// Vertex of a learning path: its position, the sampled direction with its density, and that without photons, the survival
// probability, the path's throughput, and the luminance that came back.
struct GuideRecord {
  float p[3], n[3], d[3], pdf, own_pdf, survival, beta, cosine, found;
  int32_t round;
  bool in_medium;  // which has no normal
};

// Records of a task's paths, by slot.
struct GuideLog {
  static constexpr int kMost = 12;  // vertices of a path that are kept
  std::vector<GuideRecord> records;
  std::vector<int32_t> counts;
  int32_t round = 0;
  explicit GuideLog(int slots) : records(size_t(slots) * kMost), counts(size_t(slots)) {}

  void add_vertex(int slot, const GuideRecord& r) {
    if (counts[size_t(slot)] < kMost) records[size_t(slot) * kMost + size_t(counts[size_t(slot)]++)] = r;
  }
  // Adds light that reached a path; it does not count for directions sampled in this round.
  void add_light(int slot, float luminance) {
    GuideRecord* r = &records[size_t(slot) * kMost];
    for (int i = 0; i < counts[size_t(slot)] && r[i].round < round; ++i) r[i].found += luminance / r[i].beta;
  }
};

}  // namespace primray
