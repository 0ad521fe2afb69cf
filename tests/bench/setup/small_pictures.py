"""What a data set's small pictures cost: python -m tests.bench.setup.small_pictures [--samples N].

A robot of 20 links whose joints turn and 50 textured props that are scattered on a table, 640 x 480, 4 samples, 5 AOVs; and its
labels alone. Prints CPU seconds of a picture, by step; no picture is compared (tests/unit/dataset do that).
"""

from __future__ import annotations

import argparse
import cProfile
import pstats
import random
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdSemantics, UsdShade

from primray.dataset import Config, Sampler
from primray.images.image import write_png

LINKS, PROPS, TEXTURES, SIDE = 20, 50, 10, 256
KINDS = ("box", "can", "ball")


def write_stage(folder: Path) -> Path:
    """Write the stage and its textures."""
    chance = random.Random(3)
    for k in range(TEXTURES):
        write_texture(folder / f"label{k}.png", k)
    stage = Usd.Stage.CreateNew(str(folder / "cell.usda"))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    materials = [material(stage, f"/World/looks/paper{k}", f"./label{k}.png") for k in range(TEXTURES)]
    plain = [
        material(stage, f"/World/looks/paint{k}", None, color)
        for k, color in enumerate(((0.9, 0.35, 0.05), (0.15, 0.15, 0.17)))
    ]
    wood = material(stage, "/World/looks/wood", None, (0.55, 0.45, 0.35))
    bind(mesh(stage, "/World/table", *grid(2.0)), wood)
    link(stage, plain)
    for k in range(PROPS):
        kind = KINDS[k % 3]
        path = f"/World/props/{kind}{k:02d}"
        size = [chance.uniform(0.04, 0.09) for _ in range(3)]
        shape = box(*size) if kind == "box" else turned(size[0] * 0.7, 2 * size[2], 24, 1 if kind == "can" else 12)
        made = mesh(stage, path, *shape)
        bind(made, materials[k % TEXTURES])
        label(made.GetPrim(), kind)
    sky = UsdLux.DomeLight.Define(stage, "/World/sky")
    sky.CreateIntensityAttr(0.7)
    lamp = UsdLux.RectLight.Define(stage, "/World/lamp")
    lamp.CreateIntensityAttr(12)
    lamp.CreateWidthAttr(1.5)
    lamp.CreateHeightAttr(1.5)
    lamp.AddTranslateOp().Set(Gf.Vec3d(1, -1, 2.5))
    lamp.AddRotateXYZOp().Set(Gf.Vec3f(20, 20, 0))
    stage.Save()
    return folder / "cell.usda"


def write_texture(path: Path, k: int) -> None:
    y, x = np.mgrid[:SIDE, :SIDE] / SIDE
    phase = 2 * np.pi * np.array([0, 0.33, 0.66]) + k
    color = 0.5 + 0.45 * np.sin(phase + 6 * np.pi * ((x + k * y) % 1)[..., None])
    stripes = ((np.floor(8 * y) + k) % 3 == 0)[..., None]
    write_png((255 * np.where(stripes, 0.92, color)).astype(np.uint8), path)


def material(stage: Usd.Stage, path: str, texture: str | None, color: Any = None) -> UsdShade.Material:
    made, shader = UsdShade.Material.Define(stage, path), UsdShade.Shader.Define(stage, f"{path}/surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(0.45)
    base = shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f)
    if texture is None:
        base.Set(Gf.Vec3f(*color))
    else:
        reader = UsdShade.Shader.Define(stage, f"{path}/image")
        reader.CreateIdAttr("UsdUVTexture")
        reader.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(Sdf.AssetPath(texture))
        st = UsdShade.Shader.Define(stage, f"{path}/st")
        st.CreateIdAttr("UsdPrimvarReader_float2")
        st.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
        found = st.CreateOutput("result", Sdf.ValueTypeNames.Float2)
        reader.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(found)
        base.ConnectToSource(reader.CreateOutput("rgb", Sdf.ValueTypeNames.Float3))
    made.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    return made


def mesh(stage: Usd.Stage, path: str, points: Any, faces: Any, st: Any) -> UsdGeom.Mesh:
    made = UsdGeom.Mesh.Define(stage, path)
    made.CreatePointsAttr([Gf.Vec3f(*map(float, p)) for p in points])
    made.CreateFaceVertexCountsAttr([len(face) for face in faces])
    made.CreateFaceVertexIndicesAttr([k for face in faces for k in face])
    made.CreateSubdivisionSchemeAttr("none")
    made.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(made.GetPointsAttr().Get()))
    coordinates = UsdGeom.PrimvarsAPI(made).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, "faceVarying")
    coordinates.Set([Gf.Vec2f(*map(float, each)) for face in st for each in face])
    return made


def grid(half: float) -> tuple[Any, Any, Any]:
    points = [(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)]
    return points, [(0, 1, 2, 3)], [[(0, 0), (1, 0), (1, 1), (0, 1)]]


