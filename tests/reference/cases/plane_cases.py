"""The table of cases: a light, or several, over a plane. Names are rows of docs/light-accuracy.md."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Usd
from tests.reference.stages import Plane, light, rotation, scaling, stage, transform, translation
from tests.reference.textures import write_picture

Asset = str | np.ndarray  # a text, or a picture (H, W, 3)

ABOVE = translation(0.3, 1.4, -0.4) @ rotation([1, 0.2, 0.3], -80)
DOWN = translation(0.2, 0.9, 0.1) @ rotation([1, 0, 0], -90)
SHEAR = np.array([[1, 0.6, 0.2, 0], [0, 1.2, 0.4, 0], [0, 0, 0.7, 0], [0, 0, 0, 1.0]])
STRETCH = scaling(1.6, 0.5, 0.8)
MIRROR = scaling(-1, 1, 1)
UPRIGHT = rotation([0, 1, 0], 180)  # shines along +Z
FLAT = rotation([1, 0, 0], -90)  # shines down
STANDING = rotation([0, 0, 1], 90)  # a cylinder on its end


@dataclass(frozen=True, eq=False)
class Case:
    group: str
    name: str
    prims: str
    rows: tuple[str, ...]  # of the conformance table
    plane: Plane = field(default_factory=Plane)
    spp: int = 256  # of each seed
    times: int = 1  # as many in the long test, where its mean is to be known to 3e-4
    up: str = "Y"
    quick: bool = True  # looked at in every run of the tests
    assets: Mapping[str, Asset] = field(default_factory=dict)  # files named in prims as @ASSETS/name@

    @property
    def resolution(self) -> tuple[int, int]:
        """Of the long test: fewer pixels where the referee has much to do."""
        if any(name.endswith(".ies") for name in self.assets):
            return (9, 6)
        return (12, 8) if self.assets or self.group in ("Shaping", "Mesh") else (24, 16)

    @property
    def id(self) -> str:
        return f"{self.group}: {self.name}"

    def stage(self, folder: Path) -> Usd.Stage:
        """With its files in `folder`."""
        for name, content in self.assets.items():
            if isinstance(content, str):
                (folder / name).write_text(content, encoding="ascii")
            else:
                write_picture(folder / name, content)
        return stage(self.prims.replace("ASSETS", str(folder)), self.plane, self.up)


def inputs(**values: object) -> list[str]:
    """Lines of a light: name=1.5 or name=True; colours as three numbers."""
    return [f"{_TYPES.get(type(v), 'float')} inputs:{k.replace('__', ':')} = {_text(v)}" for k, v in values.items()]


_TYPES: dict[type, str] = {bool: "bool", tuple: "color3f", float: "float", int: "float"}


def _text(v: object) -> str:
    return str(v).lower() if isinstance(v, bool) else repr(v)


def at(group: str, name: str, kind: str, m: np.ndarray, *rows: str, spp: int = 256, times: int = 1,
       plane: Plane | None = None, quick: bool = True, lines: Sequence[str] = (), apis: Sequence[str] = (),
       assets: Mapping[str, Asset] | None = None, up: str = "Y", **values: object) -> Case:  # fmt: skip
    text = light(kind, m, *inputs(**values), *lines, apis=apis)
    return Case(group, name, text, rows, plane or Plane(), spp, times, up, quick, assets or {})


def sphere_cases() -> list[Case]:
    g, k, r = "Sphere", "SphereLight", ("SphereLight.inputs:radius",)
    n = ("LightAPI.inputs:normalize",)
    return [
        at(g, "plain", k, ABOVE, *r, radius=0.4),
        at(g, "normalize", k, ABOVE, *r, *n, radius=0.4, normalize=True, intensity=3.0),
        at(g, "stretched, sheared, normalize", k, ABOVE @ STRETCH @ SHEAR, *r, *n, radius=0.4, normalize=True),
        at(g, "mirrored", k, ABOVE @ MIRROR @ STRETCH, *r, radius=0.4),
        at(g, "close to the plane", k, translation(0.2, 0.45, 0.1), *r, radius=0.4, spp=1024),
        at(g, "through the plane, beside", k, translation(-2.2, 0.1, 0.1), *r, radius=0.5, spp=1024, times=4),
        at(g, "half below the horizon", k, translation(-3.4, -0.2, 0) @ scaling(0.5, 2, 3), *r, radius=0.5, spp=1024),
        at(g, "radius 1e-6, normalize", k, ABOVE, *r, *n, radius=1e-6, normalize=True),
        at(g, "radius 1e6, its surface 0.5 above", k, translation(0, 1000000.5, 0), *r, radius=1e6),
        at(g, "1e6 away, radius 1e5", k, translation(6e5, 8e5, 0), *r, radius=1e5),
        at(g, "treatAsPoint, normalize", k, ABOVE, "SphereLight.treatAsPoint", *n, radius=0.4, normalize=True,
           lines=["bool treatAsPoint = true"]),
        at(g, "treatAsPoint", k, ABOVE, "SphereLight.treatAsPoint", radius=0.4, lines=["bool treatAsPoint = true"]),
    ]  # fmt: skip


def disk_cases() -> list[Case]:
    g, k, r = "Disk", "DiskLight", ("DiskLight.inputs:radius",)
    n = ("LightAPI.inputs:normalize",)
    return [
        at(g, "plain", k, ABOVE, *r, radius=0.6, times=4),
        at(g, "stretched, sheared, normalize", k, ABOVE @ STRETCH @ SHEAR, *r, *n, radius=0.6, normalize=True, times=4),
        at(g, "mirrored across its plane", k, ABOVE @ rotation([1, 0, 0], 180) @ scaling(1, 0.8, -1), *r, radius=0.6, times=4),
        at(g, "facing away", k, ABOVE @ UPRIGHT, *r, radius=0.6),
        at(g, "upright, standing on the plane", k, translation(0, 0.5, -1.7) @ UPRIGHT, *r, radius=0.5, spp=2048),
        at(g, "upright, half below the plane", k, translation(0, 0.0, -1.7) @ UPRIGHT, *r, radius=0.5, spp=2048),
        at(g, "radius 1e6, 0.5 above", k, translation(0, 0.5, 0) @ FLAT, *r, radius=1e6),
        at(g, "radius 1e-6, normalize", k, ABOVE, *r, *n, radius=1e-6, normalize=True),
    ]  # fmt: skip


def rect_cases() -> list[Case]:
    g, k, r = "Rect", "RectLight", ("RectLight.inputs:width", "RectLight.inputs:height")
    n = ("LightAPI.inputs:normalize",)
    return [
        at(g, "plain", k, ABOVE, *r, width=1.2, height=0.7),
        at(g, "stretched, sheared, normalize", k, ABOVE @ STRETCH @ SHEAR, *r, *n, width=1.2, height=0.7, normalize=True),
        at(g, "mirrored", k, ABOVE @ MIRROR, *r, width=1.2, height=0.7),
        at(g, "upright, standing on the plane", k, translation(0, 0.5, -1.7) @ UPRIGHT, *r, width=2.0, height=1.0, spp=2048),
        at(g, "leaning, through the plane", k, translation(0, 0.2, -1.9) @ UPRIGHT @ rotation([1, 0, 0], 30), *r,
           width=2.0, height=1.0, spp=2048),
        at(g, "0.05 above the plane", k, translation(0, 0.05, 0) @ FLAT, *r, width=1.0, height=0.6, spp=2048),
        at(g, "1e6 by 1e6", k, translation(0, 0.5, 0) @ FLAT, *r, width=1e6, height=1e6),
        at(g, "1e6 away", k, rotation([1, 0, 0.3], -60) @ translation(0, 0, 1e6), *r, width=4e5, height=1e5),
        at(g, "1000 by 0.001", k, DOWN, *r, width=1e3, height=1e-3, spp=1024, quick=False),
    ]  # fmt: skip


def cylinder_cases() -> list[Case]:
    g, k, r = "Cylinder", "CylinderLight", ("CylinderLight.inputs:radius", "CylinderLight.inputs:length")
    n = ("LightAPI.inputs:normalize",)
    return [
        at(g, "plain", k, ABOVE, *r, radius=0.2, length=1.5, spp=512),
        at(g, "normalize", k, ABOVE, *r, *n, radius=0.2, length=1.5, normalize=True, spp=512),
        at(g, "stretched, sheared, normalize", k, ABOVE @ STRETCH @ SHEAR, *r, *n, radius=0.2, length=1.5, normalize=True,
           spp=1024),
        at(g, "mirrored", k, ABOVE @ MIRROR @ STRETCH, *r, radius=0.2, length=1.5, spp=512),
        at(g, "upright, standing on the plane", k, translation(-2, 0.5, 0) @ STANDING, *r, radius=0.3, length=1.0, spp=2048),
        at(g, "along the plane, half below", k, translation(0, 0.1, -1.8), *r, radius=0.3, length=2.0, spp=2048),
        at(g, "upright overhead: no caps", k, translation(0, 1.2, 0) @ STANDING, *r, radius=0.4, length=0.5, spp=1024),
        at(g, "radius 1e-4, length 100", k, DOWN, *r, radius=1e-4, length=100.0, spp=1024),
    ]  # fmt: skip


def distant_cases() -> list[Case]:
    g, k, r = "Distant", "DistantLight", ("DistantLight.inputs:angle", "DistantLight.inputs:intensity")
    n = ("LightAPI.inputs:normalize",)
    angles = (0.0, 1e-3, 0.53, 10.0, 120.0, 180.0, 181.0, 300.0, 359.0)
    plain = [at(g, f"angle {a:g}", k, ABOVE, *r, angle=a, intensity=2.0, spp=1024) for a in angles]
    normal = [
        at(g, f"angle {a:g}, normalize", k, ABOVE, *r, *n, angle=a, intensity=2.0, normalize=True, spp=1024) for a in angles
    ]
    low = translation(0, 0, 0) @ rotation([0, 1, 0], 25) @ rotation([1, 0, 0], -3)
    return [
        *plain,
        *normal,
        at(g, "defaults", k, ABOVE, *r),
        at(g, "stretched, sheared, mirrored", k, ABOVE @ STRETCH @ SHEAR @ MIRROR, *r, angle=20.0, intensity=2.0, spp=1024),
        at(g, "3 degrees over the horizon, angle 10", k, low, *r, angle=10.0, intensity=2.0, spp=1024),
    ]


def control_cases() -> list[Case]:
    """What all lights share."""
    g, k = "LightAPI", "RectLight"
    r: dict[str, Any] = {"width": 1.2, "height": 0.7}
    a = "LightAPI.inputs:"
    return [
        at(g, "intensity, exposure", k, ABOVE, a + "intensity", a + "exposure", intensity=3.5, exposure=-1.3, **r),
        at(g, "color", k, ABOVE, a + "color", color=(0.9, 0.3, 0.05), **r),
        at(g, "temperature 3000", k, ABOVE, a + "colorTemperature", a + "enableColorTemperature", colorTemperature=3000.0,
           enableColorTemperature=True, color=(0.5, 1.0, 0.8), **r),
        at(g, "temperature not enabled", k, ABOVE, a + "enableColorTemperature", colorTemperature=3000.0, **r),
        at(g, "diffuse 0.3", k, ABOVE, a + "diffuse", diffuse=0.3, **r),
    ]  # fmt: skip


def dome_cases() -> list[Case]:
    g, k = "Dome", "DomeLight"
    return [at(g, "constant", k, ABOVE, "LightAPI.inputs:intensity", intensity=0.7, spp=64)]


def placed_cases() -> list[Case]:
    g = "Placed"
    inner = light("SphereLight", translation(0.2, 0, 0) @ scaling(1, 0.5, 1), *inputs(radius=0.3), name="bulb")
    nested = light("Xform", ABOVE @ SHEAR, name="outer", within=light("Xform", STRETCH, name="middle", within=inner))
    instanced = f'class "lamp" {{\n{inner}}}\n' + "".join(
        f'def Xform "lamp{i}" (instanceable = true\n inherits = </lamp>) {{\n{transform(m)}\n}}\n'
        for i, m in enumerate([ABOVE, translation(-0.8, 1.1, 0.3) @ STRETCH])
    )
    points = f"""
def PointInstancer "lamps" {{
    {transform(translation(0, 0.2, 0))}
    rel prototypes = [</lamps/bulb>]
    int[] protoIndices = [0, 0, 0]
    point3f[] positions = [(0.5, 1, 0), (-0.7, 1.2, 0.4), (0, 0.8, -0.6)]
    quath[] orientations = [(1, 0, 0, 0), (0.7071, 0.7071, 0, 0), (0.5, 0.5, 0.5, 0.5)]
    float3[] scales = [(1, 1, 1), (0.5, 1, 2), (2, 1, 1)]
{inner}}}
"""
    row = ("SphereLight.inputs:radius",)
    return [Case(g, "under two scaled Xforms", nested, row), Case(g, "instances", instanced, row, spp=512),
            Case(g, "point instancer", points, row, spp=512)]  # fmt: skip
