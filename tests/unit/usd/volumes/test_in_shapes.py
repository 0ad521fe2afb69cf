"""Volume shaders with constant inputs, in shapes: coefficients, units, and where they are not seen."""

from __future__ import annotations

import math

import pytest
from pxr import Usd

from primray import RenderSettings
from primray.description import HomogeneousVolume, SceneDescription, Surface
from primray.usd.translate import translate

UNASKED = ("default-light", "camera-chosen", "near-plane", "volume-convention")
HEADER = '#usda 1.0\n( metersPerUnit = {metres}\n upAxis = "Y" )\ndef Camera "eye" {{\n}}\n'
BALL = 'def Sphere "ball" (prepend apiSchemas = ["MaterialBindingAPI"]) {\n rel material:binding = </m>\n}\n'
OPEN = """def Mesh "open" (prepend apiSchemas = ["MaterialBindingAPI"]) {
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    rel material:binding = </m>
}
"""
GLASS = 'def Shader "s" { uniform token info:id = "ND_open_pbr_surface_surfaceshader"\n token outputs:out\n %s\n}\n'


def node(name: str, kind: str, *lines: str) -> str:
    body = "\n".join(lines)
    return f'def Shader "{name}" {{ uniform token info:id = "{kind}"\n token outputs:out\n {body}\n}}\n'


def wire(name: str, to: str) -> str:
    return f"token inputs:{name}.connect = </m/{to}.outputs:out>"


def material(*nodes: str, output: str = "mtlx:volume", root: str = "v", surface: str = "") -> str:
    shown = f"token outputs:{output}.connect = </m/{root}.outputs:out>\n"
    shown += f"token outputs:mtlx:surface.connect = </m/{surface}.outputs:out>\n" if surface else ""
    return f'def Material "m" {{\n{shown}{"".join(nodes)}}}\n'


def translated(text: str, metres: float = 1.0) -> tuple[SceneDescription, list[str]]:
    stage = Usd.Stage.CreateInMemory()
    assert stage.GetRootLayer().ImportFromString(HEADER.format(metres=metres) + text)
    description, found = translate(stage, RenderSettings())
    return description, [d.code for d in found if d.code not in UNASKED]


def surface_of(text: str, metres: float = 1.0) -> tuple[Surface, list[str]]:
    description, codes = translated(text + BALL, metres)
    return description.surfaces[description.shapes[0].surface], codes  # type: ignore[index]


def volume_of(text: str, metres: float = 1.0) -> HomogeneousVolume:
    surface, codes = surface_of(text, metres)
    assert codes == []
    assert surface.volume is not None
    assert not surface.interface
    return surface.volume


ABSORBS = node("a", "ND_absorption_vdf", "float3 inputs:absorption = (1, 2, 3)")
SCATTERS = node(
    "b", "ND_anisotropic_vdf", "float3 inputs:absorption = (1, 0, 0)", "float3 inputs:scattering = (4, 5, 6)",
    "float inputs:anisotropy = 0.5",
)  # fmt: skip
SHINES = node("e", "ND_uniform_edf", "color3f inputs:color = (7, 8, 9)")


@pytest.mark.conforms("Material.outputs:volume")
def test_a_volume_alone_fills_the_shape() -> None:
    found = volume_of(material(node("v", "ND_volume", wire("vdf", "b"), wire("edf", "e")), SCATTERS, SHINES))
    assert found == HomogeneousVolume(
        path="/ball", extinction=(5, 5, 6), scattering=(4, 5, 6), emission=(7, 8, 9), anisotropy=0.5
    )


def test_coefficients_are_per_metre() -> None:
    found = volume_of(material(node("v", "ND_volume", wire("vdf", "b"), wire("edf", "e")), SCATTERS, SHINES), 0.01)
    assert found.extinction == pytest.approx((0.05, 0.05, 0.06))
    assert found.emission == pytest.approx((0.07, 0.08, 0.09))


def test_distributions_are_added_mixed_and_scaled() -> None:
    twice = node("t", "ND_multiply_vdfF", wire("in1", "a"), "float inputs:in2 = 2")
    tinted = node("c", "ND_multiply_vdfC", wire("in1", "b"), "color3f inputs:in2 = (1, 0, 0.5)")
    both = node("s", "ND_add_vdf", wire("in1", "t"), wire("in2", "c"))
    found = volume_of(material(node("v", "ND_volume", wire("vdf", "s")), twice, tinted, both, ABSORBS, SCATTERS))
    assert found.extinction == pytest.approx((7, 4, 9))
    assert found.scattering == pytest.approx((4, 0, 3))
    assert found.anisotropy == pytest.approx(0.5)
    mixed = node("s", "ND_mix_vdf", wire("fg", "a"), wire("bg", "b"), "float inputs:mix = 0.25")
    found = volume_of(material(node("v", "ND_volume", wire("vdf", "s")), mixed, ABSORBS, SCATTERS))
    assert found.scattering == pytest.approx((3, 3.75, 4.5))
    assert found.extinction == pytest.approx((4, 4.25, 5.25))


