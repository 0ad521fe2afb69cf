"""Lights under instancers: each instance's light is the one that would stand there by itself."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from pxr import Gf

from primray.description import Light
from primray.usd.lights.assembly import MAX_LIGHT_INSTANCES

from ..usd_text import translate_text

KINDS = ("SphereLight", "DiskLight", "RectLight", "CylinderLight", "DistantLight", "DomeLight")
INPUTS = """
        bool inputs:normalize = {normalize}
        float inputs:intensity = 7
        color3f inputs:color = (1, 0.5, 0.25)
        bool inputs:shadow:enable = 0
        {sizes}
"""
SIZES = {
    "SphereLight": "float inputs:radius = 0.3",
    "DiskLight": "float inputs:radius = 0.4",
    "RectLight": "float inputs:width = 0.7\n float inputs:height = 0.2",
    "CylinderLight": "float inputs:radius = 0.1\n float inputs:length = 2",
    "DistantLight": "float inputs:angle = 3",
    "DomeLight": "",
}
# Instancer, instance, prototype and light all have a transform; none is a rotation alone.
OUTER = """double3 xformOp:translate = (1, 2, 3)
    float3 xformOp:scale = (1, 3, 1)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]"""
INNER = """float3 xformOp:rotateXYZ = (10, 20, 30)
    float3 xformOp:scale = (0.5, 1, 2)
    uniform token[] xformOpOrder = ["xformOp:rotateXYZ", "xformOp:scale"]"""
BULB = """float3 xformOp:rotateXYZ = (0, 50, -20)
    double3 xformOp:translate = (0.1, 0, 0.4)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]"""

POINTS = """
def PointInstancer "outer"
{{
    {outer}
    int[] protoIndices = [0, 0, 0]
    point3f[] positions = [(0, 0, 0), (4, 0, 0), (0, 5, 0)]
    quatf[] orientationsf = [(1, 0, 0, 0), (0.8, 0.6, 0, 0), (0.6, 0, 0.48, 0.64)]
    float3[] scales = [(1, 1, 1), (2, 1, 0.5), (-1, 1, 3)]
    rel prototypes = </outer/lamp>
    def Xform "lamp"
    {{
        {inner}
        def {kind} "bulb"
        {{
            {bulb}
            {inputs}
        }}
    }}
}}
"""
NATIVE = """
class Xform "lamp"
{{
    {inner}
    def {kind} "bulb"
    {{
        {bulb}
        {inputs}
    }}
}}
class Xform "pair"
{{
    def Xform "one" (
        instanceable = true
        references = </lamp>
    )
    {{
    }}
    def Xform "two" (
        instanceable = true
        references = </lamp>
    )
    {{
        double3 xformOp:translate:more = (0, 0, 1)
        uniform token[] xformOpOrder = ["xformOp:translate:more", "xformOp:rotateXYZ", "xformOp:scale"]
    }}
}}
def Xform "p" (
    instanceable = true
    references = </pair>
)
{{
    {outer}
}}
def Xform "q" (
    instanceable = true
    references = </pair>
)
{{
}}
"""


def lights(text: str, kind: str, normalize: bool) -> list[Light]:
    inputs = INPUTS.format(normalize=int(normalize), sizes=SIZES[kind])
    d, found = translate_text(text.format(outer=OUTER, inner=INNER, bulb=BULB, kind=kind, inputs=inputs))
    assert {code for code, _ in found} <= {"camera-automatic"}
    return list(d.lights)


def alone(matrix: np.ndarray, kind: str, normalize: bool) -> Light:
    """The light with that matrix as its only transform."""
    m = ", ".join("(" + ", ".join(repr(float(v)) for v in row) + ")" for row in matrix.T)
    transform = f'matrix4d xformOp:transform = ({m})\nuniform token[] xformOpOrder = ["xformOp:transform"]'
    inputs = INPUTS.format(normalize=int(normalize), sizes=SIZES[kind])
    d, _ = translate_text(f'def {kind} "bulb"\n{{\n{transform}\n{inputs}\n}}\n')
    return d.lights[0]


def scale(x: float, y: float, z: float) -> Gf.Matrix4d:
    return Gf.Matrix4d(1).SetScale(Gf.Vec3d(x, y, z))


def turn(x: float, y: float, z: float) -> Gf.Matrix4d:
    m = Gf.Matrix4d(1)
    for axis, angle in ((Gf.Vec3d.XAxis(), x), (Gf.Vec3d.YAxis(), y), (Gf.Vec3d.ZAxis(), z)):
        m = m * Gf.Matrix4d(1).SetRotate(Gf.Rotation(axis, angle))
    return m


def move(x: float, y: float, z: float) -> Gf.Matrix4d:
    return Gf.Matrix4d(1).SetTranslate(Gf.Vec3d(x, y, z))


LAMP = turn(0, 50, -20) * move(0.1, 0, 0.4) * scale(0.5, 1, 2) * turn(10, 20, 30)
HALL = scale(1, 3, 1) * move(1, 2, 3)


def by_points() -> list[np.ndarray]:
    quaternions = [Gf.Quatd(1, 0, 0, 0), Gf.Quatd(0.8, 0.6, 0, 0), Gf.Quatd(0.6, 0, 0.48, 0.64)]
    at, sizes = [(0, 0, 0), (4, 0, 0), (0, 5, 0)], [(1, 1, 1), (2, 1, 0.5), (-1, 1, 3)]
    turns = [Gf.Matrix4d(1).SetRotate(q) for q in quaternions]
    return [np.array(LAMP * scale(*s) * r * move(*p) * HALL).T for p, r, s in zip(at, turns, sizes, strict=True)]


def by_instances() -> list[np.ndarray]:
    return [np.array(LAMP * inner * outer).T for outer in (HALL, Gf.Matrix4d(1)) for inner in (Gf.Matrix4d(1), move(0, 0, 1))]


def same(found: Light, expected: Light) -> bool:
    numbers = [f.name for f in dataclasses.fields(Light) if isinstance(getattr(expected, f.name), float | tuple)]
    return (
        found.type is expected.type
        and found.shadow == expected.shadow
        and np.allclose(found.world_from_light, expected.world_from_light, rtol=1e-6, atol=1e-6)
        and all(np.allclose(getattr(found, n), getattr(expected, n), rtol=1e-5) for n in numbers)
    )


@pytest.mark.parametrize("normalize", [False, True])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("text", "places"), [(POINTS, by_points()), (NATIVE, by_instances())], ids=["points", "native"])
def test_each_is_as_if_alone(text: str, places: list[np.ndarray], kind: str, normalize: bool) -> None:
    found = lights(text, kind, normalize)
    expected = [alone(m, kind, normalize) for m in places]
    assert len(found) == len(expected)
    for x in expected:
        assert sum(same(y, x) for y in found) == 1
    if normalize and kind not in ("DistantLight", "DomeLight"):
        assert len({round(x.emission[0], 6) for x in found}) > 1


def test_instancers_of_instances() -> None:
    """A point instancer of a native instance that holds a point instancer of a light."""
    text = """
