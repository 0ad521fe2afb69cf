// Values that a pattern's tape reads at a point: positions, normals, tangents, primvars, spaces, images.
//
// World space is the stage's: origin + p / scale. A shape's object space is reached from its group's space, in which
// coordinates are small wherever the camera looks, by the shape's own matrix (scene/scene.hpp); for a shape in a
// prototype it is the prototype's, whatever the instance. Where a ray hits geometry that is not instanced, the hit point itself
// is used, which on large triangles is more precise than barycentrics (surface/interaction.hpp).
#pragma once

#include "surface/evaluate_inputs.hpp"
#include "surface/interaction.hpp"
#include "surface/run_pattern.hpp"

namespace primray {

// Shortest shift, as a share of the triangle's size, over which derivatives are computed by differences.
constexpr float kLeastShift = 1e-4f;
// Lower limit of a footprint's width to length in an image's coordinates, where these run almost along one line.
constexpr float kThinnestFootprint = 1.0f / 64;

template <int W>
class PatternLeaves {
 public:
  PRIMRAY_INLINE PatternLeaves(const PatternPlace<W>& place, const Tape& tape)
      : place_(place), scene_(place.scene), point_(place.point), tape_(tape) {
    if (!tape.is_placed) return;
    find_edges();
    if (scene_.object_spaces.any()) find_space();
  }

  void operator()(const Instruction& i, vfloat<W>* r) {
    vfloat<W>* out = r + i.out;
    const auto three = [&](const vvec3<W>& v) { out[0] = v.x, out[1] = v.y, out[2] = v.z; };
    switch (i.op) {
      case PatternOp::kPrimvar:
        return primvar(i, r);
      case PatternOp::kPosition: {
        const V p = group_point(i.data % kShiftRange);
        return three(i.data / kShiftRange == 1 ? object_from_group().point(p) : stage_point(p));
      }
      case PatternOp::kNormal:
        return three(normal());
      case PatternOp::kTangent:
        return three(tangents(i.data).first);
      case PatternOp::kBitangent:
        return three(tangents(i.data).second);
      case PatternOp::kView:
        return three(view());
      case PatternOp::kTransform:
        return three(transformed(PatternTransform(i.data), {r[i.in[0]], r[i.in[0] + 1], r[i.in[0] + 2]}));
      case PatternOp::kImage:
        return image(i, r);
      default:
        return;
    }
  }

 private:
  using F = vfloat<W>;
  using I = vint<W>;
  using V = vvec3<W>;

  struct Space {
    AffineLanes<W> m;
    PRIMRAY_INLINE V point(const V& p) const { return m.vector(p) + m.o; }
  };

  // Computes corners and edges in the group's space, and the instance's matrix.
  void find_edges() {
    vvec3<W> at[3];
    VertexMotion<W> motion = point_.motion;
    for (V& a : at) a = V(F(0.0f));
    if (any(point_.is_triangle)) gather_positions(scene_, point_.corner, motion, at);
    p0_ = at[0], e1_ = at[1] - at[0], e2_ = at[2] - at[0];
    any_instanced_ = any(point_.instanced);
    if (any_instanced_) instance_ = instance_matrix();
    if (!all(point_.is_triangle | !place_.active) && place_.hits) {
      const HitGroup<W> in(scene_, place_.active, *place_.hits);
      const CurvedHit<W> curved(scene_, in, place_.active, *place_.hits);
      curved_ = curved.is;
      p0_ = select(curved_, curved.at.p, p0_);
      // Any two tangent directions, since it is large.
      const V n = direction_of(select(curved_, curved.at.normal, V(F(0.0f), F(0.0f), F(1.0f))));
      const Frame<F> frame(n);
      const F size = max_component(curved.at.spread);
      e1_ = select(curved_, frame.s * size, e1_), e2_ = select(curved_, frame.t * size, e2_);
      if (!curved.curve.any_is) return;
      // Along a curve its parameter changes.
      const V across = cross(n, curved.along);
      e1_ = select(curved.curve.is, curved.along, e1_), e2_ = select(curved.curve.is, across, e2_);
    }
  }
  AffineLanes<W> instance_matrix() const {
    if (place_.hits) {
      V rounded;
      return HitGroup<W>(scene_, place_.active, *place_.hits).matrix(scene_, rounded);
    }
    const I first = gather<W>(scene_.placement_instance.data(), point_.placement);
    return AffineLanes<W>(scene_.world_from_group.data(),
                          select(point_.instanced, (first + point_.instance_row) * I(12), I(0)));
  }
  void find_space() {
    const ObjectSpaces& spaces = scene_.object_spaces;
    for (int i = 0; i < W; ++i) {
      const bool triangle = point_.is_triangle[i];
      const std::vector<int32_t>& of = triangle ? spaces.of_mesh : spaces.of_curved;
      const size_t row = size_t(triangle ? point_.mesh[i] : point_.curved[i]);
      space_.set(i, row < of.size() ? of[row] * 12 : 0);
    }
  }
  Space object_from_group() const { return {AffineLanes<W>(scene_.object_spaces.object_from_group.data(), space_)}; }
  Space group_from_object() const { return {AffineLanes<W>(scene_.object_spaces.group_from_object.data(), space_)}; }

