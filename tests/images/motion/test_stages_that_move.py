"""Stages that move, from USD to pixels: one streak whatever says that it moves, and bits where two stages say the same."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pxr import Usd

import primray
from primray.images.image import Image

GLOW = """
def Material "glow"
{
    token outputs:surface.connect = </glow/s.outputs:surface>
    def Shader "s"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (0, 0, 0)
        color3f inputs:emissiveColor = (1, 1, 1)
        token outputs:surface
    }
}
"""
CAMERA = """
def Camera "camera"
{
    token projection = "orthographic"
    float horizontalAperture = 80
    float verticalAperture = 5
    double shutter:open = %s
    double shutter:close = %s
    %s
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
EYE = "double3 xformOp:translate = (%s, 0, 10)"
BOUND = 'prepend apiSchemas = ["MaterialBindingAPI", "MotionAPI"]'
QUAD = """
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
    rel material:binding = </glow>
"""
POINTS = "point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]"
ORDER = 'uniform token[] xformOpOrder = ["xformOp:translate"]'


def stage(*parts: str, opens: float = 0.0, closes: float = 1.0, eye: str = EYE % 0, head: str = "") -> str:
    return f"#usda 1.0\n( timeCodesPerSecond = 24 {head})\n" + GLOW + CAMERA % (opens, closes, eye) + "".join(parts)


def render(text: str, spp: int = 2048, resolution: tuple[int, int] = (64, 4), **more: Any) -> Image:
    opened = Usd.Stage.CreateInMemory()
    assert opened.GetRootLayer().ImportFromString(text)
    return primray.render(opened, resolution=resolution, spp=spp, **{"time_code": 0.0, "default_light": False, **more})


def coverage(text: str, **more: Any) -> np.ndarray:
    return np.asarray(render(text, **more).pixels[..., 3].astype(np.float64).mean(axis=0))


def mesh(points: str = POINTS, more: str = "", name: str = "m") -> str:
    return f'\ndef Mesh "{name}" ({BOUND})\n{{\n{QUAD}{points}\n{more}\n}}\n'


def path_through(samples: str) -> str:
    return f"double3 xformOp:translate.timeSamples = {{ {samples} }}\n    {ORDER}"


def path(first: str = "(-2, 0, 0)", last: str = "(2, 0, 0)") -> str:
    return path_through(f"0: {first}, 1: {last}")


def moved(dx: float) -> str:
    return ", ".join(f"({x + dx:g}, {y}, 0)" for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1)))


SAMPLES = f"point3f[] points.timeSamples = {{ 0: [{moved(-2)}], 1: [{moved(2)}] }}"
VELOCITIES = f"""point3f[] points.timeSamples = {{ 0: [{moved(-2)}] }}
    vector3f[] velocities.timeSamples = {{ 0: [(96, 0, 0), (96, 0, 0), (96, 0, 0), (96, 0, 0)] }}"""
INSTANCER = (
    """
def PointInstancer "i"
{
    int[] protoIndices = [0]
    rel prototypes = </i/m>
    %s
"""
    + mesh().replace("\n", "\n    ")
    + "\n}\n"
)
NATIVE = 'class "p"\n{' + mesh() + '\n}\ndef Xform "n" (instanceable = true\nprepend references = </p>)\n{\n%s\n}\n'

STREAKS = {
    "mesh": stage(mesh(more=path())),
    "points": stage(mesh(SAMPLES)),
    "velocities": stage(mesh(VELOCITIES)),
    "camera": stage(mesh(), eye="double3 xformOp:translate.timeSamples = { 0: (2, 0, 10), 1: (-2, 0, 10) }"),
    "native": stage(NATIVE % path()),
    "instancer": stage(INSTANCER % "point3f[] positions.timeSamples = { 0: [(-2, 0, 0)], 1: [(2, 0, 0)] }"),
    "instancer's velocities": stage(
        INSTANCER % "point3f[] positions.timeSamples = { 0: [(-2, 0, 0)] }\n"
        "vector3f[] velocities.timeSamples = { 0: [(96, 0, 0)] }"
    ),
    "parent": stage('def Xform "x"\n{\n' + path() + mesh() + "\n}\n"),
    "many samples": stage(mesh(more=path_through("-1: (-6, 0, 0), 0.2: (-1.2, 0, 0), 0.5: (0, 0, 0), 3: (10, 0, 0)"))),
    "inside one interval": stage(mesh(more=path_through("-10: (-42, 0, 0), 10: (38, 0, 0)"))),
    "a blur scale": stage(mesh(more=path() + "\n    float motion:blurScale = 0.5"), closes=2.0),
}


