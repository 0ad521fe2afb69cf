"""A white Lambert plane seen from close above, as a stage in memory, and the points of its picture's pixels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from pxr import Sdf, Usd

Doubles = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Plane:
    """What the camera sees: half_x by half_z about `frame`'s origin, facing along its y; columns of frame are unit vectors."""

    frame: Doubles = field(default_factory=lambda: np.eye(4))  # (4, 4), for column vectors
    half_x: float = 1.5
    half_z: float = 1.0

    @property
    def normal(self) -> Doubles:
        return self.frame[:3, 1]

    def prims(self) -> str:
        s, x = 4 * max(self.half_x, self.half_z), self.half_x
        return f"""
def Xform "view" {{
    {transform(self.frame)}
    def Mesh "ground" {{
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [({-s!r}, 0, {s!r}), ({s!r}, 0, {s!r}), ({s!r}, 0, {-s!r}), ({-s!r}, 0, {-s!r})]
        uniform token subdivisionScheme = "none"
        color3f[] primvars:displayColor = [(1, 1, 1)]
    }}
    def Camera "camera" {{
        token projection = "orthographic"
        float horizontalAperture = {20 * x!r}
        float verticalAperture = {20 * self.half_z!r}
        float2 clippingRange = ({1e-5 * x!r}, {x!r})
        double3 xformOp:translate = (0, {1e-3 * x!r}, 0)
        float xformOp:rotateX = -90
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
    }}
}}
"""

    def world(self, x: Doubles, z: Doubles) -> Doubles:
        """Of places in the picture, both from -1 (left, top) to 1."""
        local = np.stack([x * self.half_x, np.zeros_like(x), z * self.half_z], axis=-1)
        return local @ self.frame[:3, :3].T + self.frame[:3, 3]


def transform(m: Doubles) -> str:
    """xformOps of a matrix for column vectors."""
    rows = ", ".join("(" + ", ".join(repr(float(v)) for v in row) + ")" for row in m.T)
    return f'matrix4d xformOp:transform = ({rows})\n    uniform token[] xformOpOrder = ["xformOp:transform"]'


def translation(x: float, y: float, z: float) -> Doubles:
    m = np.eye(4)
    m[:3, 3] = x, y, z
    return m


def scaling(x: float, y: float, z: float) -> Doubles:
    return np.diag([x, y, z, 1.0])


def rotation(axis: Sequence[float], degrees: float) -> Doubles:
    k, a = np.array(axis, float) / np.linalg.norm(axis), np.radians(degrees)
    c = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
    m = np.eye(4)
    m[:3, :3] += np.sin(a) * c + (1 - np.cos(a)) * c @ c
    return m


def light(kind: str, m: Doubles, *lines: str, apis: Sequence[str] = (), name: str = "light", within: str = "") -> str:
    applied = ", ".join(f'"{api}"' for api in apis)
    head = f"(prepend apiSchemas = [{applied}])" if apis else ""
    body = "\n    ".join(lines)
    return f'def {kind} "{name}" {head} {{\n    {transform(m)}\n    {body}\n{within}}}\n'


def stage(prims: str, plane: Plane, up: str = "Y") -> Usd.Stage:
    layer = Sdf.Layer.CreateAnonymous(".usda")
    head = f'#usda 1.0\n(\n    metersPerUnit = 1\n    upAxis = "{up}"\n)\n'
    assert layer.ImportFromString(head + plane.prims() + prims)
    return Usd.Stage.Open(layer)