class Xform "asset"
{
    def PointInstancer "inner"
    {
        int[] protoIndices = [0, 0]
        point3f[] positions = [(0, 0, 1), (0, 0, 2)]
        rel prototypes = </asset/inner/bulb>
        def RectLight "bulb"
        {
            bool inputs:normalize = 1
        }
    }
}
def PointInstancer "outer"
{
    int[] protoIndices = [0, 0, 0]
    point3f[] positions = [(10, 0, 0), (20, 0, 0), (30, 0, 0)]
    float3[] scales = [(1, 1, 1), (2, 1, 1), (2, 3, 1)]
    rel prototypes = </outer/copy>
    def Xform "copy" (
        instanceable = true
        inherits = </asset>
    )
    {
    }
}
"""
    d, _ = translate_text(text)
    found = sorted((*x.world_from_light[:3, 3].tolist(), round(x.emission[0], 5)) for x in d.lights)
    assert found == [(x, 0, z, round(e, 5)) for x, e in ((10, 1), (20, 1 / 2), (30, 1 / 6)) for z in (1, 2)]


def test_many_instances_are_all_lit() -> None:
    count = 3000
    assert MAX_LIGHT_INSTANCES >= 100_000
    text = f"""
def PointInstancer "p"
{{
    int[] protoIndices = [{", ".join(["0"] * count)}]
    point3f[] positions = [{", ".join(f"({k}, 0, 0)" for k in range(count))}]
    rel prototypes = </p/bulb>
    def SphereLight "bulb"
    {{
    }}
}}
"""
    d, found = translate_text(text)
    assert sorted(x.world_from_light[0, 3] for x in d.lights) == list(range(count))
    assert {code for code, _ in found} == {"camera-automatic"}
