// Test bindings with the directions that a learnt guide samples, alone and with a phase function, and spoilt guides.
#include "bindings/testing/rows.hpp"
#include "guiding/guided_scattering.hpp"
#include "integrator/media.hpp"
#include "scene/scene.hpp"

namespace primray {
namespace {

constexpr int kBins = Guide::kBins;

// Returns a row for each of the points `p` (N, 3; world space) inside media, where rays along +z scatter: whether the guide is
// valid there, and of the direction sampled by `u` (N, 2) its x, y, z, density and weight; and the density of `wi` (N, 3).
nb::object scatter_inside(const Scene& scene, const Guide& guide, float phase, InFloats p_, InFloats u_, InFloats wi_,
                          int lanes) {
  const size_t n = p_.shape(0);
  const Input<float> p(p_, n, 3), u(u_, n, 2), wi(wi_, n, 3);
  Column<float> r(n, 7);
  for_rows(n, lanes, [&]<int W>(size_t at) {
    const auto local = [&](int k, double origin) { return (p.number<W>(at, k) - float(origin)) * float(scene.scale); };
    const vvec3<W> q{local(0, scene.origin.x), local(1, scene.origin.y), local(2, scene.origin.z)};
    const vfloat<W> one(1.0f), zero(0.0f);
    const GuideLocation<W, true> place = find_place_inside<W>(guide, q, vfloat<W>(phase));
    const vvec3<W> back(zero, zero, -one), wo(zero, zero, one);
    const Frame<vfloat<W>> frame(back);
    const PhaseLobes<W> lobes{vfloat<W>(phase)};
    Pair<W> numbers{u.number<W>(at, 0), u.number<W>(at, 1)};
    const vbool<W> by_guide = choose_guide(place, zero, numbers.u);
    BsdfSample<W> s = lobes.sample(wo, zero, numbers.u, numbers.v);
    sample_guided(guide, place, by_guide, numbers, frame, wo, lobes, s);
    const vvec3<W> given = wi.vector<W>(at);
    const vfloat<W> by_phase = lobes.eval(wo, frame.to_local(given)).pdf;
    r.put(at, select(place.region >= vint<W>(0), one, zero), 0);
    const vvec3<W> d = frame.to_world(s.wi);
    r.put(at, d.x, 1), r.put(at, d.y, 2), r.put(at, d.z, 3);
    r.put(at, s.pdf, 4), r.put(at, s.weight.x, 5), r.put(at, mixed_pdf(guide, place, given, zero, by_phase), 6);
  });
  return r.array();
}

// Returns a row for each of the points `p` (N, 3; world space) on surfaces with normals `ng`: whether the guide is valid there;
// of the direction sampled by `u` (N, 2) its x, y, z and density; the density of `wi` (N, 3); and the position in the block
// from its middle, in radii of its sphere.
nb::object guide_directions(const Scene& scene, const Guide& guide, InFloats p_, InFloats ng_, InFloats u_, InFloats wi_,
                            int lanes) {
  const size_t n = p_.shape(0);
  const Input<float> p(p_, n, 3), ng(ng_, n, 3), u(u_, n, 2), wi(wi_, n, 3);
  Column<float> r(n, 9);
  for_rows(n, lanes, [&]<int W>(size_t at) {
    const auto local = [&](int k, double origin) { return (p.number<W>(at, k) - float(origin)) * float(scene.scale); };
    const vvec3<W> q{local(0, scene.origin.x), local(1, scene.origin.y), local(2, scene.origin.z)};
    const GuideLocation<W> place = guide.place_of<W>(q, ng.vector<W>(at)), valid = valid_place(place);
    const vvec3<W> d = guide.sample(valid, u.number<W>(at, 0), u.number<W>(at, 1));
    r.put(at, select(place.region >= vint<W>(0), vfloat<W>(1.0f), vfloat<W>(0.0f)), 0);
    r.put(at, d.x, 1), r.put(at, d.y, 2), r.put(at, d.z, 3), r.put(at, guide.pdf(valid, d), 4);
    r.put(at, guide.pdf(valid, wi.vector<W>(at)), 5);
    r.put(at, place.aside.x, 6), r.put(at, place.aside.y, 7), r.put(at, place.aside.z, 8);
  });
  return r.array();
}

// Moves all of a guide's mass to one bin in every region.
void put_all_in_bin(Guide& guide, int bin) {
  for (size_t i = 0; i < guide.cdf.size(); ++i) guide.cdf[i] = int(i % (kBins + 1)) > bin ? 1.0f : 0.0f;
}

// Regions of surfaces come first.
int regions_inside_media(const Guide& guide) {
  if (!guide.has_media) return 0;
  const auto media = guide.region.begin() + ptrdiff_t(guide.region.size() / (Guide::kSides + 1) * Guide::kSides);
  return 1 + *std::max_element(guide.region.begin(), guide.region.end()) - (1 + *std::max_element(guide.region.begin(), media));
}

// Forgets what a guide knows of media.
void forget_media(Guide& guide) { guide.has_media = false; }

}  // namespace

void bind_guide_tests(nb::module_& m) {
  m.def("scatter_inside", &scatter_inside, nb::arg("scene"), nb::arg("guide"), nb::arg("phase"), nb::arg("p"), nb::arg("u"),
        nb::arg("wi"), nb::arg("lanes") = 0);
  m.def("guide_directions", &guide_directions, nb::arg("scene"), nb::arg("guide"), nb::arg("p"), nb::arg("ng"), nb::arg("u"),
        nb::arg("wi"), nb::arg("lanes") = 0);
  m.def("put_all_in_bin", &put_all_in_bin);
  m.def("regions_inside_media", &regions_inside_media);
  m.def("forget_media", &forget_media);
}

}  // namespace primray
