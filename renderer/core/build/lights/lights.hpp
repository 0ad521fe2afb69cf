// Construction of the LightTable: rows from inputs, and what is derived from all of them (bounds, trees, linking, paths of
// moving lights, outlines in the frame).
#pragma once

#include <vector>

#include "build/inputs/scene_inputs.hpp"
#include "light/light.hpp"
#include "light/light_options.hpp"
#include "math/row.hpp"
#include "scene/emitter_table.hpp"
#include "scene/light_outline_table.hpp"
#include "scene/scene.hpp"

namespace primray {

// Shapes with UsdLux LightAPI: their radiance in each placement, and the tables that rays read.

// World-space area of a light's shape, in scene units, for a placement of its group.
double world_area(const Scene& scene, const GeometryLight& light, const daffine& world_from_group);
// Its radiance in that placement.
vec3 placed_radiance(const Scene& scene, const GeometryLight& light, const daffine& world_from_group);
// Fills the tables that rays read; `first_place`: by light, a matrix of its group. Called after the last shape and placement.
void finish_geometry_lights(Scene& scene, const std::vector<daffine>& first_place);

// Bounds of a light's position and direction: boxes for rays that may hit it, and its bounds in a light tree.

// Box around a light that rays can hit, slightly larger than rounding requires.
LightBox light_box(const float* row);
// Bounds of any light for a tree, including the box; the intensity is in the units of light_importance().
LightBounds light_bounds(const LightTable& table, const float* row);

// Adds a light for each instance of emission in volumes (light/types/volume.hpp); after all others.
void add_volume_lights(Scene& scene);

// Lists the lights that are sampled along camera rays, in scenes with media that scatter; after finish_light_rows().
void find_pivots(Scene& scene);

// Builds light trees for scenes with too many lights to weigh each at every vertex.
void build_light_choice(LightTable& table);

// Finds the outlines of lights in the frame. Requires the finished scene, as it tests visibility of the lights.
LightOutlines find_light_outlines(const Scene& scene);

// Records that the rows and domes that `light` added to the table move: rows from `first_row` on, and domes from `first_dome`
// on.
void add_light_path(const LightInput& light, const dvec3& origin, double scale, int first_row, size_t first_dome,
                    LightTable& table);

// Rules of a light beside its emission: the surfaces it illuminates, its shadow casters, and its visibility to the camera.
//
// Geometry lights (build/emitters/emitters.hpp) have rules as well: call add_light_rules() after the row was added.

// Whether its shadows differ from those of the geometry.
bool is_special(const LightRules& light);
// Adds the rules of the last row.
void add_light_rules(const LightRules& light, double scale, LightTable& table);
// Called after the last row.
void finish_light_rules(LightTable& table);

// Adds an IES profile and returns its index.
int add_ies(const IesInput& profile, IesTable& table);
// Converts a light's shaping to a row of the ShapingTable, and stores its number in the light's `row`, whose other fields are
// set.
void add_shaping(const ShapingInput& shaping, const daffine& world_from_light, float* row, LightTable& table);

// Writes the fields of any light beside its shape and position: its lobe factors.
void put_common_fields(const LightInput& light, LightTable& table, float* row);
void copy_common_fields(const float* from, float* to);
// Adds the row of a light, in the core's space. `image`: of a rectangle light, its index in LightTable::images, or -1;
// `earlier`: of a dome, the one whose image and distributions are taken, or null.
void add_light_rows(const LightInput& light, const dvec3& origin, double scale, LightTable& table, int image = -1,
                    Dome* earlier = nullptr);
// Completes the rows after the last light: what depends on all of them.
void finish_light_rows(LightTable& table);

}  // namespace primray
