"""Every feature and technique that can be left out, and how: by a setting, by the environment, or by a build of the core with
a macro or from changed sources. Changed, not switched: code that is only there to be measured would cost every reader."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

ALL = ("box", "field", "hills", "metals", "lamps", "cove", "showroom")


@dataclass(frozen=True)
class Edit:
    """In this file of renderer/core, `text`, which stands there once, becomes `other`."""

    file: str
    text: str
    other: str


@dataclass(frozen=True)
class Row:
    name: str
    instead: str  # what is rendered then
    scenes: tuple[str, ...] = ALL
    settings: Mapping[str, Any] = field(default_factory=dict)  # of RenderSettings
    splits: Mapping[str, int] = field(default_factory=dict)  # of core.Splits, in place of what pilots find
    environment: Mapping[str, str] = field(default_factory=dict)
    edits: tuple[Edit, ...] = ()
    defines: tuple[str, ...] = ()  # macros of the core

    @property
    def needs_build(self) -> bool:
        return bool(self.edits or self.defines)


BASE = Row("as it is", "")
_EMBREE = Edit("bvh/triangle_bvh.hpp", "kBuilt = PRIMRAY_MAX_LANES >= 16;", "kBuilt = false;")
ROWS = (
    Row("splitting at the first surface", "one path goes on from there", scenes=("box", "metals"), splits={"paths": 1}),
    Row("samples of lights at the first surface", "one", scenes=("box", "field", "lamps"), splits={"lights": 1}),
    Row("16 lanes", "8 lanes of the same build", scenes=("box", "hills"), environment={"PRIMRAY_LANES": "8"}),
    Row("lanes", "one lane", environment={"PRIMRAY_LANES": "1"}, scenes=("box", "hills")),
    Row("AVX-512", "the AVX2 build", scenes=("box", "hills"), environment={"PRIMRAY_ISA": "v3"}),
    Row(
        "Owen-scrambled Sobol points",
        "independent random numbers",
        edits=(
            Edit(
                "sampler/sampler.hpp",
                "return {unit_float(reverse_bits(a)), unit_float(reverse_bits(b))};",
                "return {unit_float(mix(index ^ s)), unit_float(mix(mix(index ^ s) + a + b))};",
            ),
        ),
    ),
    Row(
        "Russian roulette",
        "none before the 1024th scattering",
        scenes=("box", "metals"),
        edits=(Edit("integrator/scatter.hpp", "constexpr int kRouletteStart = 2;", "constexpr int kRouletteStart = 1024;"),),
    ),
    Row(
        "packets or single rays by measurement",
        "always single rays",
        scenes=("field",),
        edits=(Edit("integrator/rays/packet_choice.hpp", "return measuring() ? (trials_ & 1) : packet_;", "return false;"),),
    ),
    Row(
        "packets or single rays by measurement (2)",
        "always packets",
        scenes=("field",),
        edits=(Edit("integrator/rays/packet_choice.hpp", "return measuring() ? (trials_ & 1) : packet_;", "return true;"),),
    ),
    Row(
        "MIS compensation of domes",
        "the whole image is sampled",
        scenes=("hills", "metals"),
        edits=(Edit("light/dome/dome_compensation.cpp", "by_both ? never : best;", "by_both ? never : 0;"),),
    ),
    Row(
        "how much of a dome is left to rays",
        "its mean",
        scenes=("metals",),
        edits=(Edit("light/dome/dome_compensation.cpp", "kChoices = 7", "kChoices = 1"),),
    ),
    Row(
        "the choice whether a dome is sampled",
        "it always is",
        scenes=("field", "hills"),
        edits=(
            Edit(
                "light/dome/dome_compensation.cpp",
                "return by_cosine <= kWorth * by_both",
                "return by_cosine <= -kWorth * by_both",
            ),
        ),
    ),
    Row(
        "the tree of lights",
        "every light is weighed at every vertex",
        scenes=("lamps",),
        edits=(Edit("light/light.hpp", "kWeighed = 3, ", "kWeighed = 1 << 20, "),),
    ),
    Row(
        "paths end by the light that they are expected to find",
        "by their throughput",
        scenes=("cove", "window"),
        edits=(Edit("integrator/round.hpp", ".first_received = settings.guide != nullptr", ".first_received = false"),),
    ),
    Row(
        "many lights chosen by how shiny surfaces reflect",
        "as for matte ones",
        scenes=("showroom",),
        edits=(Edit("integrator/sample_light.hpp", "kLeastGlossy = 0.04f", "kLeastGlossy = 2.0f"),),
    ),
    Row(
        "many lights chosen by the surface's normal",
        "as if lit from all around",
        scenes=("lamps", "showroom"),
        edits=(
            Edit("light/sampler/tree_choice.hpp", "has_normal = across[0] + across[1] + across[2] > 0;", "has_normal = false;"),
        ),
    ),
    Row(
        "reflections from the bounded cap",
        "from all visible normals",
        scenes=("metals", "showroom"),
        edits=(
            Edit(
                "bsdf/ggx.hpp",
                "return (1.0f - a2) * s2 / (s2 + a2 * wo.z * wo.z);",
                "return vfloat<W>(1.0f) + 0.0f * (s2 + a2);",
            ),
        ),
    ),
    Row(
        "power heuristic",
        "balance heuristic",
        scenes=("box", "metals", "showroom"),
        edits=(Edit("integrator/emission.hpp", "return 1.0f / (1.0f + r * r);", "return 1.0f / (1.0f + r);"),),
    ),
    Row(
        "pixels of a tile in Morton order",
        "by rows",
        scenes=("field", "hills"),
        edits=(
            Edit(
                "integrator/tile_task.hpp",
                "x |= (m >> (2 * b) & 1) << b, y |= (m >> (2 * b + 1) & 1) << b;",
                "x = m % kTile, y = m / kTile;",
            ),
        ),
    ),
    Row(
        "leaving rarely met lights to light samples",
        "rays look for all of them",
        scenes=("lamps",),
        edits=(Edit("integrator/emission.hpp", "kRareHit = 0.05f;", "kRareHit = 1e-12f;"),),
    ),
    Row(
        "few triangles without a hierarchy",
        "Embree",
        scenes=("box", "lamps"),
        edits=(
            Edit("bvh/few_triangles.cpp", "constexpr double kMostCost = 128;", "constexpr double kMostCost = 0;"),
            _EMBREE,
        ),
    ),
    Row("rays that take turns in worlds of triangles", "Embree", scenes=("hills", "plastics", "signs"), edits=(_EMBREE,)),
    Row(
        "triangles in pairs",
        "one by one",
        scenes=("hills",),
        edits=(Edit("bvh/pairs.hpp", "kFewestPairs = 256;", "kFewestPairs = 1 << 30;"),),
    ),
    Row(
        "caustics guided by photons",
        "not guided",
        scenes=("metals",),
        edits=(Edit("guiding/pilot/learn_caustics.cpp", "max_depth < 2", "max_depth < 1 << 30"),),
    ),
    Row(
        "photons only where they pay",
        "wherever there are some",
        scenes=("haze", "plastics", "showroom"),
        edits=(Edit("guiding/pilot/learn_caustics.cpp", "return error * kGuidedCost <", "return kGuidedCost > 0 || error <"),),
    ),
    Row(
        "meshes that emit among each other are one choice",
        "each is one",
        scenes=("studio",),
        edits=(Edit("build/emitters/emitter_shapes.cpp", "> kMostTriangleRuns) return false;", "> 0) return false;"),),
    ),
    Row(
        "mesh lights' triangles near by solid angle",
        "by area",
        scenes=("signs",),
        edits=(Edit("light/shape/triangle.hpp", "> 4.0f * max(dot(half, half)", "> 0.0f * max(dot(half, half)"),),
    ),
    Row(
        "gradients of photons",
        "sources stay where they are",
        scenes=("metals",),
        edits=(Edit("guiding/pilot/caustic_photons.cpp", "kLeastSpread = 1e-4f", "kLeastSpread = 2.0f"),),
    ),
    Row(
        "a guide into indirect light",
        "not guided",
        scenes=("cove", "window"),
        edits=(Edit("guiding/pilot/learn_guide.cpp", "max_depth < 2", "max_depth < 1 << 30"),),
    ),
    Row(
        "film point and directions in four dimensions",
        "in two",
        scenes=("box", "field", "hills", "cove"),
        edits=(
            Edit(
                "sampler/sampler.hpp",
                "dimension_seed(number >> 1, Purpose::kChain)",
                "dimension_seed(number, Purpose::kChain)",
            ),
        ),
    ),
    Row(
        "rectangles seen as slivers along their length",
        "by solid angle, whose arc sines round",
        scenes=("cove",),
        edits=(Edit("light/types/rect.hpp", "kSliver = 0.02f", "kSliver = 0.0f"),),
    ),
    Row(
        "camera rays for lights that end in a pixel",
        "none",
        scenes=("box", "lamps"),
        edits=(Edit("build/lights/light_outlines.cpp", "kMostLights = 1 << 14;", "kMostLights = 0;"),),
    ),
    Row(
        "rectangles by solid angle",
        "by area",
        scenes=("box",),
        edits=(
            Edit(
                "light/types/rect.hpp", "return dot(p, p) > 4.0f * (hx * hx + hy * hy);", "return dot(p, p) > 0.0f * (hx + hy);"
            ),
        ),
    ),
    Row(
        "spheres by solid angle",
        "by area, their far sides too",
        scenes=("lamps",),
        edits=(
            Edit(
                "light/types/sphere.hpp",
                "return {w, t, select(outside > vfloat<W>(0.0f), 1.0f / (2.0f * kPi * spread), vfloat<W>(0.0f))};",
                "const vfloat<W> z = 1.0f - 2.0f * u, ring = safe_sqrt(1.0f - z * z);"
                "const vvec3<W> n(ring * phi.cos, ring * phi.sin, z), to = n * r - p;"
                "const vfloat<W> there = sqrt(dot(to, to)), cosine = dot(n, to) / there * -1.0f;"
                "const vbool<W> seen = (outside > vfloat<W>(0.0f)) & (cosine > vfloat<W>(0.0f));"
                "const vfloat<W> pdf = there * there / (cosine * 4.0f * kPi * r * r);"
                "return {to * (1.0f / there), there, select(seen, pdf, vfloat<W>(0.0f))};",
            ),
            Edit(
                "light/types/sphere.hpp",
                "select(hit, 1.0f / (2.0f * kPi * sphere_one_minus_cos(dot(p, p), r, outside)), vfloat<W>(0.0f))};",
                "select(hit, t * t / (dot(p + w * t, w) * -4.0f * kPi * r), vfloat<W>(0.0f))};",
            ),
        ),
    ),
    Row(
        "discs by solid angle",
        "by area",
        scenes=("studio",),
        edits=(Edit("light/types/disk.hpp", "> 32.0f * r * r;", "> 0.0f * r;"),),
    ),
    Row(
        "cylinders by solid angle",
        "by area, their far sides too",
        scenes=("studio",),
        edits=(
            Edit(
                "light/types/cylinder.hpp",
                "const vfloat<W> theta_max = ",
                "const SinCos<W> turn = sincos_turns(u);"
                "const vvec3<W> there = vvec3<W>((2.0f * v - 1.0f) * h, r * turn.cos, r * turn.sin) - p;"
                "const vfloat<W> far = length(there), cosine = (there.y * turn.cos + there.z * turn.sin) / far * -1.0f;"
                "const vbool<W> facing = (outside > vfloat<W>(0.0f)) & (cosine > vfloat<W>(0.0f));"
                "return {there * (1.0f / far), far, "
                "select(facing, far * far / (cosine * 4.0f * kPi * r * h), vfloat<W>(0.0f))};"
                "const vfloat<W> theta_max = ",
            ),
            Edit(
                "light/types/cylinder.hpp",
                "const vfloat<W> pdf = 1.0f / (2.0f * atan2(r, safe_sqrt(outside)) * line.difference);",
                "const vfloat<W> pdf = t * t / (((p.y + w.y * t) * w.y + (p.z + w.z * t) * w.z) * -4.0f * kPi * h)"
                " + 0.0f * line.difference;",
            ),
        ),
    ),
)
