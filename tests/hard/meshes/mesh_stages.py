"""Stages made of meshes as text, and their pictures: what hard cases of meshes share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from tests.unit.usd.usd_text import stage_of

import primray
from primray import Filter, Image, RenderSettings

Faces = Sequence[Sequence[int]]

DOME = 'def DomeLight "sky"\n{\n}\n'


def rows(values: npt.ArrayLike) -> str:
    """Vectors as an array's text, exact in float."""
    return "[" + ", ".join("(" + ", ".join(f"{x:.9g}" for x in row) + ")" for row in np.asarray(values)) + "]"


def numbers(values: Sequence[int]) -> str:
    return "[" + ", ".join(map(str, values)) + "]"


def place(matrix: npt.ArrayLike | None) -> str:
    """A world_from_object matrix (4, 4) as an xformOp, or nothing."""
    if matrix is None:
        return ""
    columns = ", ".join("(" + ", ".join(f"{x:.17g}" for x in row) + ")" for row in np.asarray(matrix, np.float64).T)
    return f'matrix4d xformOp:transform = ({columns})\nuniform token[] xformOpOrder = ["xformOp:transform"]\n'


def prim(kind: str, name: str, *lines: str) -> str:
    return f'def {kind} "{name}"\n{{\n' + "\n".join(lines) + "\n}\n"


def mesh_prim(
    points: npt.ArrayLike,
    faces: Faces,
    *more: str,
    name: str = "mesh",
    normals: npt.ArrayLike | None = None,
    scheme: str = "none",
    color: float | tuple[float, float, float] = 0.5,
    matrix: npt.ArrayLike | None = None,
) -> str:
    """`more`: further lines of the prim; `normals`: a vertex each."""
    rgb = color if isinstance(color, tuple) else (color,) * 3
    lines = [
        f"int[] faceVertexCounts = {numbers([len(f) for f in faces])}",
        f"int[] faceVertexIndices = {numbers([v for f in faces for v in f])}",
        f"point3f[] points = {rows(points)}",
        f'uniform token subdivisionScheme = "{scheme}"',
        f"color3f[] primvars:displayColor = {rows([rgb])}",
    ]
    if normals is not None:
        lines.append(f'normal3f[] normals = {rows(normals)} (\n    interpolation = "vertex"\n)')
    return prim("Mesh", name, *lines, place(matrix), *more)


def camera_prim(matrix: npt.ArrayLike, half: float, *, orthographic: bool = False) -> str:
    """A square film; `half`: tangent of half the field of view, or half the film in scene units."""
    aperture = 20 * half if orthographic else 100 * half  # tenths of units; over a focal length of 50
    kind = "orthographic" if orthographic else "perspective"
    film = f"float horizontalAperture = {aperture:.9g}\nfloat verticalAperture = {aperture:.9g}\nfloat focalLength = 50"
    return prim("Camera", "eye", film, f'token projection = "{kind}"', "float2 clippingRange = (0, 1e30)", place(matrix))


def picture(text: str, resolution: tuple[int, int] = (32, 32), spp: int = 16, **settings: Any) -> Image:
    """With a box filter, and no light but the stage's."""
    options: dict[str, Any] = {"filter": Filter.BOX, "default_light": False, **settings}
    return primray.render(stage_of(text), RenderSettings(resolution=resolution, spp=spp, **options))


def codes(image: Image, *, ignored: Sequence[str] = ("camera-chosen",)) -> list[str]:
    return [d["code"] for d in image.report["diagnostics"] if d["code"] not in ("empty-picture", *ignored)]


def round_mesh(bands: int, around: int) -> tuple[npt.NDArray[np.float64], list[list[int]]]:
    """A unit sphere of 2 around (bands - 1) triangles, every other ring turned by half a step."""
    points = [(0.0, 1.0, 0.0)]
    for i in range(1, bands):
        t = np.pi * i / bands
        for j in range(around):
            p = 2 * np.pi * (j + 0.5 * (i % 2)) / around
            points.append((np.sin(t) * np.sin(p), np.cos(t), np.sin(t) * np.cos(p)))
    points.append((0.0, -1.0, 0.0))

    def ring(i: int, j: int) -> int:
        return 1 + (i - 1) * around + j % around

    faces = []
    for j in range(around):
        faces += [[0, ring(1, j), ring(1, j + 1)], [len(points) - 1, ring(bands - 1, j + 1), ring(bands - 1, j)]]
        for i in range(1, bands - 1):
            # The vertex below and the one after it, half a step to either side.
            left, right = (ring(i + 1, j), ring(i + 1, j + 1)) if i % 2 else (ring(i + 1, j - 1), ring(i + 1, j))
            faces += [[ring(i, j), left, right], [ring(i, j), right, ring(i, j + 1)]]
    return np.array(points), faces
