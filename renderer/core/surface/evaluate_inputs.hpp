// Evaluation of varying surface inputs: reads primvars and textures at W hits and writes rows of the surface table.
//
// Lanes with the same surface are processed together; lanes whose surface has only constants keep the table's row. A shape's
// primvar takes precedence over one of its instance, which is constant at the instance's root ("Primvars on PointInstancer",
// UsdGeomPointInstancer); the fallback is used where neither exists.
#pragma once

#include <optional>

#include "base/flush_denormals.hpp"
#include "bsdf/surface_inputs.hpp"
#include "surface/run_pattern.hpp"
#include "surface/surface_point.hpp"
#include "texture/tiled_lookup.hpp"

namespace primray {

// Smallest squared area of `st` over a triangle for which tangents are computed.
constexpr float kTinyStArea = 1e-20f;

// Whether any surface in lanes `m` has varying inputs.
template <int W>
PRIMRAY_INLINE bool any_inputs(const Scene& scene, vbool<W> m, vint<W> surface) {
  return scene.has_inputs && any(m & (gather<W>(scene.surface_inputs_of.data(), surface) >= vint<W>(0)));
}

// Rows that evaluate_inputs() writes, by column.
template <int W>
struct LaneRows {
  alignas(64) float surface[kSurfaceFields * W];
  alignas(64) float open_pbr[kOpenPbrFields * W];
  alignas(64) float hair[kHairFields * W];
  bool has_surface = false, has_open_pbr = false, has_hair = false;  // some lanes have been written
};

// Writes columns in lanes `m`, or in all lanes if none has been written: what is there is then undefined.
template <int kFields, int W>
PRIMRAY_INLINE void put_columns(const vfloat<W> (&values)[kFields], vbool<W> m, float (&columns)[kFields * W], bool& written) {
  for (int f = 0; f < kFields; ++f) {
    float* const at = columns + f * W;
    store(at, written ? select(m, values[f], load<W>(at)) : values[f]);
  }
  written = true;
}
template <int kFields, int W>
PRIMRAY_INLINE void copy_columns(const LobeRows<W>& rows, float (&columns)[kFields * W], bool& written) {
  for (int f = 0; f < kFields; ++f) store(columns + f * W, rows(f));
  written = true;
}

// Copies the table's rows of lanes `m`, whose surfaces have only constants.
template <int W>
PRIMRAY_RARE void copy_constants(const SurfaceTable& table, vbool<W> m, vint<W> surface, LaneRows<W>& out) {
  const SurfaceRows<W> rows(table, surface, m);
  copy_columns<kSurfaceFields>(rows, out.surface, out.has_surface);
  const auto with = [&](SurfaceFlag flag) { return m & ((rows.flags() & vint<W>(flag)) != vint<W>(0)); };
  if (const vbool<W> open = with(kOpenPbr); any(open))
    copy_columns<kOpenPbrFields>(rows.open_pbr_rows(open), out.open_pbr, out.has_open_pbr);
  if (const vbool<W> hair = with(kHair); any(hair)) copy_columns<kHairFields>(rows.hair_rows(hair), out.hair, out.has_hair);
}

// Offsets of primvar values for lanes on curves: of two values, or of a segment's four control points.
template <int W>
struct CurveValues {
  vbool<W> is, cubic;
  vint<W> row[4];

  PRIMRAY_RARE CurveValues(const Scene& scene, const CurvePlace<W>& place, vbool<W> point, vbool<W> corner) : is(place.is) {
    using I = vint<W>;
    const CurveTable& table = scene.curves;
    const I zero(0), set = select(is, place.row - I(int32_t(table.first_row)), zero);
    const I segment = (gather<W>(table.first_point.data(), place.segment) - gather<W>(table.set_point.data(), set)) >> 2;
    const I curve = gather<W>(table.curve.data(), gather<W>(table.run.data(), place.segment));
    const I first = segment * I(3) + curve, end = segment + curve;
    cubic = is & point;
    for (int k = 0; k < 4; ++k) row[k] = select(point, first + I(k), select(corner, end + I(k == 0 ? 0 : 1), curve));
  }
  // Interpolates values given as differences from the first.
  PRIMRAY_INLINE vfloat<W> mix(vfloat<W> u, vfloat<W> second, vfloat<W> third, vfloat<W> fourth) const {
    const vfloat<W> v = 1.0f - u;
    return select(cubic, second * (3.0f * u * v * v) + third * (3.0f * u * u * v) + fourth * (u * u * u), second * u);
  }
};

// One primvar at W points: offsets of its values at the three corners, equal if it is constant over the triangle; a fourth if
// some lanes are on curves.
template <int W>
struct PrimvarLanes {
  vbool<W> present;
  vint<W> at[4], width;
  bool varies;
  std::optional<CurveValues<W>> curve;