def trapezoid(start: float = -2.0, end: float = 2.0) -> np.ndarray:
    fine = (np.arange(64 * 64) + 0.5) / (64 * 64) * 8 - 4
    gone = [np.clip((fine - side - start) / (end - start), 0, 1) for side in (1, -1)]
    return np.asarray((gone[1] - gone[0]).reshape(64, 64).mean(axis=1))


@pytest.mark.conforms("Camera.shutter:open", "Camera.shutter:close")
@pytest.mark.parametrize("name", STREAKS)
def test_one_streak(name: str) -> None:
    np.testing.assert_allclose(coverage(STREAKS[name]), trapezoid(), atol=0.006)


def test_the_shutter_wider_than_the_data() -> None:
    """Held before the first and after the last sample: at rest for a quarter of the time on each side."""
    rest = [(np.abs((np.arange(4096) + 0.5) / 512 - 4 - c) < 1).reshape(64, 64).mean(axis=1) for c in (-2, 2)]
    text = stage(mesh(more=path()), opens=-0.5, closes=1.5)
    np.testing.assert_allclose(coverage(text), 0.5 * trapezoid() + 0.25 * (rest[0] + rest[1]), atol=0.006)


def test_far_away_and_fast() -> None:
    """1e8 units from the world's origin, camera and all."""
    shift = 1e8
    camera = EYE % shift
    far = path(f"({shift - 2}, 0, 0)", f"({shift + 2}, 0, 0)")
    np.testing.assert_allclose(coverage(stage(mesh(more=far), eye=camera)), trapezoid(), atol=0.006)


def test_a_mirror_that_moves() -> None:
    """At 45 degrees it moves along the view: the edge of a bright wall, seen in it, moves as fast."""
    mirror = GLOW.replace("glow", "mirror").replace("(1, 1, 1)", "(0, 0, 0)").replace(
        "color3f inputs:diffuseColor = (0, 0, 0)",
        "color3f inputs:diffuseColor = (0, 0, 0)\n        int inputs:useSpecularWorkflow = 1\n"
        "        color3f inputs:specularColor = (1, 1, 1)\n        float inputs:roughness = 0",
    )  # fmt: skip
    glass = (
        f'def Mesh "glass" ({BOUND})\n{{\n{QUAD}'.replace("</glow>", "</mirror>")
        + "point3f[] points = [(-30, -9, 30), (30, -9, -30), (30, 9, -30), (-30, 9, 30)]\n"
        + "double3 xformOp:translate.timeSamples = { 0: (0, 0, -42), 1: (0, 0, -38) }\n"
        + ORDER
        + "\n}\n"
    )
    # A ray along -z at x meets the mirror x + z = c at z = c - x, and goes on along +x at that z.
    half = 'def Mesh "wall" (' + BOUND + ")\n{\n" + QUAD
    wall = half + "point3f[] points = [(60, -50, -40), (60, 50, -40), (60, 50, 60), (60, -50, 60)]\n}\n"
    found = render(stage(mirror, glass, wall), 1024).pixels[..., 0].astype(np.float64).mean(axis=0)
    x = (np.arange(4096) + 0.5) / 512 - 4
    crossing = np.clip((x + 2) / 4, 0, 1)  # z = c - x beyond -40 for c > x - 40
    expected = (1 - crossing).reshape(64, 64).mean(axis=1)
    np.testing.assert_allclose(found, expected, atol=0.02)