def test_arnolds_standard_volume() -> None:
    text = material(
        node(
            "v", "arnold:standard_volume", "float inputs:density = 2", "float inputs:scatter = 0.5",
            "color3f inputs:scatter_color = (1, 0.5, 0)", "color3f inputs:transparent = (0.5, 0.25, 1)",
            "float inputs:transparent_depth = 4", "float inputs:scatter_anisotropy = -0.25",
            'token inputs:emission_mode = "density"', "color3f inputs:emission_color = (1, 2, 3)",
        ),
        output="arnold:volume",
    )  # fmt: skip
    found = volume_of(text, 0.01)
    log2 = math.log(2)
    assert found.extinction == pytest.approx((log2 / 2, log2, 0))
    assert found.scattering == pytest.approx((log2 / 4, log2 / 4, 0))
    assert found.emission == pytest.approx((2, 4, 6))
    assert found.anisotropy == -0.25


def test_karmas_volume() -> None:
    text = material(
        node("v", "kma_volume", "color3f inputs:scattering = (1, 2, 3)", "float inputs:anisotropy = 0.5"), output="kma:volume"
    )
    assert volume_of(text, 0.5).extinction == pytest.approx((0.5, 1.0, 1.5))


def test_each_shape_has_a_volume_of_its_own() -> None:
    text = material(node("v", "ND_volume", wire("vdf", "a")), ABSORBS)
    description, _ = translated(text + BALL + BALL.replace('"ball"', '"other"'))
    assert {s.volume.path for s in description.surfaces if s.volume} == {"/ball", "/other"}


def test_open_meshes_have_no_inside() -> None:
    description, codes = translated(material(node("v", "ND_volume", wire("vdf", "a")), ABSORBS) + OPEN)
    assert codes == ["open-interior"]
    assert description.surfaces[0].volume is None
    assert description.surfaces[0].opacity == 0


def test_an_interface_that_transmits_shows_it() -> None:
    volume = node("v", "ND_volume", wire("vdf", "a"))
    surface, codes = surface_of(material(volume, ABSORBS, GLASS % "float inputs:transmission_weight = 1", surface="s"))
    assert codes == []
    assert surface.interface
    assert surface.volume is not None
    assert surface.volume.extinction == (1, 2, 3)
    surface, codes = surface_of(material(volume, ABSORBS, GLASS % "", surface="s"))
    assert codes == ["shader-ignored"]
    assert surface.volume is None


@pytest.mark.parametrize(
    "text",
    [
        material(node("v", "ND_volume", wire("vdf", "x")), node("x", "ND_other")),
        material(node("v", "kma_other"), output="volume"),
        material(
            node("v", "ND_volume", wire("vdf", "a")),
            node("a", "ND_absorption_vdf", wire("absorption", "f")),
            node("f", "ND_geompropvalue_vector3", "string inputs:geomprop = 'density'"),
        ),
    ],
)
def test_what_is_not_known_is_reported(text: str) -> None:
    assert "shader-ignored" in translated(text + BALL)[1]


@pytest.mark.parametrize(
    ("vdf", "codes"),
    [
        (["float3 inputs:scattering = (1, 1, 1)", "float inputs:anisotropy = 0.99"], ["out-of-range"]),
        (["float3 inputs:scattering = (1, 1, 1)", "float inputs:anisotropy = 0.98"], []),
        (["float3 inputs:scattering = (1, -1, 1)"], ["out-of-range"]),
    ],
)
def test_values_out_of_range_are_reported(vdf: list[str], codes: list[str]) -> None:
    surface, found = surface_of(material(node("v", "ND_volume", wire("vdf", "b")), node("b", "ND_anisotropic_vdf", *vdf)))
    assert found == codes
    assert surface.volume is not None
    assert surface.volume.anisotropy < 0.9801
    assert min(surface.volume.scattering) >= 0


def test_several_phase_functions_are_reported() -> None:
    """One with their mean stands for them; where both are the same nothing is approximated."""

    def two(second: float) -> tuple[Surface, list[str]]:
        parts = [
            node(name, "ND_anisotropic_vdf", "float3 inputs:scattering = (1, 1, 1)", f"float inputs:anisotropy = {g}")
            for name, g in (("b", 0.5), ("c", second))
        ]
        both = node("s", "ND_add_vdf", wire("in1", "b"), wire("in2", "c"))
        return surface_of(material(node("v", "ND_volume", wire("vdf", "s")), both, *parts))

    surface, codes = two(0.0)
    assert codes == ["material-input"]
    assert surface.volume is not None
    assert surface.volume.anisotropy == 0.25
    assert two(0.5)[1] == []


def test_its_convention_is_reported() -> None:
    stage = Usd.Stage.CreateInMemory()
    text = material(node("v", "arnold:standard_volume", "float inputs:density = 2"), output="arnold:volume")
    assert stage.GetRootLayer().ImportFromString(HEADER.format(metres=1.0) + text + BALL)
    said = [d.message for d in translate(stage, RenderSettings())[1] if d.code == "volume-convention"]
    assert said == ["Arnold's standard_volume is used: extinction is per scene unit."]
