// Test bindings with array versions of the kernels: N rows in, N rows out, W at a time through their templates. Points,
// distances and directions are in world space and scene units; local directions of BSDFs are about the shading normal. `lanes`:
// 1, or 0 for the maximum. `layout`: 0, 1 or 2, see rows_of().
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>

#include <optional>

#include "accel/build.hpp"
#include "accel/query.hpp"
#include "bindings/testing/rows.hpp"
#include "bsdf/bsdf_with_hair.hpp"
#include "build/inputs/input_facts.hpp"
#include "light/sampler/portal.hpp"
#include "sampler/sampler.hpp"
#include "surface/evaluate_inputs.hpp"
#include "surface/interaction.hpp"
#include "surface/surface_emission.hpp"
#include "texture/mip_pyramid.hpp"
#include "texture/tile_file.hpp"

namespace primray {
namespace {

// Where rows of surfaces are read from: one row for all lanes, rows by lane, and columns as evaluate_inputs() writes them.
constexpr int kOneRow = 0, kByColumn = 2;

// Rows of a table's first two surfaces, which are alike, in turns; or of the first alone.
template <int W>
SurfaceRows<W> rows_of(const SurfaceTable& table, int layout, LaneRows<W>& columns) {
  const vint<W> surface = layout == kOneRow ? vint<W>(0) : lane_numbers<W>() & vint<W>(1);
  if (layout != kByColumn) return SurfaceRows<W>(table, surface);
  copy_constants(table, vbool<W>(true), surface, columns);
  return SurfaceRows<W>::by_column(columns.surface, columns.open_pbr, columns.hair);
}

// Calls f with the lobes of a table's first surfaces, as renders of its scene have them.
template <int W, class F>
auto with_lobes(const SurfaceTable& table, const vvec3<W>& wo, vint<W> front, const F& f, int layout = kOneRow) {
  const vbool<W> all(true), in_front = front != vint<W>(0);
  LaneRows<W> columns;
  const SurfaceRows<W> rows = rows_of(table, layout, columns);
  if (!table.hair.empty()) return f(BsdfWithHair<W>(rows, all, wo, in_front));
  if (table.open_pbr.empty()) return f(Bsdf<W>(rows, all, wo, in_front));
  return f(BsdfWithOpenPbr<W>(rows, all, wo, in_front));
}

nb::tuple bsdf_eval(const SurfaceInput& surface, InFloats wo_, InFloats wi_, InInts front_, int lanes, int layout) {
  SurfaceTable table;
  table.add(surface), table.add(surface);
  const size_t n = wo_.shape(0);
  const Input<float> wo(wo_, n, 3), wi(wi_, n, 3);
  const Input<int32_t> front(front_, n, 1);
  Column<float> diffuse(n, 3), specular(n, 3), pdf(n);
  for_rows(n, lanes, [&]<int W>(size_t at) {
    const vvec3<W> o = wo.vector<W>(at);
    const auto evaluate = [&](const auto& b) { return b.eval(o, wi.vector<W>(at)); };
    const BsdfEval<W> e = with_lobes(table, o, front.number<W>(at), evaluate, layout);
    diffuse.put(at, e.diffuse), specular.put(at, e.specular), pdf.put(at, e.pdf);
  });
  return nb::make_tuple(diffuse.array(), specular.array(), pdf.array());
}

nb::tuple bsdf_sample(const SurfaceInput& surface, InFloats wo_, InInts front_, InFloats u_, int lanes, int layout) {
  SurfaceTable table;
  table.add(surface), table.add(surface);
  const size_t n = wo_.shape(0);
  const Input<float> wo(wo_, n, 3), u(u_, n, 3);
  const Input<int32_t> front(front_, n, 1);
  Column<float> wi(n, 3), weight(n, 3), pdf(n);
  Column<int32_t> is_delta(n), transmits(n);
  for_rows(n, lanes, [&]<int W>(size_t at) {
    const vvec3<W> o = wo.vector<W>(at), r = u.vector<W>(at);
    const auto sample = [&](const auto& b) { return b.sample(o, r.x, r.y, r.z); };
    const BsdfSample<W> s = with_lobes(table, o, front.number<W>(at), sample, layout);
    wi.put(at, s.wi), weight.put(at, s.weight), pdf.put(at, s.pdf), is_delta.put(at, s.is_delta),
        transmits.put(at, s.transmits);
  });
  return nb::make_tuple(wi.array(), weight.array(), pdf.array(), is_delta.array(), transmits.array());
}

// Returns the probabilities of the lobes (the rest transmits), and the straight transmittance of a shadow ray.
nb::tuple bsdf_lobes(const SurfaceInput& surface, InFloats wo_, InInts front_, int lanes) {
  SurfaceTable table;
  table.add(surface);
  const size_t n = wo_.shape(0);
  const Input<float> wo(wo_, n, 3);
  const Input<int32_t> front(front_, n, 1);
  Column<float> chances(n, 4), straight(n, 3);
  for_rows(n, lanes, [&]<int W>(size_t at) {
    const vvec3<W> o = wo.vector<W>(at);
    const auto as_base = [](const auto& b) { return Bsdf<W>(b); };
    const Bsdf<W> b = with_lobes(table, o, front.number<W>(at), as_base);
    const vfloat<W> zero(0.0f), one(1.0f);
    chances.put(at, b.any_preview ? b.p_diffuse : one, 0), chances.put(at, b.any_preview ? b.p_specular : zero, 1);
    chances.put(at, b.any_preview ? b.p_coat : zero, 2), chances.put(at, b.presence, 3);
    straight.put(at, straight_transmittance(b));
  });
  return nb::make_tuple(chances.array(), straight.array());
}

// Checks the index of a sampled light in the table: its order of addition, excluding domes that are not sampled.
void check_light(const Scene& scene, int light) {
  if (light < 0 || light >= scene.lights.count) throw Error("internal", "there is no sampled light with this number");
}

nb::tuple light_sample_rows(const Scene& scene, int light, InArray<double> p_, InFloats u_, int lanes) {
  check_light(scene, light);
  const CorePoints p(scene, p_);
  const Input<float> u(u_, p.n, 2);
  Column<float> wi(p.n, 3), t(p.n), pdf(p.n), L(p.n, 3);
  for_rows(p.n, lanes, [&]<int W>(size_t at) {
    const LightSample<W> s = light_sample(scene.lights, vint<W>(light), vbool<W>(true), p.vector<W>(at), u.number<W>(at, 0),
                                          u.number<W>(at, 1), vfloat<W>(0.0f));
    wi.put(at, s.wi), t.put(at, s.t * float(1 / scene.scale)), pdf.put(at, s.pdf), L.put(at, s.L);
  });
  return nb::make_tuple(wi.array(), t.array(), pdf.array(), L.array());
}

// Hits of rays on a light: distance, density and radiance.
struct MetRows {
  Column<float> t, pdf, L;
  MetRows(const Scene& scene, int light, const InArray<double>& p_, const InFloats& wi_, int lanes)
      : t(p_.size() / 3), pdf(p_.size() / 3), L(p_.size() / 3, 3) {
    check_light(scene, light);
    const CorePoints p(scene, p_);
    const Input<float> wi(wi_, p.n, 3);
    const float* row = scene.lights.row(light) + kRadiance;
    for_rows(p.n, lanes, [&]<int W>(size_t at) {
      vvec3<W> radiance{vfloat<W>(row[0]), vfloat<W>(row[1]), vfloat<W>(row[2])};
      const LocalHit<W> h = light_hit<W>(scene.lights, light, p.vector<W>(at), wi.vector<W>(at), radiance);
      t.put(at, h.t * float(1 / scene.scale)), pdf.put(at, h.pdf), L.put(at, radiance);
    });
  }
};

nb::tuple light_hit_rows(const Scene& scene, int light, InArray<double> p, InFloats wi, int lanes) {
  MetRows r(scene, light, p, wi, lanes);
  return nb::make_tuple(r.t.array(), r.pdf.array());
}

nb::object light_radiance_rows(const Scene& scene, int light, InArray<double> p, InFloats wi, int lanes) {
  return MetRows(scene, light, p, wi, lanes).L.array();
}

// Returns light samples of dome number `dome` through its portals and by its image, for u (N, 3), whose last component is the
// choice; and the density that rays find for given directions.
nb::tuple portal_sample_rows(const Scene& scene, int dome, InArray<double> p_, InFloats u_, int lanes) {
  const CorePoints p(scene, p_);
  const Input<float> u(u_, p.n, 3);
  Column<float> wi(p.n, 3), pdf(p.n), L(p.n, 3);
  const int light = scene.lights.dome_light.at(dome);
  check_light(scene, light);
  for_rows(p.n, lanes, [&]<int W>(size_t at) {
    const vbool<W> active(true);
    const vvec3<W> o = p.vector<W>(at);
    LightSample<W> s =
        light_sample(scene.lights, vint<W>(light), active, o, u.number<W>(at, 0), u.number<W>(at, 1), vfloat<W>(0.0f));
    if (!scene.lights.portals.empty())
      sample_portals(scene.lights, active, vint<W>(light), o, u.number<W>(at, 2), u.number<W>(at, 0), u.number<W>(at, 1),
                     vfloat<W>(0.0f), s);
    wi.put(at, s.wi), pdf.put(at, s.pdf), L.put(at, s.L);
  });
  return nb::make_tuple(wi.array(), pdf.array(), L.array());
}

nb::object dome_pdf_rows(const Scene& scene, int dome, InArray<double> p_, InFloats wi_, int lanes) {
  const CorePoints p(scene, p_);
  const Input<float> wi(wi_, p.n, 3);
  Column<float> r(p.n);
  for_rows(p.n, lanes, [&]<int W>(size_t at) {
    vfloat<W> pdf;
    dome_eval(scene.lights.domes.at(dome), wi.vector<W>(at), pdf);
    if (!scene.lights.portals.empty())
      pdf = dome_pdf(scene.lights, dome, p.vector<W>(at), wi.vector<W>(at), pdf, vfloat<W>(0.0f));
    r.put(at, pdf);
  });
  return r.array();
}

// Returns the shaping of a light for rays along wi that hit it.
nb::object light_shaping_rows(const Scene& scene, int light, InFloats wi_, int lanes) {
  check_light(scene, light);
  const size_t n = wi_.shape(0);
  const Input<float> wi(wi_, n, 3);
  Column<float> r(n, 3);
  for_rows(n, lanes,
           [&]<int W>(size_t at) { r.put(at, hit_shaping(scene.lights, scene.lights.row(light), wi.vector<W>(at))); });
  return r.array();
}

nb::tuple dome_eval_rows(const Scene& scene, int dome, InFloats w_, int lanes) {
  const size_t n = w_.shape(0);
  const Input<float> w(w_, n, 3);
  Column<float> pdf(n), L(n, 3);
  for_rows(n, lanes, [&]<int W>(size_t at) {
    vfloat<W> density;
    L.put(at, dome_eval(scene.lights.domes.at(dome), w.vector<W>(at), density));
    pdf.put(at, density);
  });
  return nb::make_tuple(pdf.array(), L.array());
}

// Returns the probability of every sampled light at each point, (N, lights).
nb::object light_probabilities(const Scene& scene, InArray<double> p_, InFloats n_, int lanes) {
  const CorePoints p(scene, p_);
  const Input<float> n(n_, p.n, 3);
  Column<float> r(p.n, std::max(scene.lights.count, 1));
  for_rows(p.n, lanes, [&]<int W>(size_t at) {
    const vvec3<W> q = p.vector<W>(at), normal = n.vector<W>(at);
    const vfloat<W> total = total_importance(scene.lights, q);
    const vbool<W> m(true);
    for (int i = 0; i < scene.lights.count; ++i) r.put(at, light_probability(scene.lights, i, m, q, normal, total), i);
  });
  return r.array();
}

nb::tuple choose_lights(const Scene& scene, InArray<double> p_, InFloats n_, InFloats u_, int lanes) {
  const CorePoints p(scene, p_);
  const Input<float> n(n_, p.n, 3), u(u_, p.n, 1);
  Column<int32_t> light(p.n);
  Column<float> probability(p.n);
  for_rows(p.n, lanes, [&]<int W>(size_t at) {
    const auto bits = bit_cast<vuint<W>>(truncate(u.number<W>(at) * 0x1p24f)) << 8;
    const auto c = choose_light(scene.lights, vbool<W>(true), p.vector<W>(at), n.vector<W>(at), bits);
    light.put(at, c.light), probability.put(at, c.probability);
  });
  return nb::make_tuple(light.array(), probability.array());
}

// Rows of `key`: pixel x, pixel y, replicate, index, bounce (or link), purpose. Returns pairs (N, 2), and singles (N,).
// screen_block: 0, or the number of points of each pixel in one sequence over the screen.
nb::tuple sampler_numbers(uint32_t seed, InInts key_, int lanes, int screen_block) {
  const size_t n = key_.shape(0);
  const Input<int32_t> key(key_, n, 6);
  Column<float> pairs(n, 2), singles(n);
  for_rows(n, lanes, [&]<int W>(size_t at) {
    const auto number = [&](int c) { return key.number<W>(at, c); };
    const vuint<W> replicate = bit_cast<vuint<W>>(number(2)), index = bit_cast<vuint<W>>(number(3));
    const auto all = Sampler<W>::of(seed, number(0), number(1), replicate, index, screen_block);
    // In the kernels all lanes have the same purpose: query each and keep the value of the lanes that want it.
    for (uint32_t purpose = 0; purpose < uint32_t(Purpose::kCount); ++purpose) {
      const bool chain = Purpose(purpose) == Purpose::kChain;
      const Pair<W> pair = chain ? all.link(number(4)) : all.pair(number(4), Purpose(purpose));
      const vfloat<W> single = all.single(number(4), Purpose(purpose));
      for (int i = 0; i < W && at + i < n; ++i) {
        if (key.number<1>(at + i, 5)[0] != int32_t(purpose)) continue;
        pairs.put(at + i, vfloat<1>(pair.u[i]), 0), pairs.put(at + i, vfloat<1>(pair.v[i]), 1);
        singles.put(at + i, vfloat<1>(single[i]));
      }
    }
  });
  return nb::make_tuple(pairs.array(), singles.array());
}

// Returns rays through pixels (N, 2) with film samples (N, 2) and lens samples (N, 2).
nb::tuple camera_rays(const Scene& scene, InInts pixel_, InFloats film_, InFloats lens_, int lanes) {
  const size_t n = pixel_.shape(0);
  const Input<int32_t> pixel(pixel_, n, 2);
  const Input<float> film(film_, n, 2), lens(lens_, n, 2);
  Column<float> o(n, 3), d(n, 3), tnear(n), tfar(n);
  const float unit = float(1 / scene.scale);
  for_rows(n, lanes, [&]<int W>(size_t at) {
    const CameraRay<W> r =
        scene.camera.ray<W>(pixel.number<W>(at, 0), pixel.number<W>(at, 1), film.number<W>(at, 0), film.number<W>(at, 1),
                            lens.number<W>(at, 0), lens.number<W>(at, 1), vfloat<W>(scene.motion.frame));
    o.put(at, r.o * vfloat<W>(unit)), d.put(at, r.d), tnear.put(at, r.tnear * unit), tfar.put(at, r.tfar * unit);
  });
  // Origins are relative to Scene.origin, whose digits float32 could not hold.
  return nb::make_tuple(o.array(), d.array(), tnear.array(), tfar.array());
}

// Returns directions of the camera's lens for film points (N, 2), in double; NaN outside its field of view.
nb::object lens_directions(const Scene& scene, InArray<double> film) {
  const size_t n = film.shape(0);
  std::vector<double> directions(3 * n, std::numeric_limits<double>::quiet_NaN());
  for (size_t i = 0; i < n; ++i) {
    const std::optional<dvec3> d = scene.distortion->direction(film.data()[2 * i], film.data()[2 * i + 1]);
    if (d) directions[3 * i] = d->x, directions[3 * i + 1] = d->y, directions[3 * i + 2] = d->z;
  }
  return nb::cast(to_numpy(std::move(directions), {n, size_t(3)}));
}

nb::dict intersect_rays(const Scene& scene, InArray<double> o_, InFloats d_, int lanes, bool packet, bool embree) {
  const CorePoints o(scene, o_);
  const Input<float> d(d_, o.n, 3);
  Column<float> t(o.n), ng(o.n, 3), ns(o.n, 3), p(o.n, 3), color(o.n, 3), uv(o.n, 2), offset(o.n);
  Column<int32_t> geometry(o.n), primitive(o.n), instance(o.n), surface(o.n), blocked(o.n);
  const float unit = float(1 / scene.scale);
  std::optional<EmbreeWorld> world;
  if (embree) world.emplace(scene);
  for_rows(o.n, lanes, [&]<int W>(size_t at) {
    const vbool<W> active = lane_numbers<W>() < vint<W>(int32_t(std::min<size_t>(o.n - at, W)));
    const Rays<W> rays{o.vector<W>(at), d.vector<W>(at), vfloat<W>(0.0f), vfloat<W>(kInfinity)};
    const Hits<W> h = !world   ? intersect(scene, packet, active, rays)
                      : packet ? world->in_scene(intersect_packet(world->get(), active, rays))
                               : world->in_scene(intersect_single(world->get(), active, rays));
    const vbool<W> hit = active & (h.geom != vint<W>(-1));
    t.put(at, h.t * unit), uv.put(at, h.u, 0), uv.put(at, h.v, 1);
    geometry.put(at, select(hit, h.geom, vint<W>(-1))), primitive.put(at, select(hit, h.prim, vint<W>(-1)));
    instance.put(at, select(hit, h.inst, vint<W>(-1)));
    const vbool<W> stopped = !world   ? occluded(scene, packet, active, rays)
                             : packet ? occluded_packet(world->get(), active, rays)
                                      : occluded_single(world->get(), active, rays);
    blocked.put(at, select(stopped, vint<W>(1), vint<W>(0)));
    if (!any(hit)) return;
    const Interaction<W> it = interact(scene, hit, rays, h);
    ng.put(at, it.ng), ns.put(at, it.ns), p.put(at, it.p * vfloat<W>(unit)), color.put(at, it.color),
        surface.put(at, it.surface);
    offset.put(at, it.offset * unit);
  });
  nb::dict r;
  r["t"] = t.array(), r["uv"] = uv.array(), r["ng"] = ng.array(), r["ns"] = ns.array(), r["color"] = color.array();
  r["p"] = p.array();  // relative to Scene.origin
  r["offset"] = offset.array();
  r["geometry"] = geometry.array(), r["primitive"] = primitive.array(), r["instance"] = instance.array(),
  r["surface"] = surface.array(), r["blocked"] = blocked.array();
  return r;
}

// Returns values of an image at `st` (N, 2), averaged over 2^level texels.
nb::object looked_up(const TextureImage& image, int wrap_s, int wrap_t, InFloats st_, InFloats level_, int lanes) {
  const size_t n = st_.shape(0);
  const Input<float> st(st_, n, 2), level(level_, n, 1);
  Column<float> r(n, image.channels);
  {
    const nb::gil_scoped_release unlocked;
    for_rows(n, lanes, [&]<int W>(size_t at) {
      const auto read = [&]<int C>(Texels<C, W>) {
        const vfloat<W> s = st.number<W>(at, 0), t = st.number<W>(at, 1), l = level.number<W>(at);
        const Texels<C, W> texels = image.tiles ? lookup_tiled<C>(image, vbool<W>(true), Wrap(wrap_s), Wrap(wrap_t), s, t, l)
                                                : lookup<C>(image, Wrap(wrap_s), Wrap(wrap_t), s, t, l);
        for (int c = 0; c < C; ++c) r.put(at, texels.c[c], c);
      };
      image.channels == 3 ? read(Texels<3, W>()) : read(Texels<1, W>());
    });
  }
  return r.array();
}

// Returns values of an image of (height, width, 1 or 3) at `st` (N, 2), averaged over 2^level texels; `first_level`: the finest
// level kept.
nb::object texture_lookup(InFloats pixels, int wrap_s, int wrap_t, int first_level, InFloats st, InFloats level, int lanes) {
  const TextureImage image =
      make_image(span_of(pixels), int(pixels.shape(1)), int(pixels.shape(0)), int(pixels.shape(2)), first_level, false);
  return looked_up(image, wrap_s, wrap_t, st, level, lanes);
}

// Returns emission at barycentrics (N, 2) of triangles, by index over the scene, in instance rows of placements (-1: none).
nb::object triangle_emission_rows(const Scene& scene, InInts triangle_, InInts placement_, InInts row_, InFloats uv_,
                                  int lanes) {
  const size_t n = triangle_.shape(0);
  const Input<int32_t> triangle(triangle_, n, 1), placement(placement_, n, 1), row(row_, n, 1);
  const Input<float> uv(uv_, n, 2);
  Column<float> r(n, 3);
  for_rows(n, lanes, [&]<int W>(size_t at) {
    const vint<W> place = placement.number<W>(at);
    vint<W> vertex_base;
    for (int i = 0; i < W; ++i)
      vertex_base.set(i, int32_t(scene.groups[place[i] < 0 ? 0 : scene.placement_group[place[i]]].vertex_base));
    r.put(at, triangle_emission(scene, vbool<W>(true), triangle.number<W>(at), vertex_base, place, row.number<W>(at),
                                uv.number<W>(at, 0), uv.number<W>(at, 1)));
  });
  return r.array();
}

}  // namespace

void bind_testing(nb::module_& m) {
  const auto lanes = nb::arg("lanes") = 0;
  m.def("bsdf_eval", &bsdf_eval, nb::arg("surface"), nb::arg("wo"), nb::arg("wi"), nb::arg("front"), lanes,
        nb::arg("layout") = kOneRow);
  m.def("bsdf_sample", &bsdf_sample, nb::arg("surface"), nb::arg("wo"), nb::arg("front"), nb::arg("u"), lanes,
        nb::arg("layout") = kOneRow);
  m.def("bsdf_lobes", &bsdf_lobes, nb::arg("surface"), nb::arg("wo"), nb::arg("front"), lanes);
  m.def("light_sample", &light_sample_rows, nb::arg("scene"), nb::arg("light"), nb::arg("p"), nb::arg("u"), lanes);
  m.def("light_hit", &light_hit_rows, nb::arg("scene"), nb::arg("light"), nb::arg("p"), nb::arg("wi"), lanes);
  m.def("light_radiance", &light_radiance_rows, nb::arg("scene"), nb::arg("light"), nb::arg("p"), nb::arg("wi"), lanes);
  m.def("portal_sample", &portal_sample_rows, nb::arg("scene"), nb::arg("dome"), nb::arg("p"), nb::arg("u"), lanes);
  m.def("dome_pdf", &dome_pdf_rows, nb::arg("scene"), nb::arg("dome"), nb::arg("p"), nb::arg("wi"), lanes);
  m.def("dome_eval", &dome_eval_rows, nb::arg("scene"), nb::arg("dome"), nb::arg("w"), lanes);
  m.def("light_probabilities", &light_probabilities, nb::arg("scene"), nb::arg("p"), nb::arg("n"), lanes);
  m.def("light_shaping", &light_shaping_rows, nb::arg("scene"), nb::arg("light"), nb::arg("wi"), lanes);
  m.def("choose_light", &choose_lights, nb::arg("scene"), nb::arg("p"), nb::arg("n"), nb::arg("u"), lanes);
  m.def("sampler_numbers", &sampler_numbers, nb::arg("seed"), nb::arg("key"), lanes, nb::arg("screen_block") = 0);
  m.def("lens_directions", &lens_directions, nb::arg("scene"), nb::arg("film"));
  m.def("camera_rays", &camera_rays, nb::arg("scene"), nb::arg("pixel"), nb::arg("film"), nb::arg("lens"), lanes);
  m.def("has_few_triangles", [](const Scene& scene) { return scene.few_triangles.any(); });
  m.def("intersect", &intersect_rays, nb::arg("scene"), nb::arg("o"), nb::arg("d"), lanes, nb::arg("packet") = true,
        nb::arg("embree") = false);
  nb::class_<TextureImage>(m, "TextureImage")
      .def(
          "__init__",
          [](TextureImage* image, const std::string& path, const std::string& key, std::shared_ptr<TileMemory> memory,
             int first_level) { new (image) TextureImage(open_tile_file(path, key, std::move(memory), first_level, false)); },
          nb::arg("path"), nb::arg("key"), nb::arg("memory").none(), nb::arg("first_level"));
  m.def("image_lookup", &looked_up, nb::arg("image"), nb::arg("wrap_s"), nb::arg("wrap_t"), nb::arg("st"), nb::arg("level"),
        nb::arg("lanes"));
  m.def("texture_lookup", &texture_lookup, nb::arg("pixels"), nb::arg("wrap_s"), nb::arg("wrap_t"), nb::arg("first_level"),
        nb::arg("st"), nb::arg("level"), lanes);
  m.def("triangle_emission", &triangle_emission_rows, nb::arg("scene"), nb::arg("triangle"), nb::arg("placement"),
        nb::arg("instance_row"), nb::arg("uv"), lanes);
  m.def("average_emission", [](const Scene& scene, int surface) {
    const vec3 c = average_emission(scene, surface);
    return nb::make_tuple(c.x, c.y, c.z);
  });
  bind_math(m);
  bind_phases(m);
  bind_guide_tests(m);
  bind_walks(m);
  bind_hierarchy(m);
  bind_replay(m);
  bind_grids(m);
}

}  // namespace primray