  PRIMRAY_INLINE PrimvarLanes(const Scene& scene, vbool<W> active, const SurfacePoint<W>& p, int name) {
    using I = vint<W>;
    const PrimvarTable& t = scene.primvars;
    const I zero(0), names(t.names), none(-1);
    I primvar = none;
    if (name >= 0) {
      const I n(name);
      const auto look = [&](const std::vector<int32_t>& of, vbool<W> lanes, I owner) {
        if (of.empty() || !any(lanes)) return;
        const I found = gather<W>(of.data(), select(lanes, owner * names + n, zero));
        primvar = select(lanes & (found >= zero), found, primvar);
      };
      look(t.of_mesh, active & p.is_triangle, p.mesh);
      look(t.of_curved, active & !p.is_triangle, p.curved);
      look(t.of_placement, active & p.instanced & !(primvar >= zero), p.placement);
    }
    present = primvar >= zero;
    varies = false;
    width = I(1), at[0] = at[1] = at[2] = zero;
    if (!any(present)) return;
    primvar = select(present, primvar, zero);
    const I kind = select(present, gather<W>(t.kind.data(), primvar), zero);
    const auto is = [&](PrimvarKind k) { return kind == I(int32_t(k)); };
    width = gather<W>(t.width.data(), primvar);
    const I base = select(present, gather<W>(t.base.data(), primvar), zero);
    I face = zero, first_vertex = zero;
    if (any(p.is_triangle)) {
      face = p.triangle - gather<W>(scene.meshes.triangle_base.data(), p.mesh);
      first_vertex = gather<W>(scene.meshes.vertex_base.data(), p.mesh);
    }
    const vbool<W> point = is(PrimvarKind::kPoint), corner = is(PrimvarKind::kCorner);
    const I whole = select(is(PrimvarKind::kFace), face, select(is(PrimvarKind::kInstance), p.instance_row, zero));
    for (int k = 0; k < 3; ++k) {
      const I row = select(point, p.corner[k] - first_vertex, select(corner, face * I(3) + I(k), whole));
      at[k] = base + row * width;
    }
    varies = any(point | corner);
    if (!p.curve.any_is) return;
    const vbool<W> own = is(PrimvarKind::kFace) | point | corner;
    curve.emplace(scene, p.curve, point, corner);
    curve->is &= own;
    for (int k = 0; k < 4; ++k) at[k] = select(curve->is, base + curve->row[k] * width, at[k < 3 ? k : 0]);
  }
  // Component `c`, or the last one there is, at corner k.
  PRIMRAY_INLINE vfloat<W> component(const Scene& scene, int c, int k) const {
    return gather<W>(scene.primvars.values.data(), at[k] + min(vint<W>(c), width - vint<W>(1)));
  }
  PRIMRAY_INLINE vfloat<W> interpolate(const Scene& scene, const SurfacePoint<W>& p, int c, float fallback) const {
    if (!any(present)) return vfloat<W>(fallback);
    vfloat<W> r = component(scene, c, 0);
    // Interpolates differences, so that equal corners give exactly their value, whatever the other lanes hold.
    if (!varies) return select(present, r, fallback);
    const vfloat<W> second = component(scene, c, 1) - r, third = component(scene, c, 2) - r;
    vfloat<W> more = second * p.u + third * p.v;
    if (curve) more = select(curve->is, curve->mix(p.u, second, third, component(scene, c, 3) - r), more);
    r += more;
    return select(present, r, fallback);
  }
};

// A primvar's two components as texture coordinates, and their differences along the triangle's edges.
template <int W>
struct StLanes {
  vfloat<W> s, t, s1, t1, s2, t2;
  StLanes() = default;
  PRIMRAY_INLINE StLanes(const Scene& scene, vbool<W> active, const SurfacePoint<W>& p, int name, const float* fallback) {
    const PrimvarLanes<W> st(scene, active, p, name);
    s = st.interpolate(scene, p, 0, fallback[0]), t = st.interpolate(scene, p, 1, fallback[1]);
    s1 = t1 = s2 = t2 = vfloat<W>(0.0f);
    if (!st.varies) return;  // they vary along curves, but span no area
    const vfloat<W> s0 = st.component(scene, 0, 0), t0 = st.component(scene, 1, 0);
    s1 = st.component(scene, 0, 1) - s0, t1 = st.component(scene, 1, 1) - t0;
    s2 = st.component(scene, 0, 2) - s0, t2 = st.component(scene, 1, 2) - t0;
    if (!st.curve) return;
    for (vfloat<W>* difference : {&s1, &t1, &s2, &t2}) *difference = select(st.curve->is, 0.0f, *difference);
  }
  // Twice the triangle's signed area in (s, t).
  PRIMRAY_INLINE vfloat<W> area2() const { return s1 * t2 - s2 * t1; }
};

// Reads an image by tile, in the lanes `active`.
template <int W>
PRIMRAY_RARE vvec3<W> read_tiles(const TextureImage& image, vbool<W> active, Wrap wrap_s, Wrap wrap_t, vfloat<W> s, vfloat<W> t,
                                 vfloat<W> level) {
  if (image.channels == 1) return vvec3<W>(lookup_tiled<1>(image, active, wrap_s, wrap_t, s, t, level).c[0]);
  const Texels<3, W> r = lookup_tiled<3>(image, active, wrap_s, wrap_t, s, t, level);
  return {r.c[0], r.c[1], r.c[2]};
}

// Reads one image of a texture, at least in the lanes `active`; `footprint`: area in (s, t) to average over.
template <int W>
PRIMRAY_INLINE vvec3<W> read_image(const TextureImage& image, vbool<W> active, Wrap wrap_s, Wrap wrap_t, vfloat<W> s,
                                   vfloat<W> t, vfloat<W> footprint) {
  const vfloat<W> level = 0.5f * coarse_log2(footprint * (float(image.width) * float(image.height)));
  if (image.tiles) [[unlikely]]
    return read_tiles(image, active, wrap_s, wrap_t, s, t, level);
  if (image.channels == 1) return vvec3<W>(lookup<1>(image, wrap_s, wrap_t, s, t, level).c[0]);
  const Texels<3, W> r = lookup<3>(image, wrap_s, wrap_t, s, t, level);
  return {r.c[0], r.c[1], r.c[2]};
}

template <int W>
PRIMRAY_INLINE vvec3<W> broadcast(const float* c) {
  return {vfloat<W>(c[0]), vfloat<W>(c[1]), vfloat<W>(c[2])};
}

// Selects each lane's tile of a UDIM set: calls read(lanes, image, s and t within the tile) for the lanes that have an image.
template <int W, class Read>
PRIMRAY_INLINE void for_tiles(const Texture& texture, vbool<W> active, vfloat<W> s, vfloat<W> t, const Read& read) {
  using I = vint<W>;
  const I column = floor_to_int(clamp(s, -1.0f, float(kTileColumns))), row = floor_to_int(clamp(t, -1.0f, float(kTileRows)));
  const vbool<W> inside = (column >= I(0)) & (column < I(kTileColumns)) & (row >= I(0)) & (row < I(kTileRows));
  const I tile = select(inside, gather<W>(texture.tiles.data(), select(inside, row * I(kTileColumns) + column, I(0))), I(-1));
  for (vbool<W> left = active & (tile >= I(0)); any(left);) {
    const int image = tile[__builtin_ctz(bits(left))];
    const vbool<W> same = left & (tile == I(image));
    left &= !same;
    read(same, texture.images[image], s - to_float(column), t - to_float(row));
  }
}

// texture(st') scale + bias.
template <int W>
PRIMRAY_INLINE vvec3<W> read_texture(const Scene& scene, vbool<W> active, const InputSource& source, const StLanes<W>& st,
                                     vfloat<W> footprint) {
  using F = vfloat<W>;
  const Texture& texture = scene.textures[source.texture];
  const float* m = source.st_transform;
  const F s = st.s * m[0] + st.t * m[1] + m[2], t = st.s * m[3] + st.t * m[4] + m[5];
  footprint = footprint * __builtin_fabsf(m[0] * m[4] - m[1] * m[3]);
  const vvec3<W> scale = broadcast<W>(source.scale), bias = broadcast<W>(source.bias);
  if (!texture.udim) return read_image(texture.images[0], active, source.wrap_s, source.wrap_t, s, t, footprint) * scale + bias;
  vvec3<W> r = broadcast<W>(source.missing);
  for_tiles(texture, active, s, t, [&](vbool<W> same, const TextureImage& image, F in_s, F in_t) {
    const vvec3<W> c = read_image(image, same, Wrap::kClamp, Wrap::kClamp, in_s, in_t, footprint);
    r = select(same, c * scale + bias, r);
  });
  return r;
}

// Reads inputs of one surface at W points; texture coordinates are read once where inputs share them.
template <int W>
class InputReader {
 public:
  // `footprint`: area on the surface, in world space, over which textures are averaged; 0: finest level.
  PRIMRAY_INLINE InputReader(const Scene& scene, vbool<W> active, const SurfacePoint<W>& point, vfloat<W> footprint)
      : scene_(scene), active_(active), point_(point), footprint_(footprint) {}