  V to_world(const V& v) const { return any_instanced_ ? select(point_.instanced, instance_.vector(v), v) : v; }
  V to_world_point(const V& p) const {
    return any_instanced_ ? select(point_.instanced, instance_.vector(p) + instance_.o, p) : p;
  }
  // Inverse of the instance's linear part, by cofactors.
  V from_world(const V& v) const {
    if (!any_instanced_) return v;
    const F unit = 1.0f / max_component(V(max_component(abs(instance_.x)), max_component(abs(instance_.y)),
                                          max_component(abs(instance_.z))));
    const V x = instance_.x * unit, y = instance_.y * unit, z = instance_.z * unit;
    const F factor = unit / dot(cross(x, y), z);
    const V r{dot(cross(y, z), v) * factor, dot(cross(z, x), v) * factor, dot(cross(x, y), v) * factor};
    return select(point_.instanced, r, v);
  }
  V from_world_point(const V& p) const { return from_world(any_instanced_ ? select(point_.instanced, p - instance_.o, p) : p); }
  V normal_to_world(const V& n) const { return any_instanced_ ? select(point_.instanced, instance_.normal(n), n) : n; }
  V normal_from_world(const V& n) const {
    if (!any_instanced_) return n;
    return select(point_.instanced, V{dot(instance_.x, n), dot(instance_.y, n), dot(instance_.z, n)}, n);
  }

  V stage_point(const V& group) const {
    const V p = to_world_point(group) * float(1 / scene_.scale);
    return V{p.x + float(scene_.origin.x), p.y + float(scene_.origin.y), p.z + float(scene_.origin.z)};
  }

  // Offset of a shifted point, in parts of both edges.
  struct Shift {
    F u{0.0f}, v{0.0f};
  };
  Shift shift(int number) const {
    Shift s;
    if (number == 0) return s;
    const V a = to_world(e1_), b = to_world(e2_);
    const F a2 = max(dot(a, a), 1e-36f), longest = sqrt(max(a2, dot(b, b)));
    const F along = dot(a, b) / a2;
    const V height = b - a * along;
    const F height2 = dot(height, height);
    F step = safe_sqrt(place_.footprint);
    if (number > 2) step = max(step, longest * kLeastShift);
    if (number == 1 || number == 3) {
      s.u = step / sqrt(a2);
    } else {
      s.v = select(height2 > F(1e-36f), step / sqrt(max(height2, 1e-36f)), 0.0f);
      s.u = -s.v * along;
    }
    return s;
  }
  V group_point(int number) const {
    V p = select(curved_, p0_, p0_ + e1_ * point_.u + e2_ * point_.v);
    if (place_.p) p = select(point_.instanced, p, *place_.p);
    if (number == 0) return p;
    const Shift s = shift(number);
    return p + e1_ * s.u + e2_ * s.v;
  }

  void primvar(const Instruction& i, F* r) const {
    const PrimvarLanes<W> found(scene_, place_.active, point_, i.data / kShiftRange);
    SurfacePoint<W> moved = point_;
    if (const int number = i.data % kShiftRange; number > 0) {
      const Shift s = shift(number);
      moved.u += s.u, moved.v += s.v;
    }
    for (int c = 0; c < i.width; ++c) {
      const F otherwise = r[i.in[0] + (i.steps & 1) * c];
      F value = found.interpolate(scene_, moved, c, 0.0f);
      // A single number stands for all components; colours with fewer components get a fourth of 1.
      const vbool<W> there = (found.width > I(c)) | (found.width == I(1));
      value = select(there, value, c == 3 ? 1.0f : 0.0f);
      r[i.out + c] = select(found.present, value, otherwise);
    }
  }

  V plain_normal() const {
    V n = cross(e1_, e2_);
    const I kind = gather<W>(scene_.meshes.normals.data(), point_.mesh);
    const vbool<W> smooth = point_.is_triangle & (kind != I(0));
    V own = n;
    if (any(smooth)) {
      V corner[3];
      gather_normals(scene_, smooth, point_.mesh, point_.triangle, point_.corner, kind, point_.motion, corner);
      own = corner[0] * (1.0f - point_.u - point_.v) + corner[1] * point_.u + corner[2] * point_.v;
      own = select(dot(own, n) < F(0.0f), -own, own);
    }
    return direction_of(normal_to_world(select(smooth, own, n)));
  }
  V normal() const { return place_.ns ? *place_.ns : plain_normal(); }

