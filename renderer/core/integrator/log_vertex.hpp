// Events of the path log at a vertex (integrator/path_log.hpp): its hit, the emission that is gathered there, and its lobes.
#pragma once

#include "integrator/emission.hpp"
#include "integrator/vertex.hpp"
#include "light/mesh/emitter.hpp"

namespace primray {

// Listener of intersect_lights() and evaluate_domes() that logs the radiance of each light, with its MIS weight and the density
// by which light sampling would have found it.
struct LogListener {
  PathLog& log;
  const PathLanes<1>& p;
  mutable float light_pdf = 0;  // of the next light; 0: it has no weight

  void weighted(vbool<1> m, vfloat<1> pdf) const { light_pdf = any(m) ? pdf[0] : 0.0f; }
  void light(int i, vbool<1> m, const vvec3<1>& L) const {
    if (any(m)) put("light", i, L);
  }
  void bodies(const LightHits<1>& seen, const vvec3<1>& L) const { light(seen.light[0], seen.covered, L); }
  void dome(size_t k, vbool<1> m, const vvec3<1>& L) const {
    if (any(m)) put("dome", int(k), L);
  }

 private:
  void put(const char* kind, int number, const vvec3<1>& L) const {
    PathLog::Event& event = log.add("emission", p).put(kind, double(number)).put("radiance", L).put("bsdf_pdf", p.bsdf_pdf);
    if (light_pdf > 0) event.put("light_pdf", double(light_pdf)).put("weight", mis_weight(p.bsdf_pdf, vfloat<1>(light_pdf)));
    light_pdf = 0;
  }
};

// Logs the lights that rays hit, and the domes behind everything if they `escape`; see gather_emission().
inline void log_light_hits(PathLog& log, const Round& round, vbool<1> looks, const PathLanes<1>& p, const Hits<1>& hits,
                           vbool<1> hit, const RayMedium<1>* medium = nullptr, vfloat<1> origin_distance = vfloat<1>(0.0f)) {
  vvec3<1> gathered(vfloat<1>(0.0f));
  intersect_lights(round.scene.lights, looks, hit, p, hits.t, gathered, medium, origin_distance, LogListener{log, p});
}
inline void log_domes(PathLog& log, const Round& round, const PathLanes<1>& p) {
  evaluate_domes(round.scene.lights, vbool<1>(true), p, LogListener{log, p});
}

// Logs the surface that a ray hits. Shapes are numbered as in the plane "prim" of first hits.
inline void log_hit(PathLog& log, const Scene& scene, const PathLanes<1>& p, const SurfaceHit<1>& surface) {
  const Interaction<1>& it = surface.it;
  const HitGroup<1> in(scene, vbool<1>(true), surface.hits);
  const bool is_triangle = any(in.is_triangle(scene, vbool<1>(true)));
  log.add("hit", p)
      .put("shape", double(is_triangle ? it.mesh[0] : -2 - it.curved[0]))
      .put("surface", it.surface)
      .put("instance", in.instanced[0] ? double(in.instance[0]) : -1.0)
      .put("outer", in.grouped[0] ? double(in.outer[0]) : -1.0)
      .put("distance", log.length(surface.hits.t))
      .put("position", log.point(it.p))
      .put("normal", it.ng)
      .put("shading_normal", it.ns)
      .put("front", surface.front)
      .put("throughput", p.beta);
}

// Logs what a surface emits towards the path; `shines` includes the MIS weight.
inline void log_surface_emission(PathLog& log, const Scene& scene, vbool<1> hit, const PathLanes<1>& p,
                                 const SurfaceHit<1>& surface, const vvec3<1>& shines) {
  if (!any(hit & (max_component(shines) > vfloat<1>(0.0f)))) return;
  PathLog::Event& event = log.add("emission", p).put("radiance", shines).put("bsdf_pdf", p.bsdf_pdf);
  if (!scene.emitters.any() || !any(p.bsdf_pdf > vfloat<1>(0.0f))) return;
  const vfloat<1> pdf = emitter_pdf(scene, hit, surface.hits, surface.it, p);
  if (any(pdf > vfloat<1>(0.0f))) event.put("light_pdf", pdf).put("weight", mis_weight(p.bsdf_pdf, pdf));
}

// Logs the lobes of a vertex with their probabilities, given that the surface is present.
template <class Lobes>
void log_lobes(PathLog& log, const PathLanes<1>& p, const Vertex<1, Lobes>& v) {
  PathLog::Event& event = log.add("lobes", p);
  if constexpr (Lobes::kInMedium) {
    event.why = "phase function";
    event.put("mean_cosine", mean_cosine(v.bsdf.phase));
    if (any(is_droplets(v.bsdf.phase))) event.put("droplet_diameter", v.bsdf.phase - kDroplets);
    return;
  } else {
    if constexpr (requires { v.bsdf.hair; }) {
      if (v.bsdf.hair) {
        event.why = "hair";
        event.put("presence", v.bsdf.presence);
        return;
      }
    }
    if (!v.bsdf.any_preview) {
      event.why = "Lambert";
      event.put("diffuse", 1.0).put("albedo", v.bsdf.diffuse);
      return;
    }
    event.put("presence", v.bsdf.presence);
    if constexpr (requires { v.bsdf.open_pbr; }) {
      if (v.bsdf.open_pbr) {
        const auto& o = *v.bsdf.open_pbr;
        event.why = "OpenPBR";
        event.put("diffuse", o.p_diffuse).put("behind", o.p_behind).put("fuzz", o.p_fuzz).put("specular", o.p_specular);
        event.put("coat", o.p_coat).put("transmission", o.p_transmit).put("subsurface", o.p_enter);
        return;
      }
    }
    event.why = "UsdPreviewSurface";
    event.put("diffuse", v.bsdf.p_diffuse).put("specular", v.bsdf.p_specular).put("coat", v.bsdf.p_coat);
    event.put("transmission", 1.0 - double(v.bsdf.p_diffuse[0]) - double(v.bsdf.p_specular[0]) - double(v.bsdf.p_coat[0]));
    event.put("alpha", v.bsdf.alpha);
  }
}

}  // namespace primray