  // Runs the tape of `inputs`; must precede reads of its outputs, which `wants(field)` selects. `hits`, `p`, `ns`: see
  // PatternPlace.
  template <class Wants>
  PRIMRAY_INLINE void run_tape(const SurfaceInputs& inputs, const Wants& wants, const Hits<W>* hits = nullptr,
                               const vvec3<W>* p = nullptr, const vvec3<W>* ns = nullptr) {
    if (inputs.tape < 0) return;
    const Tape& tape = scene_.tapes[size_t(inputs.tape)];
    run_pattern<W>({scene_, active_, point_, footprint_, hits, p, ns}, tape, tape_end(inputs, tape, wants), outputs_);
  }

  PRIMRAY_INLINE const StLanes<W>& st(int name, const float* fallback) {
    if (!has_st_ || st_name_ != name || st_fallback_[0] != fallback[0] || st_fallback_[1] != fallback[1]) {
      st_ = StLanes<W>(scene_, active_, point_, name, fallback);
      has_st_ = true, st_name_ = name, st_fallback_[0] = fallback[0], st_fallback_[1] = fallback[1];
    }
    return st_;
  }
  __attribute__((noinline)) vvec3<W> read(const InputSource& source) {
    if (source.output >= 0) return outputs_[source.output];
    if (source.texture >= 0) {
      const StLanes<W>& c = st(source.primvar, source.fallback);
      const vfloat<W> per_area = abs(c.area2()) / max(point_.area2, 1e-30f);
      return read_texture(scene_, active_, source, c, footprint_ * per_area);
    }
    const PrimvarLanes<W> primvar(scene_, active_, point_, source.primvar);
    const auto component = [&](int c) { return primvar.interpolate(scene_, point_, c, source.fallback[c]); };
    return {component(0), component(1), component(2)};
  }