def box(x: float, y: float, z: float) -> tuple[Any, Any, Any]:
    points = [(a * x, b * y, c * z) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return points, faces, [[(0, 0), (1, 0), (1, 1), (0, 1)]] * 6


def turned(radius: float, height: float, around: int, bands: int) -> tuple[Any, Any, Any]:
    """A can (one band), or a ball of as many."""
    angles = [2 * np.pi * k / around for k in range(around)]
    if bands == 1:
        rings = [(radius, -height / 2), (radius, height / 2)]
    else:
        rings = [(radius * np.sin(np.pi * k / bands) + 1e-4, -radius * np.cos(np.pi * k / bands)) for k in range(bands + 1)]
    points = [(r * np.cos(a), r * np.sin(a), z) for r, z in rings for a in angles]
    faces: list[tuple[int, ...]] = []
    st: list[list[tuple[float, float]]] = []
    for ring in range(len(rings) - 1):
        for k in range(around):
            after = (k + 1) % around
            at = ring * around
            faces.append((at + k, at + after, at + around + after, at + around + k))
            st.append(
                [(u / around, v / (len(rings) - 1)) for u, v in ((k, ring), (k + 1, ring), (k + 1, ring + 1), (k, ring + 1))]
            )
    for at, order in ((0, -1), ((len(rings) - 1) * around, 1)):
        faces.append(tuple(at + k for k in range(around))[::order])
        st.append([(0.5 + 0.5 * np.cos(a), 0.5 + 0.5 * np.sin(a)) for a in angles][::order])
    return points, faces, st


def link(stage: Usd.Stage, paints: list[UsdShade.Material]) -> None:
    """A chain of links, each with a joint that turns about X or Z by its xformOp:rotateXYZ:joint."""
    parent = "/World/robot"
    base = UsdGeom.Xform.Define(stage, parent)
    base.AddTranslateOp().Set(Gf.Vec3d(-0.5, 0.5, 0.0))
    label(base.GetPrim(), "robot")
    for k in range(LINKS):
        parent = f"{parent}/link{k:02d}"
        joint = UsdGeom.Xform.Define(stage, parent)
        joint.AddTranslateOp().Set(Gf.Vec3d(0, 0, 0.05 if k == 0 else 0.1))
        joint.AddRotateXYZOp(opSuffix="joint").Set(Gf.Vec3f(0, 0, 0))
        shape = mesh(stage, f"{parent}/body", *turned(0.05 - 0.0015 * k, 0.09, 24, 1))
        bind(shape, paints[k % 2])


def bind(made: UsdGeom.Mesh, material: UsdShade.Material) -> None:
    UsdShade.MaterialBindingAPI.Apply(made.GetPrim()).Bind(material)


def label(prim: Usd.Prim, kind: str) -> None:
    UsdSemantics.LabelsAPI.Apply(prim, "class").CreateLabelsAttr([kind])


def config_of(folder: Path, **changes: Any) -> Config:
    """The data set that is measured."""
    plain: dict[str, Any] = {
        "stage": "cell.usda",
        "seed": 1,
        "samples": 1000,
        "settings": {
            "resolution": [640, 480],
            "spp": 4,
            "max_depth": 3,
            "aovs": ["depth", "normal", "albedo", "position"],
        },
        "labels": {"classes": ["ball", "box", "can", "robot"]},
        "vary": {
            "joints": {
                "attribute": "/World/robot" + "".join(f"/link{k:02d}" for k in range(1)) + ".xformOp:rotateXYZ:joint",
                "to": {"uniform": [[-5, -5, -180], [5, 5, 180]]},
            },
            "props": {"scatter": "/World/props/*", "surface": "/World/table", "gap": 0.005},
            "lamp": {"attribute": "/World/lamp.inputs:intensity", "to": {"log_uniform": [5, 30]}},
            "roughness": {"attribute": "/World/looks/*/surface.inputs:roughness", "to": {"uniform": [0.2, 0.8]}},
            "view": {"shell": [0, 0, 0.3], "distance": [2.2, 3.2], "elevation": [20, 60], "field_of_view": 50},
        },
    }
    joints = []
    path = "/World/robot"
    for k in range(LINKS):
        path += f"/link{k:02d}"
        joints.append(f"{path}.xformOp:rotateXYZ:joint")
    plain["vary"]["joints"] = {"attribute": joints, "to": {"uniform": [[-18, -18, -30], [18, 18, 30]]}}
    plain |= changes
    return Config.of(plain, folder)


def labels_alone(folder: Path) -> Config:
    settings = {"resolution": [640, 480], "aovs": ["depth", "normal", "position", "prim"]}
    return config_of(folder, settings=settings, pictures=["npy"], light=False)


def measure(config: Config, samples: int, out: Path, profiled: bool) -> list[float]:
    """CPU seconds of each sample but the first three, files included."""
    sampler, found = Sampler(config, threads=1), []
    profile = cProfile.Profile()
    for index in range(samples + 3):
        if index == 3 and profiled:
            profile.enable()
        begun = time.process_time()
        sampler.make(index, out)
        found.append(time.process_time() - begun)
    profile.disable()
    if profiled:
        pstats.Stats(profile).sort_stats("cumulative").print_stats(60)
    sampler.close()
    return found[3:]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=20)
    parser.add_argument("--profile", action="store_true", help="print where the time goes")
    parser.add_argument("--only", choices=("pictures", "labels"))
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_stage(folder)
        print("| what | CPU seconds | at worst |\n|---|---|---|")
        for what, config in (("pictures", config_of(folder)), ("labels", labels_alone(folder))):
            if asked.only in (None, what):
                found = measure(config, asked.samples, folder / what, asked.profile)
                print(f"| {what} | {statistics.median(found):.3f} | {max(found):.3f} |")


if __name__ == "__main__":
    main()