SAME = {
    "an extra sample on the line": (
        stage(mesh(more=path())),
        stage(mesh(more=path_through("0: (-2, 0, 0), 0.25: (-1, 0, 0), 1: (2, 0, 0)"))),
    ),
    "velocities and two samples": (stage(mesh(SAMPLES)), stage(mesh(VELOCITIES))),
    "half the blur and half the shutter": (
        stage(mesh(more=path() + "\n    float motion:blurScale = 0.5")),
        stage(mesh(more=path()), closes=0.5),
    ),
    "instantaneousShutter and a shutter that closes at once": (
        stage(mesh(more=path()), 'def Scope "Render"\n{\ndef RenderSettings "s"\n{\nuniform bool instantaneousShutter = 1\n'
              "rel camera = </camera>\n}\n}\n", opens=0.25, head='\n    renderSettingsPrimPath = "/Render/s"\n'),
        stage(mesh(more=path()), opens=0.25, closes=0.25),
    ),
    "a closed shutter and the stage at that time": (
        stage(mesh(more=path()), opens=0.25, closes=0.25),
        stage(mesh(more=f"double3 xformOp:translate = (-1, 0, 0)\n    {ORDER}"), closes=0.0),
    ),
    "disableMotionBlur and the frame": (
        stage(mesh(more=path()), 'def Scope "Render"\n{\ndef RenderSettings "s"\n{\nuniform bool disableMotionBlur = 1\n'
              "rel camera = </camera>\n}\n}\n", opens=0.25, head='\n    renderSettingsPrimPath = "/Render/s"\n'),
        stage(mesh(more=f"double3 xformOp:translate = (-2, 0, 0)\n    {ORDER}"), closes=0.0),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", SAME)
def test_the_same_bits(name: str) -> None:
    first, second = (render(text, 16) for text in SAME[name])
    assert first.pixels[..., 3].mean() > 0.1
    np.testing.assert_array_equal(first.pixels, second.pixels)


def test_an_accelerating_edge() -> None:
    """a = 8 units / frame^2 from rest at -4: an edge passes x at t = sqrt((x + 4) / 4)."""
    points = f"""point3f[] points.timeSamples = {{ 0: [{moved(-3)}] }}
    vector3f[] velocities.timeSamples = {{ 0: [(0, 0, 0), (0, 0, 0), (0, 0, 0), (0, 0, 0)] }}
    vector3f[] accelerations.timeSamples = {{ 0: [(4608, 0, 0), (4608, 0, 0), (4608, 0, 0), (4608, 0, 0)] }}"""
    fine = (np.arange(4096) + 0.5) / 512 - 4
    gone = [np.sqrt(np.clip((fine - side + 3) / 4, 0, 1)) for side in (1, -1)]
    expected = (gone[1] - gone[0]).reshape(64, 64).mean(axis=1)
    np.testing.assert_allclose(coverage(stage(mesh(points)), spp=4096), expected, atol=0.01)


def test_ids_of_an_animated_instancer() -> None:
    """Instances born and dying: those of the frame, where USD's rules put them."""
    text = stage(
        INSTANCER.replace("int[] protoIndices = [0]", "int[] protoIndices.timeSamples = { 0: [0], 1: [0, 0] }")
        % "point3f[] positions.timeSamples = { 0: [(-2, 0, 0)], 1: [(2, 0, 0), (3, 0, 0)] }\n"
        "    vector3f[] velocities.timeSamples = { 0: [(96, 0, 0)], 1: [(0, 0, 0), (0, 0, 0)] }"
    )
    np.testing.assert_allclose(coverage(text), trapezoid(), atol=0.006)


LIT_CAMERA = """
def Camera "camera"
{
    token projection = "orthographic"
    float horizontalAperture = 0.01
    float verticalAperture = 0.01
    float2 clippingRange = (0.001, 1000)
    double shutter:open = 0
    double shutter:close = 1
    double3 xformOp:translate = (0, 0.05, 0)
    double xformOp:rotateX = -90
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
}
def Mesh "ground"
{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
    point3f[] points = [(-50, 0, 50), (50, 0, 50), (50, 0, -50), (-50, 0, -50)]
    color3f[] primvars:displayColor = [(1, 1, 1)]
}
"""
LAMPS = {
    "sphere": f"""
def Sphere "lamp" ({BOUND})
{{
    double radius = 0.1
    rel material:binding = </glow>
    {path("(-3, 1, 0)", "(3, 2, 0)")}
}}
""",
    "points": f"""
def Points "lamp" ({BOUND})
{{
    float[] widths = [0.2, 0.2]
    rel material:binding = </glow>
    point3f[] points.timeSamples = {{ 0: [(-3, 1, 0), (0, 2, 1)] }}
    vector3f[] velocities.timeSamples = {{ 0: [(144, 24, 0), (0, 0, 48)] }}
}}
""",
}


@pytest.mark.parametrize("name", LAMPS)
def test_spheres_that_emit_and_move_light_without_noise(name: str) -> None:
    """The mean of pi r^2 L cos / d^2 over their ways, to a tenth of a percent with few samples."""
    head = f"#usda 1.0\n( timeCodesPerSecond = 24 )\n{GLOW}{LIT_CAMERA}"
    pixels = render(head + LAMPS[name], 256, (16, 16)).pixels[..., 1]
    t = ((np.arange(512) + 0.5) / 512)[:, None]
    ways = [np.array([[-3.0, 1, 0]]) * (1 - t) + np.array([[3.0, 2, 0]]) * t]
    if name == "points":
        ways.append(np.array([[0.0, 2, 1]]) + np.array([[0.0, 0, 2]]) * t)
    lit = sum(np.mean(0.01 * c[:, 1] / (c**2).sum(axis=1) ** 1.5) for c in ways)
    albedo = pixels.mean() / lit
    assert albedo == pytest.approx(1.0, rel=2e-3)
    assert pixels.std() < 0.03 * pixels.mean()
