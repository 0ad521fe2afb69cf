"""Hair from a stage to pixels: what MaterialX's nodes and UsdPreviewSurface say of it, and that nothing is lost on the way."""

from __future__ import annotations

import numpy as np
import pytest
from tests.statistics.surfaces.hair.hair_cases import hair_absorption, hair_widths
from tests.unit.usd.usd_text import stage_of

import primray
from primray.description import Hair
from primray.settings import RenderSettings
from primray.usd import translate

STAGE = """#usda 1.0
( metersPerUnit = 1
  upAxis = "Y" )
def Camera "camera"
{
    float horizontalAperture = 20
    float verticalAperture = 20
    float focalLength = 50
    double3 xformOp:translate = (0, 0, 6)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def DomeLight "sky" {}
def BasisCurves "strands" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    uniform token type = "TYPE"
    int[] curveVertexCounts = [4, 4, 4]
    point3f[] points = [(-0.7, -3, 0), (-0.7, -1, 0), (-0.7, 1, 0), (-0.7, 3, 0), (0, -3, 0), (0.2, -1, 0.3), (-0.2, 1, 0),
                        (0, 3, 0.4), (0.7, -3, 0), (0.7, -1, 0), (0.9, 1, 0.1), (0.9, 3, 0)]
    float[] widths = [0.5] (interpolation = "constant")
    PRIMVARS
    rel material:binding = </m>
}
"""
SURFACE = """
def Material "m"
{
    token outputs:mtlx:surface.connect = </m/s.outputs:out>
    def Shader "s"
    {
        uniform token info:id = "ND_surface"
        token inputs:bsdf.connect = </m/hair.outputs:out>
        token outputs:out
    }
    def Shader "hair"
    {
        uniform token info:id = "ND_chiang_hair_bsdf"
        float2 inputs:roughness_R.connect = </m/r.outputs:roughness_R>
        float2 inputs:roughness_TT.connect = </m/r.outputs:roughness_TT>
        float2 inputs:roughness_TRT.connect = </m/r.outputs:roughness_TRT>
        INPUTS
        token outputs:out
    }
    def Shader "r"
    {
        uniform token info:id = "ND_chiang_hair_roughness"
        float inputs:longitudinal = 0.3
        float inputs:azimuthal = 0.4
        float2 outputs:roughness_R
        float2 outputs:roughness_TT
        float2 outputs:roughness_TRT
    }
    NODES
}
"""
PREVIEW = """
def Material "m"
{
    bool primray:hair = true
    token outputs:surface.connect = </m/s.outputs:surface>
    def Shader "s"
    {
        uniform token info:id = "UsdPreviewSurface"
        INPUTS
        token outputs:surface
    }
    NODES
}
"""


def text(material: str = SURFACE, inputs: str = "", nodes: str = "", kind: str = "linear", primvars: str = "") -> str:
    shape = STAGE.replace("TYPE", kind).replace("PRIMVARS", primvars)
    return shape + material.replace("INPUTS", inputs).replace("NODES", nodes)


def hair_of(stage: str) -> tuple[Hair, list[str]]:
    description, told = translate(stage_of(stage), RenderSettings())
    surface = next(s for s in description.surfaces if s.hair is not None)
    assert surface.hair is not None
    return surface.hair, [d.message for d in told if d.code == "material-input"]


def test_inputs_are_the_nodes() -> None:
    """Widths by their node, a direction and a normal that have no effect."""
    inputs = """color3f inputs:tint_TT = (0.2, 0.4, 0.6)
        float inputs:ior = 1.4
        float inputs:cuticle_angle = 0.52
        vector3f inputs:curve_direction = (1, 0, 0)
        vector3f inputs:absorption_coefficient = (0.1, 0.2, 0.4)"""
    hair, told = hair_of(text(inputs=inputs))
    for name, value in hair_widths(0.3, 0.4).items():
        assert getattr(hair, name) == pytest.approx(value, rel=1e-5)
    assert hair.tint_tt == pytest.approx((0.2, 0.4, 0.6), rel=1e-6)
    assert hair.absorption == pytest.approx((0.1, 0.2, 0.4), rel=1e-6)
    assert (hair.ior, hair.cuticle_tilt) == pytest.approx((1.4, 0.02 * np.pi), rel=1e-4)
    assert told == ["curve_direction has no effect: hair fibres have their own."]


def test_melanin_absorbs() -> None:
    """d'Eon et al.: -ln(1 - c) times what each pigment absorbs."""
    nodes = """def Shader "a" {
        uniform token info:id = "ND_deon_hair_absorption_from_melanin"
        float inputs:melanin_concentration = 0.5
        float inputs:melanin_redness = 0.25
        vector3f outputs:absorption
    }"""
    hair, _ = hair_of(text(inputs="vector3f inputs:absorption_coefficient.connect = </m/a.outputs:absorption>", nodes=nodes))
    black, red = np.array([0.419, 0.697, 1.37]), np.array([0.187, 0.4, 1.05])
    assert hair.absorption == pytest.approx(tuple(np.log(2) * (0.75 * black + 0.25 * red)), rel=1e-4)


