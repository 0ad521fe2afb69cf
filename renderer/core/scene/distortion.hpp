// Lens distortion: maps a point of the film to a direction, in double. Film points are in units of the focal length, +y up;
// without distortion they are the camera's window at unit distance.
#pragma once

#include <optional>
#include <vector>

#include "math/vec3.hpp"

namespace primray {

enum class DistortionModel {
  kRational,       // OpenCV's pinhole model: k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4
  kAngleToRadius,  // radius on the film = k0 a + k1 a^3 + k2 a^5 + k3 a^7 + k4 a^9 for the angle a to the axis
  kRadiusToAngle,  // angle to the axis = k0 + k1 r + k2 r^2 + k3 r^3 + k4 r^4 for the radius r on the film
  kTable,          // directions, linear between texels
  // x is the longitude, y the latitude, in radians. k0: distance of two eyes, 0 for one. k1: 0 if their pictures are above each
  // other, 1 if they are side by side, the left eye's first; k2 is half the extent of one of them in that direction. k1 2: one
  // of the eyes alone, the left one if k2 is below 0.
  kLatLong,
  kRays,  // a place and a direction for each texel, the same all over it
  kCube,  // squares of width 1, right and down from (0, 0): +X, -X, +Y, -Y, +Z, -Z; k0: columns
};

// Directions at the centres of texels, the first at the upper left: three floats each, NaN outside the field of view.
struct DirectionTable {
  int columns = 0, rows = 0;
  double left = 0, right = 0, bottom = 0, top = 0;  // extent of the whole table on the film
  std::vector<float> directions;
  std::vector<float> places;  // in camera space, likewise; of kRays

  std::optional<dvec3> at(double x, double y) const;
  // Number of the texel of a film point; of one beyond the table that of the nearest.
  size_t texel(double x, double y) const;
};

struct Distortion {
  static constexpr int kCoefficients = 12;

  DistortionModel model = DistortionModel::kRational;
  double k[kCoefficients] = {};
  double most_angle = 0;   // field of view: largest angle from the axis, in radians
  double most_inside = 0;  // limit up to which the model is one to one: in tangents (rational), radians, or radii on the film
  double most_radius = 0;  // image of that limit on the film
  DirectionTable table;

  // Finds the limit up to which the model is one to one.
  void limit();

  // Whether focus and clipping are by distance: no plane has the whole view of such a lens in front of it.
  bool on_spheres() const { return model != DistortionModel::kRational; }

  // Direction of the film point (x, y): unit length if on_spheres(), otherwise with z = -1. None outside the field of view.
  std::optional<dvec3> direction(double x, double y) const;

  // Whether rays of different film points come from different places: those of two eyes on a circle (Google 2015, "Rendering
  // Omni-directional Stereo Content"), or a table's.
  bool has_eyes() const { return model == DistortionModel::kRays || (model == DistortionModel::kLatLong && k[0] != 0); }
  // Place in camera space from which the film point (x, y) is seen.
  dvec3 eye(double x, double y) const;

  // Film point (x, y, 0) of a direction of any length; none if the lens does not see it, or is a table of rays. With two eyes
  // `d` is a position, and the film point is in the picture in which `near` is. `near`: film point at which the search in a
  // table begins.
  std::optional<dvec3> film_point(const dvec3& d, const dvec3& near) const;

  // Smallest spacing of directions in this window, relative to the film's middle: 1 or less.
  double finest(double left, double right, double bottom, double top) const;

 private:
  struct Angles {
    double longitude, latitude;
    double side;  // of the eye: -1 left, 1 right, 0 one eye
  };
  Angles angles(double x, double y) const;
  std::optional<dvec3> lat_long_point(const dvec3& d, const dvec3& near) const;
  std::optional<dvec3> undistorted(double x, double y) const;
  double radial(double r) const;
  double radial_slope(double r) const;
  double unfolds(double r) const;
  bool is_radial() const { return k[2] == 0 && k[3] == 0 && k[8] == 0 && k[9] == 0 && k[10] == 0 && k[11] == 0; }
  std::optional<double> angle_of(double radius) const;
  std::optional<double> radius_of(double angle) const;
  std::optional<dvec3> searched(const dvec3& d, dvec3 from) const;
};

}  // namespace primray
