// Ear clipping of polygons that are not convex, step by step as primray/tessellation/ear_clip.py does it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "math/vec3.hpp"

namespace primray {

// Appends the n - 2 triangles of a polygon to `triangles`, as indices of its vertices.
void clip_ears(std::span<const dvec3> polygon, std::vector<int32_t>& triangles);

}  // namespace primray
