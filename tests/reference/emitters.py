"""What lights a stage, read for the referee: its own reading of UsdLux's text (usdLux/schema.usda of usd-core), in double.

Shares nothing with primray: it walks the stage by itself, instances and point instancers included.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
from pxr import Gf, Usd, UsdGeom, UsdLux
from tests.reference.shaping import Shaping, read_shaping
from tests.reference.textures import Picture, read_picture

Doubles = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Emitter:
    """One light in the world: `kind` is the schema's name without "Light" (Distant, Sphere, ..., Mesh)."""

    kind: str
    path: str
    world: Doubles  # (4, 4), for column vectors
    radiance: Doubles  # (3,), without size factor, texture, shaping: intensity * 2^exposure * color * temperature * diffuse
    normalize: bool
    size: dict[str, float] = field(default_factory=dict)
    point_or_line: bool = False
    shaping: Shaping | None = None
    picture: Picture | None = None
    picture_format: str = "latlong"
    z_pole: bool = False  # a dome whose pole is Z
    triangles: Doubles = field(default_factory=lambda: np.zeros((0, 3, 3)))  # of a mesh, in its own space

    @property
    def linear(self) -> Doubles:
        return self.world[:3, :3]

    @property
    def origin(self) -> Doubles:
        return self.world[:3, 3]

    @property
    def axis(self) -> Doubles:
        """The light's primary axis, -Z of its own, in the world."""
        a = self.linear @ [0.0, 0.0, -1.0]
        return a / np.linalg.norm(a)


def emitters(stage: Usd.Stage) -> list[Emitter]:
    return [_emitter(stage, prim, world) for prim, world in _placed(stage.GetPseudoRoot(), np.eye(4)) if _is_light(prim)]


def _is_light(prim: Usd.Prim) -> bool:
    return prim.HasAPI(UsdLux.LightAPI) and UsdGeom.Imageable(prim).ComputeVisibility() != "invisible"


def _placed(prim: Usd.Prim, parent: Doubles) -> Iterator[tuple[Usd.Prim, Doubles]]:
    """Every prim below, with its world matrix; what a point instancer places is found once for each instance."""
    for child in prim.GetFilteredChildren(Usd.TraverseInstanceProxies()):
        world = parent
        if child.IsA(UsdGeom.Xformable):
            ops = UsdGeom.Xformable(child)
            own = np.array(ops.GetLocalTransformation()).T
            world = own if ops.GetResetXformStack() else parent @ own
        if child.IsA(UsdGeom.PointInstancer):
            yield from _instanced(UsdGeom.PointInstancer(child), world)
            continue
        yield child, world
        yield from _placed(child, world)


def _instanced(instancer: UsdGeom.PointInstancer, world: Doubles) -> Iterator[tuple[Usd.Prim, Doubles]]:
    stage = instancer.GetPrim().GetStage()
    prototypes = [stage.GetPrimAtPath(p) for p in instancer.GetPrototypesRel().GetForwardedTargets()]
    which = instancer.GetProtoIndicesAttr().Get()
    positions = instancer.GetPositionsAttr().Get()
    orientations = instancer.GetOrientationsAttr().Get()
    scales = instancer.GetScalesAttr().Get()
    for i, proto in enumerate(which):
        m = Gf.Matrix4d(1.0)
        if scales:
            m = m * Gf.Matrix4d().SetScale(Gf.Vec3d(scales[i]))
        if orientations:
            m = m * Gf.Matrix4d().SetRotate(Gf.Quatd(orientations[i]).GetNormalized())
        m = m * Gf.Matrix4d().SetTranslate(Gf.Vec3d(positions[i]))
        root = prototypes[proto]
        ops = UsdGeom.Xformable(root)
        placed = world @ np.array(m).T @ np.array(ops.GetLocalTransformation()).T
        yield root, placed
        yield from _placed(root, placed)


def _emitter(stage: Usd.Stage, prim: Usd.Prim, world: Doubles) -> Emitter:
    def get(name: str, fallback: Any = None) -> Any:
        value = prim.GetAttribute(name).Get() if prim.HasAttribute(name) else None
        return fallback if value is None else value

    kind = str(prim.GetTypeName()).removesuffix("_1").removesuffix("Light")
    color = np.array(get("inputs:color", (1, 1, 1)), float)
    if get("inputs:enableColorTemperature", False):
        color = color * np.array(UsdLux.BlackbodyTemperatureAsRgb(get("inputs:colorTemperature", 6500.0)), float)
    radiance = color * float(get("inputs:intensity", 1.0)) * 2.0 ** float(get("inputs:exposure", 0.0))
    texture = get("inputs:texture:file")
    pole = get("poleAxis", "Y") if prim.GetTypeName() == "DomeLight_1" else "Y"
    return Emitter(
        kind,
        str(prim.GetPath()),
        world,
        radiance * float(get("inputs:diffuse", 1.0)),
        bool(get("inputs:normalize", False)),
        {n: float(get(f"inputs:{n}", 0.0)) for n in ("radius", "width", "height", "length", "angle")},
        bool(get("treatAsPoint", False) or get("treatAsLine", False)),
        read_shaping(prim),
        read_picture(texture) if texture else None,
        str(get("inputs:texture:format", "latlong")),
        pole == "Z" or (pole == "scene" and UsdGeom.GetStageUpAxis(stage) == "Z"),
        _triangles(prim) if kind == "Mesh" else np.zeros((0, 3, 3)),
    )


def _triangles(prim: Usd.Prim) -> Doubles:
    """Front sides as the mesh's orientation says: right-handed faces counter-clockwise as seen from in front."""
    mesh = UsdGeom.Mesh(prim)
    p = np.array(mesh.GetPointsAttr().Get(), float)
    corners, out, first = list(mesh.GetFaceVertexIndicesAttr().Get()), [], 0
    for n in mesh.GetFaceVertexCountsAttr().Get():
        face = corners[first : first + n]
        out += [[face[0], face[i], face[i + 1]] for i in range(1, n - 1)]
        first += n
    if mesh.GetOrientationAttr().Get() == "leftHanded":
        out = [t[::-1] for t in out]
    return p[np.array(out)]
