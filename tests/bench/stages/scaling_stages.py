"""Generated stages that grow: many small meshes or cages, one big mesh, many instances, nested ones, many lights or images.

Written as usdc, images beside it.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade, Vt

from . import crowded_stages
from .crowded_stages import moved, prim, scatter

CUBE_POINTS = [(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]
CUBE_FACES = [0, 1, 3, 2, 4, 6, 7, 5, 0, 4, 5, 1, 2, 3, 7, 6, 0, 2, 6, 4, 1, 5, 7, 3]
PER_SCOPE = 1000
PER_BLOCK = 10
LOOKS = 100


def write(kind: str, count: int, path: Path) -> None:
    """A stage with `count` meshes, triangles or instances."""
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    side = WRITERS[kind](stage, count)
    _camera(stage, side)
    stage.GetRootLayer().Save()


def _camera(stage: Usd.Stage, side: float) -> None:
    """Looks over a square of that side about the origin, from one edge and above."""
    camera = UsdGeom.Camera.Define(stage, "/camera")
    camera.AddTranslateOp().Set(Gf.Vec3d(0, 0.35 * side, 0.75 * side))
    camera.AddRotateXOp().Set(-28.0)
    camera.GetClippingRangeAttr().Set(Gf.Vec2f(1e-3 * side, 1e3 * side))
    camera.GetHorizontalApertureAttr().Set(36.0)
    camera.GetFocalLengthAttr().Set(30.0)


def _cube(layer: Sdf.Layer, path: str, size: float = 1.0, scheme: str = "none") -> Sdf.PrimSpec:
    points = np.array(CUBE_POINTS, np.float32) * np.float32(size)
    prim = Sdf.CreatePrimInLayer(layer, path)
    prim.specifier, prim.typeName = Sdf.SpecifierDef, "Mesh"
    for name, type_name, value in (
        ("points", Sdf.ValueTypeNames.Point3fArray, Vt.Vec3fArray.FromNumpy(points)),
        ("faceVertexCounts", Sdf.ValueTypeNames.IntArray, Vt.IntArray([4] * 6)),
        ("faceVertexIndices", Sdf.ValueTypeNames.IntArray, Vt.IntArray(CUBE_FACES)),
        ("subdivisionScheme", Sdf.ValueTypeNames.Token, scheme),
    ):
        Sdf.AttributeSpec(prim, name, type_name).default = value
    return prim


def _meshes(stage: Usd.Stage, count: int) -> float:
    """Equal cubes, each a mesh of its own in another place and colour."""
    return _cubes(stage, count, lambda i: 1.0)


def _distinct(stage: Usd.Stage, count: int) -> float:
    """Cubes that share nothing but their topology."""
    return _cubes(stage, count, _size)


def _cages(stage: Usd.Stage, count: int) -> float:
    """The same with USD's default scheme: Catmull-Clark."""
    return _cubes(stage, count, _size, scheme="catmullClark")


def _size(i: int) -> float:
    return 0.7 + 0.3 * (i % 99991) / 99991


