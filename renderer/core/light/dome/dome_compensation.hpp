// MIS compensation of domes: how much of a dome's radiance is left to BSDF-sampled rays.
#pragma once

#include <span>

namespace primray {

// Returns the radiance that is left to BSDF-sampled rays everywhere; light samples go where there is more ("MIS compensation":
// Karlik et al. 2019). Infinity: under a smooth sky light samples are not worth their cost. `luminance`: of rows x columns
// cells in lat-long order, the first row at a pole, with its mean; `solid_angle`: of each row's cells.
double dome_compensation(std::span<const double> luminance, std::span<const double> solid_angle, int columns, double mean);

}  // namespace primray
