"""Generated stages of many prims as productions have them: kinds that prims refer to, meshes of which no two are alike,
instances of a thousand prototypes, materials of 20 nodes, tufts of hair.

They are written as usdc; the camera is scaling_stages.py's.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade, Vt

PER_SCOPE = 1000
PER_KIND = 100  # prims that refer to one kind
PROTOTYPES, ELEMENTS = 1000, 20
NODES = 20  # of each material
STRANDS, SEGMENTS = 60, 4  # of a tuft
HEAD = 10.0  # radius of the ball that wears the tufts


def kinds(stage: Usd.Stage, count: int) -> float:
    """Prims that each refer to one of count / 100 kinds, a mesh with caps of its own, and are not instanceable."""
    layer = stage.GetRootLayer()
    made = max(1, count // PER_KIND)
    with Sdf.ChangeBlock():
        prim(layer, "/kinds", "Scope").specifier = Sdf.SpecifierClass
        for k in range(made):
            _prism(layer, f"/kinds/kind_{k}", 5 + k % 8, k)
    with Sdf.ChangeBlock():
        side = _rows(layer, "/city", count)
        for i, path, at in _places("/city", count, side):
            placed = moved(prim(layer, path, "Mesh"), at)
            placed.referenceList.Prepend(Sdf.Reference("", f"/kinds/kind_{i % made}"))
    return 2.0 * side


def unique(stage: Usd.Stage, count: int) -> float:
    """Meshes of quads and two caps, no two with the same points."""
    layer = stage.GetRootLayer()
    with Sdf.ChangeBlock():
        side = _rows(layer, "/city", count)
        for i, path, at in _places("/city", count, side):
            moved(_prism(layer, path, 5 + i % 8, i), at)
    return 2.0 * side


def island(stage: Usd.Stage, count: int) -> float:
    """Twenty instancers, each of fifty prototypes of its own: `count` instances of 1,000 prototypes.

    Faces by prototype are log-normal, half a quad an instance in all; instances by prototype follow a power law. Moana's island
    has 39 million instances of a like number of prototypes (Tamstorf and Pritchett 2019, "The challenges of releasing the Moana
    Island Scene").
    """
    rng = np.random.default_rng(11)
    faces = np.exp(rng.normal(0.0, 1.6, PROTOTYPES))
    faces = np.maximum(faces * (count / 2 / faces.sum()), 4).astype(int)
    shares = 1.0 / np.arange(1, PROTOTYPES + 1) ** 0.7
    side = float(2 * np.sqrt(count))
    UsdGeom.Xform.Define(stage, "/island")
    used = rng.permutation(PROTOTYPES)
    for e in range(ELEMENTS):
        own = used[e::ELEMENTS]
        root = f"/island/element_{e}"
        weights = shares[own] / shares.sum()
        _instancer(stage, root, rng, max(len(own), round(count * float(weights.sum()))), side, own, weights)
        for k in own:
            _grid(stage, f"{root}/archive_{k}", int(faces[k]))
    return side


def materials(stage: Usd.Stage, count: int) -> float:
    """Quads with a MaterialX material each of 20 nodes, whose constants are its own."""
    layer = stage.GetRootLayer()
    rng = np.random.default_rng(12)
    _material(stage, "/look", rng)
    given = [a.GetPath() for p in Usd.PrimRange(stage.GetPrimAtPath("/look")) for a in p.GetAttributes() if a.Get() is not None]
    constants = [str(path).removeprefix("/look") for path in given if path.name.startswith("inputs:")]
    with Sdf.ChangeBlock():
        prim(layer, "/looks", "Scope")
        for k in range(count):  # UsdShade would take minutes
            Sdf.CopySpec(layer, "/look", layer, f"/looks/look_{k}")
            for name in constants:
                value = layer.GetAttributeAtPath(f"/looks/look_{k}{name}")
                value.default = _constant(rng, isinstance(value.default, Gf.Vec3f))
        del layer.rootPrims["look"]
        side = _rows(layer, "/quads", count)
        for i, path, at in _places("/quads", count, side):
            spec = moved(_mesh(layer, path, [(-1, 0, 1), (1, 0, 1), (1, 0, -1), (-1, 0, -1)], [4], [0, 1, 2, 3]), at)
            spec.SetInfo("apiSchemas", Sdf.TokenListOp.Create(prependedItems=["MaterialBindingAPI"]))
            binding = Sdf.RelationshipSpec(spec, "material:binding", False)
            binding.targetPathList.prependedItems = [f"/looks/look_{i}"]
    return 2.0 * side


def tufts(stage: Usd.Stage, count: int) -> float:
    """Instances of one tuft of hair all over a ball, each among its neighbours."""
    controls, counts = _tuft()
    _curves(stage, "/head/tuft/hair", controls, counts)
    places, turns = _scalp(count)
    instancer = UsdGeom.PointInstancer.Define(stage, "/head")
    instancer.CreatePrototypesRel().SetTargets(["/head/tuft"])
    instancer.CreateProtoIndicesAttr(Vt.IntArray(count))
    instancer.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(places.astype(np.float32)))
    instancer.CreateOrientationsfAttr(Vt.QuatfArray.FromNumpy(turns.astype(np.float32)))
    return _with_head(stage)


def flat_tufts(stage: Usd.Stage, count: int) -> float:
    """The same strands as one prim of curves."""
    controls, counts = _tuft()
    places, turns = _scalp(count)
    all_of_them = np.concatenate([_turned(turn, controls) + place for place, turn in zip(places, turns, strict=True)])
    _curves(stage, "/hair", all_of_them, counts * count)
    return _with_head(stage)


def prim(layer: Sdf.Layer, path: str, type_name: str) -> Sdf.PrimSpec:
    spec = Sdf.CreatePrimInLayer(layer, path)
    spec.specifier, spec.typeName = Sdf.SpecifierDef, type_name
    return spec


def moved(spec: Sdf.PrimSpec, at: tuple[float, float, float]) -> Sdf.PrimSpec:
    Sdf.AttributeSpec(spec, "xformOp:translate", Sdf.ValueTypeNames.Double3).default = Gf.Vec3d(*at)
    order = Sdf.AttributeSpec(spec, "xformOpOrder", Sdf.ValueTypeNames.TokenArray, Sdf.VariabilityUniform)
    order.default = Vt.TokenArray(["xformOp:translate"])
    return spec


def _rows(layer: Sdf.Layer, root: str, count: int) -> int:
    for path in [root, *(f"{root}/row_{k}" for k in range((count - 1) // PER_SCOPE + 1))]:
        prim(layer, path, "Xform")
    return int(np.ceil(np.sqrt(count)))


def _places(root: str, count: int, side: int) -> Iterator[tuple[int, str, tuple[float, float, float]]]:
    """Yield number, path and place of each prim of a square."""
    for i in range(count):
        yield i, f"{root}/row_{i // PER_SCOPE}/prim_{i}", ((i % side - side / 2) * 2.0, 0.0, (i // side - side / 2) * 2.0)


def _prism(layer: Sdf.Layer, path: str, sides: int, number: int) -> Sdf.PrimSpec:
    """A prism of `sides` quads and two caps; no two numbers below 99,991 have the same points."""
    angle = 2 * np.pi * np.arange(sides) / sides
    radius, height = 0.4 + 0.4 * (number % 317) / 317, 0.5 + (number % 99991) / 99991
    ring = np.stack([radius * np.cos(angle), np.zeros(sides), -radius * np.sin(angle)], axis=1)
    points = np.concatenate([ring, ring + [0, height, 0]])
    bottom, top = np.arange(sides), np.arange(sides) + sides
    after = np.roll(bottom, -1)
    walls = np.stack([bottom, after, after + sides, top], axis=1)
    indices = np.concatenate([bottom[::-1], top, walls.ravel()])
    return _mesh(layer, path, points, [sides, sides, *[4] * sides], indices)


def _mesh(layer: Sdf.Layer, path: str, points: object, counts: list[int], indices: object) -> Sdf.PrimSpec:
    spec = prim(layer, path, "Mesh")
    for name, type_name, value in (
        ("points", Sdf.ValueTypeNames.Point3fArray, Vt.Vec3fArray.FromNumpy(np.array(points, np.float32))),
        ("faceVertexCounts", Sdf.ValueTypeNames.IntArray, Vt.IntArray.FromNumpy(np.array(counts, np.int32))),
        ("faceVertexIndices", Sdf.ValueTypeNames.IntArray, Vt.IntArray.FromNumpy(np.array(indices, np.int32))),
        ("subdivisionScheme", Sdf.ValueTypeNames.Token, "none"),
    ):
        Sdf.AttributeSpec(spec, name, type_name).default = value
    return spec


def _instancer(
    stage: Usd.Stage, path: str, rng: np.random.Generator, count: int, side: float, own: np.ndarray, weights: np.ndarray
) -> None:
    made = UsdGeom.PointInstancer.Define(stage, path)
    made.CreatePrototypesRel().SetTargets([f"{path}/archive_{k}" for k in own])
    indices = rng.choice(len(own), count, p=weights / weights.sum()).astype(np.int32)
    made.CreateProtoIndicesAttr(Vt.IntArray.FromNumpy(indices))
    scatter(made, rng, count, side)


def scatter(instancer: UsdGeom.PointInstancer, rng: np.random.Generator, count: int, side: float) -> None:
    """Place instances on a square of that side, turned about y and of several sizes."""
    positions = np.zeros((count, 3), np.float32)
    positions[:, [0, 2]] = rng.uniform(-side / 2, side / 2, (count, 2))
    instancer.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(positions))
    angle = rng.uniform(0, np.pi, count)
    turns = np.zeros((count, 4), np.float16)
    turns[:, 1], turns[:, 3] = np.sin(angle), np.cos(angle)  # about y; memory order x, y, z, w
    instancer.CreateOrientationsAttr(Vt.QuathArray.FromNumpy(turns))
    scales = np.repeat(rng.uniform(0.5, 1.2, (count, 1)), 3, axis=1).astype(np.float32)
    instancer.CreateScalesAttr(Vt.Vec3fArray.FromNumpy(scales))


def _grid(stage: Usd.Stage, path: str, quads: int) -> None:
    n = max(2, round(np.sqrt(quads)))
    x, z = np.meshgrid(np.linspace(-0.7, 0.7, n + 1), np.linspace(-0.7, 0.7, n + 1), indexing="ij")
    points = np.stack([x, 1 - x * x - z * z, z], axis=-1).reshape(-1, 3)
    at = np.arange((n + 1) * (n + 1)).reshape(n + 1, n + 1)
    indices = np.stack([at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]], axis=-1).ravel()
    _mesh(stage.GetRootLayer(), path, points, [4] * (n * n), indices)


def _material(stage: Usd.Stage, path: str, rng: np.random.Generator) -> None:
    """A standard_surface whose colour and roughness come from two chains of nodes, constants through and through."""
    material = UsdShade.Material.Define(stage, path)
    surface = UsdShade.Shader.Define(stage, f"{path}/surface")
    surface.CreateIdAttr("ND_standard_surface_surfaceshader")
    color = _chain(stage, path, "color", "color3", Sdf.ValueTypeNames.Color3f, rng, (NODES - 1) // 2)
    rough = _chain(stage, path, "rough", "float", Sdf.ValueTypeNames.Float, rng, NODES - 1 - (NODES - 1) // 2)
    surface.CreateInput("base_color", Sdf.ValueTypeNames.Color3f).ConnectToSource(color)
    surface.CreateInput("specular_roughness", Sdf.ValueTypeNames.Float).ConnectToSource(rough)
    surface.CreateInput("specular", Sdf.ValueTypeNames.Float).Set(float(rng.uniform(0.2, 1)))
    output = surface.CreateOutput("out", Sdf.ValueTypeNames.Token)
    material.CreateSurfaceOutput("mtlx").ConnectToSource(output)


def _constant(rng: np.random.Generator, is_color: bool) -> object:
    return Gf.Vec3f(*map(float, rng.uniform(0.2, 0.9, 3))) if is_color else float(rng.uniform(0.2, 0.9))


_OPERATIONS = ("multiply", "add", "mix", "power", "clamp", "max")


def _chain(
    stage: Usd.Stage, path: str, name: str, kind: str, type_name: Sdf.ValueTypeName, rng: np.random.Generator, length: int
) -> UsdShade.Output:
    def value() -> object:
        return _constant(rng, kind == "color3")

    above: UsdShade.Output | None = None
    for k in range(length):
        operation = _OPERATIONS[k % len(_OPERATIONS)]
        node = UsdShade.Shader.Define(stage, f"{path}/{name}_{k}")
        node.CreateIdAttr(f"ND_{operation}_{kind}")
        first, *others = {"mix": ("fg", "bg", "mix"), "clamp": ("in", "low", "high")}.get(operation, ("in1", "in2"))
        given = node.CreateInput(first, type_name)
        if above is None:
            given.Set(value())
        else:
            given.ConnectToSource(above)
        for other in others:
            is_number = other == "mix" and kind == "color3"
            made = node.CreateInput(other, Sdf.ValueTypeNames.Float if is_number else type_name)
            made.Set(float(rng.uniform(0.2, 0.9)) if is_number else value())
        above = node.CreateOutput("out", type_name)
    assert above is not None
    return above


def _tuft() -> tuple[np.ndarray, list[int]]:
    """Control points of strands that fan out upwards over twice the distance of the next tuft, and how many each has."""
    rng = np.random.default_rng(13)
    roots = rng.uniform(-0.4, 0.4, (STRANDS, 2))
    tips = roots + rng.normal(0, 0.5, (STRANDS, 2))
    steps = np.linspace(0, 1, 3 * SEGMENTS + 1)
    across = roots[:, None] + (tips - roots)[:, None] * steps[None, :, None] ** 2
    points = np.stack([across[..., 0], np.broadcast_to(1.5 * steps, across.shape[:2]), across[..., 1]], axis=-1)
    return points.reshape(-1, 3), [len(steps)] * STRANDS


def _scalp(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Places all over a ball (a spiral of Fibonacci) and the rotations that turn up outwards, as quaternions x, y, z, w."""
    k = np.arange(count) + 0.5
    y, angle = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    flat = np.sqrt(1 - y * y)
    normals = np.stack([flat * np.cos(angle), y, flat * np.sin(angle)], axis=1)
    turns = np.stack([normals[:, 2], np.zeros(count), -normals[:, 0], 1 + normals[:, 1]], axis=1)
    return HEAD * normals, turns / np.linalg.norm(turns, axis=1)[:, None]


def _turned(quaternion: np.ndarray, points: np.ndarray) -> np.ndarray:
    axis, w = quaternion[:3], quaternion[3]
    across = 2 * np.cross(axis, points)
    return np.asarray(points + w * across + np.cross(axis, across))


def _curves(stage: Usd.Stage, path: str, controls: np.ndarray, counts: list[int]) -> None:
    made = UsdGeom.BasisCurves.Define(stage, path)
    made.CreateTypeAttr("cubic")
    made.CreateBasisAttr("bezier")
    made.CreateCurveVertexCountsAttr(counts)
    made.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(controls.astype(np.float32)))
    made.CreateWidthsAttr([0.02])
    made.SetWidthsInterpolation("constant")


def _with_head(stage: Usd.Stage) -> float:
    ball = UsdGeom.Sphere.Define(stage, "/skin")
    ball.CreateRadiusAttr(HEAD)
    UsdLux.DomeLight.Define(stage, "/sky")
    return 2.2 * HEAD


WRITERS = {
    "kinds": kinds,
    "unique": unique,
    "island": island,
    "materials": materials,
    "tufts": tufts,
    "flat-tufts": flat_tufts,
}