  // Tangents along s and t of a primvar, perpendicular to the normal and to each other; 0 where they span nothing.
  std::pair<V, V> tangents(int primvar) const {
    const float none[2] = {0, 0};
    const StLanes<W> st(scene_, place_.active, point_, primvar, none);
    const V n = normal(), e1 = to_world(e1_), e2 = to_world(e2_);
    const F area = st.area2(), sign = copysign(F(1.0f), area);
    const V ds = (e1 * st.t2 - e2 * st.t1) * sign, dt = (e2 * st.s1 - e1 * st.s2) * sign;
    V s = ds - n * dot(n, ds);
    const F size = max_component(abs(s));
    const vbool<W> good = point_.is_triangle & (area * area > F(kTinyStArea)) & (size > F(1e-30f));
    s = direction_of(select(good, s, V(F(1.0f), F(0.0f), F(0.0f))));
    V t = cross(n, s);
    t = t * copysign(F(1.0f), dot(t, dt));
    const V zero(F(0.0f));
    return {select(good, s, zero), select(good, t, zero)};
  }

  V view() const {
    const Camera& camera = scene_.camera;
    const auto lanes = [](const vec3& v) { return V{F(v.x), F(v.y), F(v.z)}; };
    if (camera.orthographic) return lanes(camera.world_from_camera.z) * -1.0f;
    const V to = to_world_point(group_point(0)) - lanes(camera.world_from_camera.o);
    return direction_of(to);
  }

  V transformed(PatternTransform kind, const V& v) const {
    const float scale = float(scene_.scale);
    const auto unit = [](const V& a) {
      const vbool<W> some = max_component(abs(a)) > F(0.0f);
      return select(some, direction_of(select(some, a, V(F(1.0f)))), a);
    };
    switch (kind) {
      case PatternTransform::kPointToObject: {
        const V p{v.x - float(scene_.origin.x), v.y - float(scene_.origin.y), v.z - float(scene_.origin.z)};
        return object_from_group().point(from_world_point(p * scale));
      }
      case PatternTransform::kPointToWorld:
        return stage_point(group_from_object().point(v));
      case PatternTransform::kVectorToObject:
        return object_from_group().m.vector(from_world(v * scale));
      case PatternTransform::kVectorToWorld:
        return to_world(group_from_object().m.vector(v)) * float(1 / scene_.scale);
      case PatternTransform::kNormalToObject: {
        const V n = normal_from_world(v);
        const AffineLanes<W> m = group_from_object().m;
        return unit(V{dot(m.x, n), dot(m.y, n), dot(m.z, n)});
      }
      case PatternTransform::kNormalToWorld:
        return unit(normal_to_world(group_from_object().m.normal(v)));
    }
    return v;
  }

  // Area that a footprint covers in an image's coordinates, from their differences at both shifts.
  static F covered(F s1, F t1, F s2, F t2) {
    const F longest = max(s1 * s1 + t1 * t1, s2 * s2 + t2 * t2);
    return max(abs(s1 * t2 - t1 * s2), longest * kThinnestFootprint);
  }

  void image(const Instruction& i, F* r) const {
    const PatternImage& read = tape_.images[size_t(i.data)];
    const F s = r[i.in[0]], t = r[i.in[0] + 1];
    const F *first = r + i.in[1], *second = r + i.in[2];
    const F footprint = read.closest ? F(0.0f) : covered(first[0] - s, first[1] - t, second[0] - s, second[1] - t);
    F missing[4];
    for (int c = 0; c < i.width; ++c) missing[c] = r[i.in[3] + (i.steps >> 3 & 1) * c];
    const V color =
        texels(read, read.color, s, t, footprint, {missing[0], missing[i.width > 1 ? 1 : 0], missing[i.width > 2 ? 2 : 0]});
    const F three[3] = {color.x, color.y, color.z};
    for (int c = 0; c < i.width && c < 3; ++c) r[i.out + c] = three[c];
    if (i.width == 4) r[i.out + 3] = texels(read, read.alpha, s, t, footprint, V(missing[3])).x;
  }
  V texels(const PatternImage& read, int number, F s, F t, F footprint, const V& missing) const {
    const Texture& texture = scene_.textures[size_t(number)];
    if (!texture.udim) return texels_of(texture.images[0], place_.active, read, read.wrap_s, read.wrap_t, s, t, footprint);
    V r = missing;
    for_tiles(texture, place_.active, s, t, [&](vbool<W> same, const TextureImage& image, F in_s, F in_t) {
      r = select(same, texels_of(image, same, read, Wrap::kClamp, Wrap::kClamp, in_s, in_t, footprint), r);
    });
    return r;
  }
  static V texels_of(const TextureImage& image, vbool<W> active, const PatternImage& read, Wrap wrap_s, Wrap wrap_t, F s, F t,
                     F footprint) {
    if (read.closest) {
      const auto centred = [](F x, int size) { return (pattern_floor(x * float(size)) + 0.5f) / float(size); };
      s = centred(s, image.width), t = centred(t, image.height);
    }
    return read_image(image, active, wrap_s, wrap_t, s, t, footprint);
  }
  static F pattern_floor(F x) { return select(abs(x) < F(0x1p23f), to_float(floor_to_int(x)), x); }

  const PatternPlace<W>& place_;
  const Scene& scene_;
  const SurfacePoint<W>& point_;
  const Tape& tape_;
  V p0_, e1_, e2_;
  vbool<W> curved_{false};
  bool any_instanced_ = false;
  AffineLanes<W> instance_;
  I space_{0};
};

}  // namespace primray
