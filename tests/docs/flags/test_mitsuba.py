"""docs/site/from-mitsuba.md is true: what each row names renders without a warning, and its numbers are closed forms."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.main import get_command

import primray
from primray.cli.app import app

PAGE = Path(__file__).resolve().parents[3] / "docs/site/from-mitsuba.md"
TABLE = dict(re.findall(r"^\| (`.*) \| (.*) \|$", PAGE.read_text(encoding="utf-8"), re.MULTILINE))
AWAY = "double3 xformOp:translate = (0, 0, {})\nuniform token[] xformOpOrder = ['xformOp:translate']"
CAMERA = "def Camera 'cam' {{\n{}\n" + AWAY.format(5) + "\n}}\n"
NARROW = "float focalLength = 50\nfloat horizontalAperture = 1\nfloat verticalAperture = 1"
SKY = "def DomeLight 'sky' {\nfloat inputs:intensity = 0.7\n}\n"
QUAD = "int[] faceVertexCounts = [4]\nint[] faceVertexIndices = [0, 1, 2, 3]\n"
QUAD += "point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]"
MESH = f"def Mesh 'quad' {{\n{QUAD}\n}}\n"
HELD = f"def Xform 'held' {{\n{MESH}}}\n"
LINEAR = "def BasisCurves '{}' {{\nuniform token type = '{}'\n{}\nint[] curveVertexCounts = [4]\nfloat[] widths = [0.1] (\n"
LINEAR += "interpolation = 'constant'\n)\npoint3f[] points = [(0, -1, 0), (0, 0, 0), (0, 1, 0), (0, 2, 0)]\n}}\n"


def material(node: str, inputs: str, output: str = "surface") -> str:
    """Bound to a quad."""
    terminal = "outputs:surface" if node == "UsdPreviewSurface" else "outputs:mtlx:surface"
    return (
        f"def Material 'look' {{\ntoken {terminal}.connect = </look/node.outputs:{output}>\n"
        f"def Shader 'node' {{\nuniform token info:id = '{node}'\n{inputs}\ntoken outputs:{output}\n}}\n}}\n"
        f"def Mesh 'quad' (\nprepend apiSchemas = ['MaterialBindingAPI']\n) {{\n{QUAD}\nrel material:binding = </look>\n}}\n"
    )


OPEN_PBR = "ND_open_pbr_surface_surfaceshader"
GREY = material("UsdPreviewSurface", "color3f inputs:diffuseColor = (0.5, 0.5, 0.5)\nfloat inputs:roughness = 1\n"
                "int inputs:useSpecularWorkflow = 1\ncolor3f inputs:specularColor = (0, 0, 0)")  # fmt: skip
# Of each row that names what a stage holds: stages that hold it.
STAGES = {
    '`<shape type="ply">`, `"obj"`': [MESH],
    "`sphere`, `rectangle`, `disk`, `cylinder`": [
        "def Sphere 'a' {\n}\n",
        "def Plane 'a' {\n}\n",
        MESH,
        "def Cylinder 'a' {\n}\n",
    ],
    "`shapegroup` and `instance`": [
        f"def Xform 'set' {{\n{HELD}}}\ndef Xform 'a' (\ninstanceable = true\nreferences = </set/held>\n) {{\n}}\n",
        "def PointInstancer 'many' {\nrel prototypes = </many/held>\nint[] protoIndices = [0]\n"
        f"point3f[] positions = [(0, 0, 0)]\n{HELD}}}\n",
    ],
    "`bsplinecurve`, `linearcurve`": [
        LINEAR.format("a", "cubic", "uniform token basis = 'bspline'"),
        LINEAR.format("a", "linear", ""),
    ],
    "`diffuse`, `roughplastic`, `principled`": [GREY, material(OPEN_PBR, "float inputs:specular_roughness = 0.4", "out")],
    "`dielectric`, `roughconductor`": [
        material(OPEN_PBR, "float inputs:transmission_weight = 1\nfloat inputs:specular_ior = 1.33", "out"),
        material(OPEN_PBR, "float inputs:base_metalness = 1\nfloat inputs:specular_roughness = 0.2", "out"),
    ],
    "`area`": [
        MESH + f"def RectLight 'lamp' {{\n{AWAY.format(9)}\n}}\n",
        MESH + f"def SphereLight 'lamp' {{\n{AWAY.format(9)}\n}}\n",
        material("UsdPreviewSurface", "color3f inputs:emissiveColor = (1, 2, 3)"),
    ],
    "`envmap`, `constant`": [MESH + SKY],
    "`point`": [
        MESH + f"def SphereLight 'lamp' {{\nbool treatAsPoint = true\nbool inputs:normalize = true\n{AWAY.format(9)}\n}}\n"
    ],
    "`directional`": [MESH + "def DistantLight 'lamp' {\nbool inputs:normalize = true\n}\n"],
}
CAMERAS = {
    "`perspective`, `orthographic`": [NARROW, NARROW + "\ntoken projection = 'orthographic'"],
    "`thinlens`": [NARROW + "\nfloat fStop = 2\nfloat focusDistance = 5"],
}
FLAGS = {
    "`film`: `width`, `height`, `rfilter`": ("--res", "--filter"),
    '`integrator type="path"`, `max_depth`': ("--max-depth",),
    "`sampler sample_count`": ("--spp", "--target-error"),
    "`aov` integrator": ("--aov",),
}
ELSEWHERE = {
    "`hair`": "tests/images/hair",
    "`mi.render(scene, spp=64)`": "here",
}


def rendered(folder: Path, body: str, camera: str = NARROW, **settings: Any) -> primray.Image:
    stage = folder / "stage.usda"
    stage.write_text(f'#usda 1.0\n(\nupAxis = "Y"\nmetersPerUnit = 1\n)\n{CAMERA.format(camera)}{body}'.replace("'", '"'))
    return primray.render(stage, **{"resolution": (8, 8), "spp": 4, "progress": False, **settings})


def mean(image: primray.Image) -> float:
    return float(np.asarray(image)[..., :3].mean())


def test_every_row_is_held() -> None:
    held = {**STAGES, **CAMERAS, **FLAGS, **ELSEWHERE}
    assert list(TABLE) == [row for row in TABLE if row in held]
    assert set(held) == set(TABLE)


@pytest.mark.parametrize(("row", "body"), [(row, body) for row, bodies in STAGES.items() for body in bodies])
def test_what_a_row_names_renders(row: str, body: str, tmp_path: Path) -> None:
    image = rendered(tmp_path, body)
    assert [told for told in image.report["diagnostics"] if told["severity"] != "info"] == []
    assert (np.asarray(image)[..., 3] > 0).any(), "there is something in the picture"


@pytest.mark.parametrize(("row", "camera"), [(row, camera) for row, cameras in CAMERAS.items() for camera in cameras])
def test_cameras_render(row: str, camera: str, tmp_path: Path) -> None:
    image = rendered(tmp_path, MESH + SKY, camera)
    assert {told["code"] for told in image.report["diagnostics"]} == {"camera-chosen"}


def test_flags_are_there() -> None:
    command = get_command(app).get_command(None, "render")  # type: ignore[attr-defined]
    known = {flag for param in command.params for flag in param.opts}
    for row, flags in FLAGS.items():
        assert set(flags) <= known
        assert all(f"`{flag}" in TABLE[row] for flag in flags)
    filters = re.findall(r"`([a-z-]+)`", TABLE["`film`: `width`, `height`, `rfilter`"].partition("(")[2])
    assert set(filters) == {each.value for each in primray.Filter}


def test_radiance_of_domes_and_areas(tmp_path: Path) -> None:
    assert mean(rendered(tmp_path, SKY)) == pytest.approx(0.7, rel=1e-6)
    turned = "def RectLight 'lamp' {\nfloat inputs:intensity = 0.7\ndouble xformOp:rotateY = 180\n"
    turned += "uniform token[] xformOpOrder = ['xformOp:rotateY']\n}\n"
    assert mean(rendered(tmp_path, turned)) == pytest.approx(0.7, rel=1e-6)
    emissive = material(
        "UsdPreviewSurface", "color3f inputs:emissiveColor = (0.7, 0.7, 0.7)\ncolor3f inputs:diffuseColor = (0, 0, 0)"
    )
    assert mean(rendered(tmp_path, emissive, default_light=False)) == pytest.approx(0.7, rel=1e-6)


def test_irradiance_of_a_directional_light(tmp_path: Path) -> None:
    lamp = "def DistantLight 'lamp' {\nbool inputs:normalize = true\nfloat inputs:intensity = 2\n}\n"
    assert mean(rendered(tmp_path, GREY + lamp)) == pytest.approx(2 * 0.5 / math.pi, rel=1e-3)


def test_intensity_of_a_point(tmp_path: Path) -> None:
    """I / r^2 arrives at r = 4 where USD says 4 I."""
    lamp = "def SphereLight 'lamp' {\nbool treatAsPoint = true\nbool inputs:normalize = true\nfloat inputs:intensity = 12\n"
    lamp += "float inputs:radius = 0.25\n" + AWAY.format(4) + "\n}\n"
    assert mean(rendered(tmp_path, GREY + lamp, spp=16)) == pytest.approx(3 / 4**2 * 0.5 / math.pi, rel=1e-3)


def test_direct_light_is_depth_one(tmp_path: Path) -> None:
    """In the open, all light is direct; in a room, more comes from its walls."""
    lamp = "def SphereLight 'lamp' {\nfloat inputs:intensity = 100\n" + AWAY.format(10) + "\n}\n"
    room = "def Sphere 'room' {\ndouble radius = 50\ncolor3f[] primvars:displayColor = [(0.9, 0.9, 0.9)]\n}\n"
    direct, everything = (mean(rendered(tmp_path, GREY + lamp + room, max_depth=depth, spp=64)) for depth in (1, None))
    assert everything > 1.05 * direct
    assert direct == pytest.approx(mean(rendered(tmp_path, GREY + lamp, spp=64)), rel=1e-2)


def test_angle_and_lens_of_a_camera(tmp_path: Path) -> None:
    """fov of 40 degrees; an aperture of radius 0.05 units at 50 tenths of a unit."""
    focal = 24 / (2 * math.tan(math.radians(40) / 2))
    camera = rendered(
        tmp_path, MESH, f"float focalLength = {focal}\nfloat horizontalAperture = 24\nfloat verticalAperture = 24"
    ).camera
    assert camera is not None
    left, right, _, _ = camera.window
    assert 2 * math.degrees(math.atan((right - left) / 2)) == pytest.approx(40, rel=1e-5)
    lens = rendered(tmp_path, MESH, f"{NARROW}\nfloat fStop = {50 / (20 * 0.05)}\nfloat focusDistance = 5").camera
    assert lens is not None
    assert lens.lens_radius == pytest.approx(0.05, rel=1e-6)


def test_as_mi_render(tmp_path: Path) -> None:
    assert rendered(tmp_path, MESH + SKY, spp=64).report["samples_per_pixel"] == [64, 64]
