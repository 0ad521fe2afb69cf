"""Cases of domes, of pictures on rects and domes, and of meshes that are lights."""

from __future__ import annotations

from typing import Any

import numpy as np
from tests.reference.cases.plane_cases import ABOVE, FLAT, MIRROR, SHEAR, STRETCH, Case, at
from tests.reference.domes import CROSS_FACE
from tests.reference.stages import Plane, rotation, scaling, translation

# Planes that look to all sides, so that a dome's orientation shows.
FACING = {
    "up": np.eye(4),
    "+X": rotation([0, 0, 1], -90),
    "-Z, tilted": rotation([1, 0.2, 0], -70),
}
RECT = ("RectLight.inputs:texture:file",)


def sky(height: int = 8) -> np.ndarray:
    """Unlike in every direction; its first and last rows, which meet at the poles, are even."""
    p = np.random.default_rng(8).random((height, 2 * height, 3)) ** 4
    p[0], p[-1] = p[0].mean(axis=0), p[-1].mean(axis=0)
    return p


def smooth(size: int = 96) -> np.ndarray:
    """A picture for balls: waves of unlike colours, even at the rim, since the text is silent on what lies beyond it."""
    t, s = np.meshgrid((np.arange(size) + 0.5) / size, (np.arange(size) + 0.5) / size, indexing="ij")
    waves = np.stack([1 + np.sin(4 * s + 1), 1 + np.cos(5 * t), 1 + np.sin(3 * s + 4 * t)], axis=-1) / 2
    inside = np.clip((0.93 - np.hypot(2 * s - 1, 2 * t - 1)) / 0.2, 0, 1)[..., None]
    return 0.6 + (waves - 0.6) * inside


def cross(size: int = CROSS_FACE) -> np.ndarray:
    """A vertical cross, 3 x 4 faces; what is between its arms is never to be seen."""
    t, s = np.meshgrid(np.linspace(0, 4, 4 * size), np.linspace(0, 3, 3 * size), indexing="ij")
    p = np.stack([1 + np.sin(2 * s), 1 + np.cos(3 * t), 1 + np.sin(s + 2 * t)], axis=-1) / 2
    for row in range(4):
        for column in range(3):
            if row != 1 and column != 1:
                p[row * size : (row + 1) * size, column * size : (column + 1) * size] = 1000
    return p


def pictured_cases() -> list[Case]:
    return [*dome_cases(), *rect_picture_cases(), *mesh_cases()]


def dome_cases() -> list[Case]:
    g, file, form = "Dome", "DomeLight.inputs:texture:file", "DomeLight.inputs:texture:format"
    turned = rotation([1, 2, -1], 70)
    made = [at(g, "constant", "DomeLight", ABOVE, "LightAPI.inputs:intensity", intensity=0.7, spp=64)]

    def pictured(name: str, kind: str, m: np.ndarray, plane: str, *rows: str, form: str = "latlong", up: str = "Y",
                 more: tuple[str, ...] = (), picture: np.ndarray | None = None, quick: bool = False) -> Case:  # fmt: skip
        lines = ["asset inputs:texture:file = @ASSETS/sky.exr@", f'token inputs:texture:format = "{form}"', *more]
        asset = {"sky.exr": sky() if picture is None else picture}
        return at(g, f"{name}, plane {plane}", kind, m, *rows, lines=lines, assets=asset, plane=Plane(FACING[plane]), up=up,
                  spp=1024, quick=quick)  # fmt: skip

    for plane in FACING:
        made.append(pictured("lat-long", "DomeLight", np.eye(4), plane, file, form, quick=plane == "up"))
        made.append(pictured("lat-long, turned", "DomeLight", turned, plane, file))
    made += [
        pictured("lat-long, mirrored", "DomeLight", turned @ MIRROR, "+X", file),
        pictured("lat-long, Z-up stage", "DomeLight", np.eye(4), "-Z, tilted", file, up="Z"),
        pictured("DomeLight_1, Z-up stage", "DomeLight_1", turned, "+X", "DomeLight_1.poleAxis", up="Z"),
        pictured("DomeLight_1, Y-up stage", "DomeLight_1", turned, "+X", "DomeLight_1.poleAxis"),
        pictured("DomeLight_1, pole Z", "DomeLight_1", turned, "-Z, tilted", "DomeLight_1.poleAxis",
                 more=('uniform token poleAxis = "Z"',)),
        pictured("DomeLight_1, pole Y, Z-up stage", "DomeLight_1", turned, "-Z, tilted", "DomeLight_1.poleAxis", up="Z",
                 more=('uniform token poleAxis = "Y"',)),
    ]  # fmt: skip
    for name, picture in (("mirroredBall", smooth()), ("angular", smooth()), ("cubeMapVerticalCross", cross())):
        for plane in FACING:
            m = turned if plane == "+X" else np.eye(4)
            made.append(pictured(name, "DomeLight", m, plane, form, form=name, picture=picture))
    return made