def test_preview_surfaces_color_and_roughness() -> None:
    hair, told = hair_of(text(PREVIEW, "color3f inputs:diffuseColor = (0.5, 0.3, 0.1)\n float inputs:metallic = 1"))
    assert hair.absorption == pytest.approx(hair_absorption((0.5, 0.3, 0.1), 0.3), rel=1e-4)
    for name, value in hair_widths(0.5, 0.3).items():
        assert getattr(hair, name) == pytest.approx(value, rel=1e-5)
    assert told == ["Inputs without effect on hair: metallic."]
    without = text(PREVIEW.replace("true", "false"))
    description, _ = translate(stage_of(without), RenderSettings())
    assert all(s.hair is None for s in description.surfaces)


@pytest.mark.parametrize("kind", ["linear", "cubic"])
@pytest.mark.parametrize("filled", [False, True])
def test_white_strands_in_a_white_sky_are_not_seen(kind: str, filled: bool) -> None:
    """Whatever their widths are: light comes out where and as it should, and none is met twice."""
    inputs = "" if not filled else "float inputs:cuticle_angle = 0.53\n float inputs:ior = 1.3"
    image = primray.render(stage_of(text(inputs=inputs, kind=kind)), resolution=(32, 32), spp=256, max_depth=64)
    middle = image.pixels[4:-4, 4:-4, :3]
    assert middle.mean() == pytest.approx(1.0, abs=2e-3)
    assert abs(middle - 1).max() < 0.05


def test_what_passes_is_absorbed_once() -> None:
    """Where what is reflected is left out, a strand seen head-on in a white sky has what is left after its chord."""
    inputs = """color3f inputs:tint_R = (0, 0, 0)
        color3f inputs:tint_TRT = (0, 0, 0)
        vector3f inputs:absorption_coefficient = (0.3, 0.6, 1.2)"""
    image = primray.render(stage_of(text(inputs=inputs)), resolution=(64, 64), spp=1024, max_depth=1)
    x = (np.arange(64) + 0.5) / 64 * 2 - 1
    at = x * 1.2  # 6 away, 20 of 50 wide
    h = np.clip((at + 0.7) / 0.25, -1, 1)
    column = np.abs(h) < 0.8
    wanted = np.stack([left(h[column], a) for a in (0.3, 0.6, 1.2)], 1)
    seen = image.pixels[28:36, :, :3].mean(0)[column]
    np.testing.assert_allclose(seen, wanted, rtol=0.03, atol=5e-3)


def left(h: np.ndarray, absorption: float) -> np.ndarray:
    """(1 - F)^2 e^(-2 a cos gamma_t), across the fibre."""
    eta = 1.55
    cosine, inside = np.sqrt(1 - h * h), np.sqrt(1 - (h / eta) ** 2)
    s, p = (cosine - eta * inside) / (cosine + eta * inside), (eta * cosine - inside) / (eta * cosine + inside)
    return np.asarray((1 - (s * s + p * p) / 2) ** 2 * np.exp(-2 * absorption * inside))


def test_colours_vary_from_strand_to_strand() -> None:
    nodes = """def Shader "c" {
        uniform token info:id = "ND_geompropvalue_color3"
        string inputs:geomprop = "shade"
        color3f outputs:out
    }
    def Shader "a" {
        uniform token info:id = "ND_chiang_hair_absorption_from_color"
        color3f inputs:color.connect = </m/c.outputs:out>
        float inputs:azimuthal_roughness = 0.4
        vector3f outputs:absorption
    }"""
    primvars = """color3f[] primvars:shade = [(0.9, 0.1, 0.1), (0.1, 0.9, 0.1), (0.1, 0.1, 0.9)] (interpolation = "uniform")"""
    fed = "vector3f inputs:absorption_coefficient.connect = </m/a.outputs:absorption>"
    image = primray.render(stage_of(text(inputs=fed, nodes=nodes, primvars=primvars)), resolution=(32, 32), spp=64)
    row = image.pixels[16, :, :3]
    assert [int(np.argmax(row[k])) for k in (7, 16, 26)] == [0, 1, 2]


@pytest.mark.parametrize("away", [0.0, 100.0])
def test_no_light_is_lost_in_thin_bent_strands(away: float) -> None:
    """Of 0.005, closer together than they are wide: a fibre's walls are not far apart for what rounding is."""
    rng = np.random.default_rng(1)
    roots = np.stack([rng.uniform(-0.1, 0.1, 300), np.zeros(300), rng.uniform(-0.02, 0.02, 300)], 1)
    bends = rng.uniform(-0.02, 0.02, (300, 4, 3)) + np.linspace(-0.12, 0.12, 4)[None, :, None] * np.array([0, 1, 0])
    points = roots[:, None] + bends + (away, 0, 0)
    strands = ", ".join(f"({x:.7g}, {y:.7g}, {z:.7g})" for x, y, z in points.reshape(-1, 3))
    shape = text(kind="cubic")
    i, j = shape.index("point3f[] points"), shape.index("float[] widths = [0.5]")
    shape = shape[:i] + f"point3f[] points = [{strands}]\n" + shape[j:].replace("[0.5]", "[0.005]")
    shape = shape.replace("[4, 4, 4]", str([4] * 300)).replace("(0, 0, 6)", f"({away:g}, 0, 2)")
    shape = shape.replace("focalLength = 50", "focalLength = 200")
    image = primray.render(stage_of(shape), resolution=(32, 32), spp=64, max_depth=256)
    assert image.pixels[..., 3].mean() > 0.5
    assert image.pixels[..., :3].mean() == pytest.approx(1.0, abs=2e-3)