def _cubes(stage: Usd.Stage, count: int, size: Callable[[int], float], scheme: str = "none") -> float:
    layer = stage.GetRootLayer()
    side = int(np.ceil(np.sqrt(count)))
    rng = np.random.default_rng(1)
    with Sdf.ChangeBlock():
        for i in range(count):
            scope = f"/meshes/group_{i // PER_SCOPE}"
            prim = _cube(layer, f"{scope}/mesh_{i}", size(i), scheme)
            at = Gf.Vec3d((i % side - side / 2) * 2, rng.uniform(0, 1), (i // side - side / 2) * 2)
            Sdf.AttributeSpec(prim, "xformOp:translate", Sdf.ValueTypeNames.Double3).default = at
            order = Sdf.AttributeSpec(prim, "xformOpOrder", Sdf.ValueTypeNames.TokenArray, Sdf.VariabilityUniform)
            order.default = Vt.TokenArray(["xformOp:translate"])
            color = Sdf.AttributeSpec(prim, "primvars:displayColor", Sdf.ValueTypeNames.Color3fArray)
            color.default = Vt.Vec3fArray([Gf.Vec3f(*(float(x) for x in rng.integers(2, 9, 3) / 10))])
        for path in ["/meshes", *(f"/meshes/group_{k}" for k in range((count - 1) // PER_SCOPE + 1))]:
            spec = Sdf.CreatePrimInLayer(layer, path)
            spec.specifier, spec.typeName = Sdf.SpecifierDef, "Xform"
    return 2.0 * side


def _prims(stage: Usd.Stage, count: int) -> float:
    """Blocks of ten nested prims: four groups, a mesh with a material, a cube, three spheres, a scope; most are moved."""
    layer = stage.GetRootLayer()
    looks = min(count, LOOKS)
    for k in range(looks):
        _look(stage, f"/looks/look_{k}", k)
    _block(layer, "/block")
    blocks = count // PER_BLOCK
    side = int(np.ceil(np.sqrt(blocks)))
    rng = np.random.default_rng(8)
    with Sdf.ChangeBlock():
        for path in ["/city", *(f"/city/quarter_{k}" for k in range((blocks - 1) // PER_SCOPE + 1))]:
            prim(layer, path, "Xform")
        for i in range(blocks):
            block = f"/city/quarter_{i // PER_SCOPE}/block_{i}"
            Sdf.CopySpec(layer, "/block", layer, block)
            own = {
                "xformOp:translate": Gf.Vec3d((i % side - side / 2) * 4, 0, (i // side - side / 2) * 4),
                "house.xformOp:translate": Gf.Vec3d(0, rng.uniform(), 0),
                "house/body.points": Vt.Vec3fArray.FromNumpy(np.array(CUBE_POINTS, np.float32) * np.float32(_size(i))),
            }
            for k in range(3):
                own[f"yard/trees/tree_{k}.radius"] = 0.1 + 0.1 * float(rng.uniform())
                own[f"yard/trees/tree_{k}.primvars:displayColor"] = Vt.Vec3fArray(
                    [Gf.Vec3f(0.1, 0.1 * int(rng.integers(2, 7)), 0.1)]
                )
            for name, value in own.items():
                layer.GetAttributeAtPath(f"{block}{'.' if name.startswith('xform') else '/'}{name}").default = value
            targets = layer.GetRelationshipAtPath(f"{block}/house/body.material:binding").targetPathList
            targets.prependedItems = [f"/looks/look_{i % looks}"]
        del layer.rootPrims["block"]
    return 4.0 * side


def _block(layer: Sdf.Layer, path: str) -> None:
    """What all blocks have in common."""
    moved(prim(layer, path, "Xform"), (0.0, 0.0, 0.0))
    moved(prim(layer, f"{path}/house", "Xform"), (0.0, 0.0, 0.0))
    _bound(moved(_cube(layer, f"{path}/house/body"), (0.0, 0.5, 0.0)))
    prim(layer, f"{path}/house/notes", "Scope")
    roof = moved(prim(layer, f"{path}/house/roof", "Cube"), (0.0, 1.2, 0.0))
    _attribute(roof, "size", Sdf.ValueTypeNames.Double, 0.4)
    moved(prim(layer, f"{path}/yard", "Xform"), (1.0, 0.0, 1.0))
    prim(layer, f"{path}/yard/trees", "Xform")
    for k in range(3):
        tree = moved(prim(layer, f"{path}/yard/trees/tree_{k}", "Sphere"), (0.3 * k, 0.4, -0.3 * k))
        _attribute(tree, "radius", Sdf.ValueTypeNames.Double, 0.1)
        _attribute(tree, "primvars:displayColor", Sdf.ValueTypeNames.Color3fArray, Vt.Vec3fArray(1))


def _referenced(stage: Usd.Stage, count: int) -> float:
    """Scene instances of one small asset, each a prim with a reference of its own."""
    layer = stage.GetRootLayer()
    prim(layer, "/assets", "Scope").specifier = Sdf.SpecifierClass
    prim(layer, "/assets/cube", "Xform")
    _cube(layer, "/assets/cube/body")
    instance = moved(prim(layer, "/instance", "Xform"), (0.0, 0.0, 0.0))
    instance.referenceList.Prepend(Sdf.Reference("", "/assets/cube"))
    instance.instanceable = True
    side = int(np.ceil(np.sqrt(count)))
    with Sdf.ChangeBlock():
        for path in ["/field", *(f"/field/row_{k}" for k in range((count - 1) // PER_SCOPE + 1))]:
            prim(layer, path, "Xform")
        for i in range(count):
            path = f"/field/row_{i // PER_SCOPE}/cube_{i}"
            Sdf.CopySpec(layer, "/instance", layer, path)
            at = Gf.Vec3d((i % side - side / 2) * 2, 0, (i // side - side / 2) * 2)
            layer.GetAttributeAtPath(f"{path}.xformOp:translate").default = at
        del layer.rootPrims["instance"]
    return 2.0 * side


def _attribute(prim: Sdf.PrimSpec, name: str, type_name: Sdf.ValueTypeName, value: object) -> None:
    Sdf.AttributeSpec(prim, name, type_name).default = value


def _bound(prim: Sdf.PrimSpec) -> None:
    prim.SetInfo("apiSchemas", Sdf.TokenListOp.Create(prependedItems=["MaterialBindingAPI"]))
    Sdf.RelationshipSpec(prim, "material:binding", False)


def _look(stage: Usd.Stage, path: str, number: int) -> None:
    material = UsdShade.Material.Define(stage, path)
    surface = UsdShade.Shader.Define(stage, f"{path}/surface")
    surface.CreateIdAttr("UsdPreviewSurface")
    color = Gf.Vec3f(0.2 + 0.006 * number, 0.4, 0.8 - 0.006 * number)
    surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(color)
    material.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")


def _triangles(stage: Usd.Stage, count: int) -> float:
    """One grid of quads."""
    n = max(1, round(np.sqrt(count / 2)))
    x, z = np.meshgrid(np.linspace(-50, 50, n + 1), np.linspace(-50, 50, n + 1), indexing="ij")
    points = np.stack([x, 3 * np.sin(0.3 * x) * np.cos(0.2 * z), z], axis=-1).reshape(-1, 3).astype(np.float32)
    at = np.arange((n + 1) * (n + 1), dtype=np.int32).reshape(n + 1, n + 1)
    quads = np.stack([at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]], axis=-1).reshape(-1)
    mesh = UsdGeom.Mesh.Define(stage, "/grid")
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(n * n, 4, np.int32)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(quads))
    mesh.CreateSubdivisionSchemeAttr("none")
    return 100.0


def _instances(stage: Usd.Stage, count: int) -> float:
    side = 2 * np.sqrt(count)
    _instancer(stage, "/field", count, side, "/field/cube", seed=2)
    _cube(stage.GetRootLayer(), "/field/cube")
    return side


def _nested(stage: Usd.Stage, count: int) -> float:
    """1000 instances (or the root of `count`, if that is less; 10,000 from 1e9 on) of an instancer with the rest."""
    outer = 10_000 if count >= 10**9 else min(1000, round(np.sqrt(count)))
    inner_side = 2 * np.sqrt(count / outer)
    side = float(inner_side * np.sqrt(outer))
    _instancer(stage, "/field", outer, side, "/field/clump", seed=3)
    _instancer(stage, "/field/clump", count // outer, inner_side, "/field/clump/cube", seed=4)
    _cube(stage.GetRootLayer(), "/field/clump/cube")
    return side


def _instancer(stage: Usd.Stage, path: str, count: int, side: float, prototype: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    instancer = UsdGeom.PointInstancer.Define(stage, path)
    instancer.CreatePrototypesRel().SetTargets([prototype])
    instancer.CreateProtoIndicesAttr(Vt.IntArray(count))
    scatter(instancer, rng, count, side)


def _lights(stage: Usd.Stage, count: int) -> float:
    """Spheres over a floor with blocks, all of them together as strong whatever their number."""
    rng = np.random.default_rng(5)
    _instancer(stage, "/field", 400, 40.0, "/field/cube", seed=6)
    _cube(stage.GetRootLayer(), "/field/cube")
    floor = _cube(stage.GetRootLayer(), "/floor", 80.0)
    at = Sdf.AttributeSpec(floor, "xformOp:translate", Sdf.ValueTypeNames.Double3)
    at.default = Gf.Vec3d(0, -40.5, 0)
    order = Sdf.AttributeSpec(floor, "xformOpOrder", Sdf.ValueTypeNames.TokenArray, Sdf.VariabilityUniform)
    order.default = Vt.TokenArray(["xformOp:translate"])
    for i in range(count):
        light = UsdLux.SphereLight.Define(stage, f"/lights/group_{i // PER_SCOPE}/light_{i}")
        light.CreateRadiusAttr(0.02)
        light.CreateIntensityAttr(3e5 / count)
        light.AddTranslateOp().Set(Gf.Vec3d(*rng.uniform((-20, 0.8, -20), (20, 3, 20))))
    return 40.0


def _textures(stage: Usd.Stage, count: int) -> float:
    """Quads in a square, each with a material of its own and an image of 128 x 128 texels."""
    side = int(np.ceil(np.sqrt(count)))
    for i in range(count):
        _textured_quad(stage, f"image_{i}", ((i % side - (side - 1) / 2) * 2.0, (i // side - (side - 1) / 2) * 2.0), 1.0, 128)
    return 2.0 * side


def _texels(stage: Usd.Stage, count: int) -> float:
    """One quad with one image."""
    _textured_quad(stage, "image", (0.0, 0.0), 20.0, round(np.sqrt(count)))
    return 40.0


def _textured_quad(stage: Usd.Stage, name: str, at: tuple[float, float], half: float, texels: int) -> None:
    x, z = at
    mesh = UsdGeom.Mesh.Define(stage, f"/quads/{name}")
    corners = [(-1, 1), (1, 1), (1, -1), (-1, -1)]
    mesh.CreatePointsAttr([Gf.Vec3f(x + u * half, 0, z + v * half) for u, v in corners])
    mesh.CreateFaceVertexCountsAttr([4])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
    mesh.CreateSubdivisionSchemeAttr("none")
    st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, "vertex")
    st.Set([Gf.Vec2f(0, 0), Gf.Vec2f(1, 0), Gf.Vec2f(1, 1), Gf.Vec2f(0, 1)])
    material = UsdShade.Material.Define(stage, f"/looks/{name}")
    surface = UsdShade.Shader.Define(stage, f"/looks/{name}/surface")
    surface.CreateIdAttr("UsdPreviewSurface")
    reader = UsdShade.Shader.Define(stage, f"/looks/{name}/st")
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
    texture = UsdShade.Shader.Define(stage, f"/looks/{name}/texture")
    texture.CreateIdAttr("UsdUVTexture")
    texture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(Sdf.AssetPath(f"./{name}.png"))
    texture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(reader.ConnectableAPI(), "result")
    surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).ConnectToSource(texture.ConnectableAPI(), "rgb")
    material.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)
    noise = np.random.default_rng(7).random((texels, texels, 3), np.float32)
    image = oiio.ImageBuf(oiio.ImageSpec(texels, texels, 3, "uint8"))
    image.set_pixels(oiio.ROI(0, texels, 0, texels), noise)
    image.write(str(Path(stage.GetRootLayer().realPath).parent / f"{name}.png"))


WRITERS: dict[str, Callable[[Usd.Stage, int], float]] = {
    "meshes": _meshes,
    "distinct": _distinct,
    "cages": _cages,
    "prims": _prims,
    "referenced": _referenced,
    "triangles": _triangles,
    "instances": _instances,
    "nested": _nested,
    "multiplied": _nested,
    "lights": _lights,
    "textures": _textures,
    "texels": _texels,
    **crowded_stages.WRITERS,
}