def rect_picture_cases() -> list[Case]:
    g = "Rect"
    picture = np.random.default_rng(9).random((5, 7, 3)) ** 3
    lines, assets = ["asset inputs:texture:file = @ASSETS/picture.exr@"], {"picture.exr": picture}
    size: dict[str, Any] = {"width": 1.2, "height": 0.7}
    near = translation(0, 0.25, 0) @ FLAT @ rotation([0, 0, 1], 20)
    return [
        at(g, "picture", "RectLight", ABOVE, *RECT, lines=lines, assets=assets, spp=1024, **size),
        at(g, "picture, 0.25 above", "RectLight", near, *RECT, lines=lines, assets=assets, spp=4096, times=4, quick=False,
           **size),
        at(g, "picture, sheared, mirrored, normalize", "RectLight", ABOVE @ STRETCH @ SHEAR @ MIRROR, *RECT, lines=lines,
           assets=assets, spp=1024, normalize=True, **size),
        at(g, "picture, color, cone, focus", "RectLight", ABOVE, *RECT, apis=["ShapingAPI"], assets=assets, spp=1024, times=4,
           quick=False, lines=[*lines, "float inputs:shaping:cone:angle = 45", "float inputs:shaping:cone:softness = 0.4",
                  "float inputs:shaping:focus = 2"], color=(0.5, 1.0, 0.2), **size),
    ]  # fmt: skip


def mesh_cases() -> list[Case]:
    g, mode = "Mesh", "LightAPI.light:materialSyncMode"
    cube = """
    int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
    int[] faceVertexIndices = [0, 1, 3, 2, 4, 6, 7, 5, 0, 4, 5, 1, 2, 3, 7, 6, 0, 2, 6, 4, 1, 5, 7, 3]
    point3f[] points = [(-1, -1, -1), (-1, -1, 1), (-1, 1, -1), (-1, 1, 1), (1, -1, -1), (1, -1, 1), (1, 1, -1), (1, 1, 1)]
    uniform token subdivisionScheme = "none"
    """
    square = """
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-1, -1, 0), (-1, 1, 0), (1, 1, 0), (1, -1, 0)]
    uniform token subdivisionScheme = "none"
    """
    small = ABOVE @ scaling(0.3, 0.4, 0.3)

    own = 'uniform token light:materialSyncMode = "noMaterialResponse"'

    def mesh(name: str, m: np.ndarray, shape: str, *more: str, **values: Any) -> Case:
        return at(
            g,
            name,
            "Mesh",
            m,
            mode,
            lines=[shape, *more],
            apis=["MeshLightAPI"],
            spp=2048,
            times=8,
            quick=name == "cube without a material",
            **values,
        )

    return [
        mesh("cube", small, cube, own, intensity=2.0),
        mesh("cube without a material", small, cube, intensity=2.0),
        mesh("cube, stretched, sheared, normalize", small @ STRETCH @ SHEAR, cube, own, intensity=2.0, normalize=True),
        mesh("cube, mirrored", small @ MIRROR, cube, own, intensity=2.0),
        mesh("square facing the plane", small, square, own, intensity=2.0, color=(1.0, 0.5, 0.2)),
        mesh(
            "square, exposure, temperature",
            small,
            square,
            own,
            exposure=1.5,
            colorTemperature=4000.0,
            enableColorTemperature=True,
        ),
    ]
