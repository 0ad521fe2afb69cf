// Evaluation of displacer.hpp.
#include "displacement/displacer.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "surface/evaluate_inputs.hpp"
#include "texture/mip_pyramid.hpp"

namespace primray {
namespace {

constexpr int kLanes = PRIMRAY_MAX_LANES;
constexpr size_t kSpare = 16;  // padding that gathers may read

int32_t surface_of(const DisplacedShape& shape, int32_t face) {
  return std::max(shape.surfaces[shape.surfaces.size() == 1 ? 0 : size_t(face)], 0);
}

}  // namespace

Displacer::Displacer() {
  Group group;
  scene_.groups.push_back(std::move(group));
}

int Displacer::add_tape(Tape tape) {
  tape.is_placed = tape.asks_place();
  scene_.tapes.push_back(std::move(tape));
  return int(scene_.tapes.size()) - 1;
}

int32_t Displacer::add_surface(const SurfaceInput& constants, std::vector<InputSource> varying, int tape) {
  scene_.surface_inputs_of.push_back(varying.empty() ? -1 : int32_t(scene_.surface_inputs.size()));
  if (!varying.empty()) scene_.surface_inputs.push_back({constants, std::move(varying), tape});
  return int32_t(scene_.surface_inputs_of.size()) - 1;
}

int Displacer::add_texture(int channels, bool udim) {
  Texture t;
  t.channels = channels, t.udim = udim;
  scene_.textures.push_back(std::move(t));
  return int(scene_.textures.size()) - 1;
}

// Keeps all levels: no footprint is known before the vertices have their final positions.
void Displacer::set_texture_image(int texture, int tile, std::span<const float> pixels, int width, int height) {
  Texture& t = scene_.textures.at(size_t(texture));
  if (t.udim) {
    const int number = tile - kFirstTile;
    if (number < 0 || number >= int(t.tiles.size())) throw Error("internal", "the texture has no such UDIM tile");
    t.tiles[size_t(number)] = int32_t(t.images.size());
  }
  t.images.push_back(make_image(pixels, width, height, t.channels, 0, false));
}

void Displacer::displace(const DisplacedShape& shape, const subdivision::CornerRows& rows, std::span<float> out) {
  const std::scoped_lock lock(one_at_a_time_);
  place_triangles(shape, rows);
  put_primvars(shape, rows);
  evaluate(shape, rows, out);
}

// Builds a triangle for each corner, in a group placed like the shape, with its orientation.
void Displacer::place_triangles(const DisplacedShape& shape, const subdivision::CornerRows& rows) {
  const size_t n = rows.faces.size();
  const daffine& m = shape.world_from_object;
  const daffine turned{m.x, m.y, m.z, dvec3(0.0)};
  const bool mirrored = m.determinant() < 0;
  const dvec3 across[3] = {cross(m.y, m.z), cross(m.z, m.x), cross(m.x, m.y)};  // of normals
  scene_.origin = m.o, scene_.scale = 1;
  scene_.object_spaces = {};
  scene_.object_spaces.put(0, turned);
  scene_.positions.assign(9 * n + kSpare, 0.0f), scene_.normals.assign(9 * n + kSpare, 0.0f);
  scene_.indices.assign(3 * n + kSpare, 0u), scene_.triangle_mesh.resize(n);
  for (size_t i = 0; i < n; ++i) {
    for (size_t k = 0; k < 3; ++k) {
      const float* p = &rows.points[9 * i + 3 * (mirrored && k ? 3 - k : k)];
      const dvec3 at = turned.vector({p[0], p[1], p[2]});
      float* to = &scene_.positions[9 * i + 3 * k];
      to[0] = float(at.x), to[1] = float(at.y), to[2] = float(at.z);
      scene_.indices[3 * i + k] = uint32_t(3 * i + k);
    }
    const float* own = &rows.normals[3 * i];
    dvec3 normal = across[0] * double(own[0]) + across[1] * double(own[1]) + across[2] * double(own[2]);
    const double l = length(normal) * (mirrored ? -1 : 1);
    normal = l != 0 ? normal * (1 / l) : dvec3(0, 0, 1);
    for (size_t k = 0; k < 3; ++k) {
      float* to = &scene_.normals[9 * i + 3 * k];
      to[0] = float(normal.x), to[1] = float(normal.y), to[2] = float(normal.z);
    }
    scene_.triangle_mesh[i] = surface_of(shape, rows.faces[i]);
  }
  MeshTable& t = scene_.meshes;
  const size_t surfaces = scene_.surface_inputs_of.size();
  t.surface.resize(surfaces);
  for (size_t s = 0; s < surfaces; ++s) t.surface[s] = int32_t(s);
  t.normals.assign(surfaces, int32_t(Attribute::kCorner)), t.colors.assign(surfaces, int32_t(Attribute::kNone));
  for (std::vector<int32_t>* zeros : {&t.normal_base, &t.color_base, &t.triangle_base, &t.vertex_base})
    zeros->assign(surfaces, 0);
}

void Displacer::put_primvars(const DisplacedShape& shape, const subdivision::CornerRows& rows) {
  using Kind = CagePrimvar::Kind;
  const size_t n = rows.faces.size(), surfaces = scene_.surface_inputs_of.size();
  const bool mirrored = shape.world_from_object.determinant() < 0;
  PrimvarTable& t = scene_.primvars;
  t.values.clear(), t.kind.clear(), t.width.clear(), t.base.clear();
  t.of_mesh.assign(surfaces * size_t(t.names), -1);
  for (const CagePrimvar& p : shape.primvars) {
    const size_t width = size_t(p.width), first = t.values.size();
    const auto put = [&](const float* row) { t.values.insert(t.values.end(), row, row + width); };
    PrimvarKind kind = PrimvarKind::kCorner;
    if (p.kind == Kind::kConstant) {
      kind = PrimvarKind::kConstant;
      put(p.values.data());
    } else if (p.kind == Kind::kFace) {
      kind = PrimvarKind::kFace;
      for (size_t i = 0; i < n; ++i) put(&p.values[size_t(rows.faces[i]) * width]);
    } else {
      const bool by_corner = p.kind == Kind::kFaceVarying;
      const std::span<const float> values = by_corner                 ? rows.channel_values[size_t(p.at)]
                                            : p.kind == Kind::kVertex ? rows.vertex_values
                                                                      : rows.varying_values;
      const std::span<const int32_t> which = by_corner ? rows.channels[size_t(p.at)] : rows.vertices;
      const size_t column = by_corner ? 0 : size_t(p.at);
      for (size_t i = 0; i < n; ++i)
        for (size_t k = 0; k < 3; ++k)
          put(&values[size_t(which[3 * i + (mirrored && k ? 3 - k : k)]) * size_t(p.row_width) + column]);
    }
    const int32_t number = t.add(kind, p.width, int32_t(first));
    for (size_t s = 0; s < surfaces; ++s) t.of_mesh[s * size_t(t.names) + size_t(p.name)] = number;
  }
  t.values.resize(t.values.size() + kSpare, 0.0f);
}

void Displacer::evaluate(const DisplacedShape& shape, const subdivision::CornerRows& rows, std::span<float> out) const {
  constexpr int W = kLanes;
  using F = vfloat<W>;
  using I = vint<W>;
  const int n = int(rows.faces.size());
  const float areas = float(std::pow(std::fabs(shape.world_from_object.determinant()), 2.0 / 3));
  for (int first = 0; first < n; first += W) {
    const I number = I(first) + lane_numbers<W>();
    const vbool<W> active = number < I(n);
    SurfacePoint<W> point(scene_, active, number, I(0), I(-1), I(0), F(0.0f), F(0.0f));
    vvec3<W> at[3];
    VertexMotion<W> still;
    gather_positions(scene_, point.corner, still, at);
    point.e1 = at[1] - at[0], point.e2 = at[2] - at[0], point.area2 = length(cross(point.e1, point.e2));
    F length_on = F(0.0f);
    for (int i = 0; i < W && first + i < n; ++i) length_on.set(i, rows.footprints[size_t(first + i)]);
    const I surface = select(active, gather<W>(scene_.triangle_mesh.data(), select(active, number, I(0))), I(0));
    const I inputs_of = gather<W>(scene_.surface_inputs_of.data(), surface);
    for (vbool<W> left = active & (inputs_of >= I(0)); any(left);) {
      const int k = inputs_of[__builtin_ctz(bits(left))];
      const vbool<W> same = left & (inputs_of == I(k));
      left &= !same;
      const SurfaceInputs& inputs = scene_.surface_inputs[size_t(k)];
      InputReader<W> reader(scene_, same, point, length_on * length_on * areas);
      reader.run_tape(inputs, [](InputField) { return true; });
      const vvec3<W> x = reader.read(inputs.sources[0]);
      for (uint32_t b = bits(same); b; b &= b - 1) {
        const int i = __builtin_ctz(b);
        const float v[3] = {x.x[i], x.y[i], x.z[i]};
        float* to = &out[size_t(first + i) * subdivision::kMovedNumbers];
        if (!std::isfinite(v[0] + v[1] + v[2])) continue;
        const DisplacedAlong along = along_[size_t(surface[i])];
        if (along == DisplacedAlong::kNormal)
          to[2] = v[0];
        else if (along != DisplacedAlong::kNothing)
          std::copy_n(v, 3, to + (along == DisplacedAlong::kTangents ? 0 : 3));
      }
    }
  }
}

}  // namespace primray