 private:
  const Scene& scene_;
  vbool<W> active_;
  const SurfacePoint<W>& point_;
  vfloat<W> footprint_;
  bool has_st_ = false;
  int st_name_ = -1;
  float st_fallback_[2] = {};
  StLanes<W> st_;
  vvec3<W> outputs_[kMostOutputs];  // of the tape
};

// Applies normal maps: `tangent_normal` in the frame of dp/ds, dp/dt and the shading normal `ns`, with both tangents made
// perpendicular to ns. Mirrored coordinates flip the second tangent; where st does not span the triangle, ns is kept.
template <int W>
PRIMRAY_INLINE vvec3<W> bend_normal(const SurfacePoint<W>& p, const StLanes<W>& st, const vvec3<W>& tangent_normal,
                                    const vvec3<W>& ns) {
  using F = vfloat<W>;
  // p changes by e1 as st changes by (s1, t1), and by e2 as it changes by (s2, t2).
  const F area = st.area2(), sign = copysign(F(1.0f), area);
  const vvec3<W> ds = (p.e1 * st.t2 - p.e2 * st.t1) * sign, dt = (p.e2 * st.s1 - p.e1 * st.s2) * sign;
  vvec3<W> tangent = ds - ns * dot(ns, ds);
  const F length2 = dot(tangent, tangent);
  tangent = tangent * (1.0f / sqrt(max(length2, kLeastNormal)));
  vvec3<W> bitangent = cross(ns, tangent);
  bitangent = bitangent * copysign(F(1.0f), dot(bitangent, dt));
  const vvec3<W> n = tangent * tangent_normal.x + bitangent * tangent_normal.y + ns * tangent_normal.z;
  const F n2 = dot(n, n);
  const vbool<W> good = p.is_triangle & (area * area > F(kTinyStArea)) & (length2 > F(kLeastNormal)) & (n2 > F(1e-12f));
  return select(good, n * (1.0f / sqrt(max(n2, 1e-30f))), ns);
}

template <int W>
PRIMRAY_INLINE vvec3<W> not_negative(const vvec3<W>& c) {
  const auto kept = [](vfloat<W> x) { return clamp(x, kNotNegative.low, kNotNegative.high); };
  return {kept(c.x), kept(c.y), kept(c.z)};
}

// Returns `bent`, a vector in world space, as the shading normal in place of `ns`, unless it has no direction.
template <int W>
PRIMRAY_INLINE vvec3<W> unit_normal(const vvec3<W>& bent, const vvec3<W>& ns) {
  const vfloat<W> size2 = dot(bent, bent);
  const vbool<W> good = (size2 > vfloat<W>(1e-12f)) & (size2 < vfloat<W>(1e30f));
  return select(good, bent * (1.0f / sqrt(select(good, size2, 1.0f))), ns);
}

// Writes rows of OpenPBR surfaces with varying inputs.
template <int W>
PRIMRAY_RARE void put_open_pbr(const SurfaceInput& s, const SurfaceValues<W>& values, const OpenPbrValues<W>& open, vbool<W> m,
                               vfloat<W> (&row)[kSurfaceFields], LaneRows<W>& out) {
  vfloat<W> columns[kOpenPbrFields];
  reduce_open_pbr(open, s.thin, columns);
  reduce_surface(s, values, open, columns, lane_numbers<W>(), row);
  put_columns(columns, m, out.open_pbr, out.has_open_pbr);
}
// Writes rows of hair with varying inputs.
template <int W>
PRIMRAY_RARE void put_hair(const SurfaceInput& s, const SurfaceValues<W>& values, const HairValues<W>& hair, vbool<W> m,
                           vfloat<W> (&row)[kSurfaceFields], LaneRows<W>& out) {
  vfloat<W> columns[kHairFields];
  reduce_hair(hair, columns);
  reduce_surface(s, values, hair, lane_numbers<W>(), row);
  put_columns(columns, m, out.hair, out.has_hair);
}

// Returns the surface rows at the hits `h`, at points `p`, and bends the normals `ns` by normal maps. `footprint`: see
// InputReader.
template <int W>
__attribute__((noinline)) SurfaceRows<W> evaluate_inputs(const Scene& scene, vbool<W> active, const Hits<W>& h, vint<W> surface,
                                                         vfloat<W> footprint, const vvec3<W>& p, const vvec3<W>& ng,
                                                         vvec3<W>& ns, LaneRows<W>& out) {
  using I = vint<W>;
  const SurfacePoint<W> point(scene, active, h);
  const I number = gather<W>(scene.surface_inputs_of.data(), surface);
  if (const vbool<W> constant = active & !(number >= I(0)); any(constant))
    copy_constants(scene.surfaces, constant, surface, out);
  for (vbool<W> left = active & (number >= I(0)); any(left);) {
    const int k = number[__builtin_ctz(bits(left))];
    const vbool<W> same = left & (number == I(k));
    left &= !same;
    const SurfaceInputs& inputs = scene.surface_inputs[k];
    SurfaceValues<W> values(inputs.constants);
    std::optional<OpenPbrValues<W>> open;
    if (inputs.constants.open_pbr) open.emplace(*inputs.constants.open_pbr);
    std::optional<HairValues<W>> hair;
    if (inputs.constants.hair) hair.emplace(*inputs.constants.hair);
    InputReader<W> reader(scene, same, point, footprint);
    const auto wants = [&](InputField f) { return f != InputField::kOpacity || !(inputs.constants.opacity_threshold > 0); };
    reader.run_tape(inputs, wants, &h, &p, &ns);
    for (const InputSource& source : inputs.sources) {
      if (!wants(source.field)) continue;  // decided by the filter
      const vvec3<W> x = reader.read(source);
      if (source.field == InputField::kNormal) {
        const vvec3<W> n =
            source.output >= 0 ? unit_normal(x, ns) : bend_normal(point, reader.st(source.tangents, source.fallback), x, ns);
        // A vector that points into the surface is not a valid normal.
        ns = select(same & (dot(n, ng) > vfloat<W>(0.0f)), n, ns);
      } else if (source.field >= InputField::kOpenPbr) {
        if (open) open->set(source.field, x);
        if (hair) hair->set(source.field, x);
      } else {
        values.set(source.field, x);
      }
    }
    vfloat<W> row[kSurfaceFields];
    if (open) {
      put_open_pbr(inputs.constants, values, *open, same, row, out);
    } else if (hair) {
      put_hair(inputs.constants, values, *hair, same, row, out);
    } else {
      reduce_surface(inputs.constants, values, row);
    }
    put_columns(row, same, out.surface, out.has_surface);
  }
  return SurfaceRows<W>::by_column(out.surface, out.open_pbr, out.hair);
}

}  // namespace primray
