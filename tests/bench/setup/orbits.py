"""What a step around something costs before its first sample: python -m tests.bench.setup.orbits [STAGE ...].

A camera goes around the middle of a stage that stays, as `primray view` does it, at 480 x 270. Without names the stages are
made: boxes, and boxes with a cage, under a sky of 2,048 x 1,024, with lights, or with shapes that are diced. Prints the first
set-up, then medians and the worst of the steps, and the peak memory of a process for each stage.
"""

from __future__ import annotations

import argparse
import math
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade, Vt

from primray.diagnostics import Diagnostics
from primray.incremental.scene import KeptStage
from primray.report.report import Costs, peak_rss_bytes
from primray.settings import RenderSettings

from .kept_scenes import CORNERS, FACES, make
from .kept_scenes import seconds_of as seconds

CAMERA = "/orbiting_camera"
SETTINGS = RenderSettings(resolution=(480, 270), spp=16, camera=CAMERA, threads=2)
STEP = 0.02  # radians
DISTANCE = 1.5  # from the middle, in diagonals of the box around everything
MADE = (
    "10,000 boxes",
    "a cage",
    "a sky of 2k",
    "1,000 lights",
    "an emissive mesh",
    "lights beside cages",
    "instanced cages",
    "displaced cages",
    "NURBS patches",
    "ribbons",
)


class Steps(NamedTuple):
    first: tuple[float, float]  # wall and CPU seconds
    others: list[tuple[float, float]]


def stage_called(name: str, folder: Path) -> Usd.Stage:
    """Return one of the stages that are made, or the one at a path."""
    if name not in MADE:
        return Usd.Stage.Open(name)
    if name == MADE[0]:
        return make(10_000)
    stage = make(100)
    if name == "a cage":
        _become_cage(stage, 7, 12.0)
    elif name == "a sky of 2k":
        UsdLux.DomeLight(stage.GetPrimAtPath("/sky")).CreateTextureFileAttr(_sky(folder))
    elif name == "1,000 lights":
        _add_lights(stage, 1000)
    elif name == "an emissive mesh":
        _add_emissive_mesh(stage, 100_000)
    elif name == "lights beside cages":
        _add_lights(stage, 1000)
        _add_emissive_mesh(stage, 100_000)
        for k in range(20, 40):
            _become_cage(stage, k, 1.0)
    elif name == "instanced cages":
        _add_instanced_cages(stage, 500)
    elif name == "displaced cages":
        _displace(stage, folder, 5)
    elif name == "NURBS patches":
        for k in range(20):
            _add_patch(stage, k)
    else:
        _add_ribbons(stage, 2000)
    return stage


def _become_cage(stage: Usd.Stage, number: int, scale: float) -> UsdGeom.Mesh:
    cage = UsdGeom.Mesh(stage.GetPrimAtPath(f"/world/g0/m{number}"))
    cage.GetSubdivisionSchemeAttr().Set("catmullClark")
    cage.AddScaleOp().Set(Gf.Vec3f(scale))
    return cage


def _add_lights(stage: Usd.Stage, count: int) -> None:
    side = math.ceil(count**0.5)
    for k in range(count):
        kind = UsdLux.SphereLight if k % 2 else UsdLux.RectLight
        light = kind.Define(stage, f"/lights/l{k}")
        light.CreateIntensityAttr(1.0 + k % 7)
        light.AddTranslateOp().Set(Gf.Vec3d(k % side * 10 / side - 5, 3 + k % 3, k // side * 10 / side - 5))
        light.AddRotateXOp().Set(-90.0)
        light.AddScaleOp().Set(Gf.Vec3f(0.05))


def _add_emissive_mesh(stage: Usd.Stage, triangles: int) -> None:
    """Add waves of two triangles a square, all of which emit."""
    side = round((triangles / 2) ** 0.5)
    x, z = np.meshgrid(np.linspace(-5, 5, side + 1), np.linspace(-5, 5, side + 1))
    points = np.stack([x, 4 + 0.3 * np.sin(2 * x) * np.cos(3 * z), z], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(side), np.arange(side))
    corner = (j * (side + 1) + i).ravel()
    a, b, c, d = corner, corner + 1, corner + side + 2, corner + side + 1
    faces = np.stack([a, b, c, a, c, d], axis=1).ravel()
    mesh = UsdGeom.Mesh.Define(stage, "/world/waves")
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.astype(np.float32)))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(faces) // 3, 3, np.int32)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(faces.astype(np.int32)))
    mesh.CreateSubdivisionSchemeAttr("none")
    _bind(mesh, _material(stage, "/mats/emissive", emissiveColor=Gf.Vec3f(2.0, 1.5, 1.0)))


def _material(stage: Usd.Stage, path: str, **inputs: Gf.Vec3f) -> UsdShade.Material:
    made, shader = UsdShade.Material.Define(stage, path), UsdShade.Shader.Define(stage, f"{path}/s")
    shader.CreateIdAttr("UsdPreviewSurface")
    for name, value in inputs.items():
        shader.CreateInput(name, Sdf.ValueTypeNames.Color3f).Set(value)
    made.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    return made


def _bind(prim: UsdGeom.Gprim, material: UsdShade.Material) -> None:
    UsdShade.MaterialBindingAPI.Apply(prim.GetPrim()).Bind(material)


def _add_instanced_cages(stage: Usd.Stage, count: int) -> None:
    instancer = UsdGeom.PointInstancer.Define(stage, "/world/crowd")
    cage = UsdGeom.Mesh.Define(stage, "/world/crowd/cage")
    cage.CreatePointsAttr(CORNERS)
    cage.CreateFaceVertexCountsAttr([4] * 6)
    cage.CreateFaceVertexIndicesAttr(FACES)
    instancer.CreatePrototypesRel().SetTargets([cage.GetPath()])
    instancer.CreateProtoIndicesAttr([0] * count)
    side = math.ceil(count**0.5)
    instancer.CreatePositionsAttr([Gf.Vec3f(k % side * 10 / side - 5, 2, k // side * 10 / side - 5) for k in range(count)])


def _displace(stage: Usd.Stage, folder: Path, count: int) -> None:
    """Displace cages by an image."""
    material = _material(stage, "/mats/bumpy")
    surface = UsdShade.Shader(stage.GetPrimAtPath("/mats/bumpy/s"))
    reader, texture = (UsdShade.Shader.Define(stage, f"/mats/bumpy/{name}") for name in ("st", "bumps"))
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
    texture.CreateIdAttr("UsdUVTexture")
    texture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(_sky(folder))
    texture.CreateInput("scale", Sdf.ValueTypeNames.Float4).Set(Gf.Vec4f(0.1))
    texture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(reader.ConnectableAPI(), "result")
    surface.CreateInput("displacement", Sdf.ValueTypeNames.Float).ConnectToSource(texture.ConnectableAPI(), "r")
    for k in range(count):
        cage = _become_cage(stage, 20 + k, 1.0)
        st = UsdGeom.PrimvarsAPI(cage).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying)
        st.Set([Gf.Vec2f(x, y) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))] * 6)
        _bind(cage, material)


def _add_patch(stage: Usd.Stage, number: int) -> None:
    patch = UsdGeom.NurbsPatch.Define(stage, f"/world/patch{number}")
    at = np.linspace(-0.4, 0.4, 6)
    points = [Gf.Vec3f(x, 0.2 * math.sin(9 * x + number) * math.cos(7 * z), z) for z in at for x in at]
    patch.CreatePointsAttr(points)
    knots = [0, 0, 0, 0, 1, 2, 3, 3, 3, 3]
    patch.CreateUVertexCountAttr(6), patch.CreateVVertexCountAttr(6)
    patch.CreateUOrderAttr(4), patch.CreateVOrderAttr(4)
    patch.CreateUKnotsAttr(knots), patch.CreateVKnotsAttr(knots)
    patch.AddTranslateOp().Set(Gf.Vec3d(number % 5 - 2, 2, number // 5 - 2))


def _add_ribbons(stage: Usd.Stage, count: int) -> None:
    ribbons = UsdGeom.BasisCurves.Define(stage, "/world/ribbons")
    r = np.random.default_rng(3)
    starts = r.uniform(-5, 5, (count, 1, 3)) * (1, 0, 1) + (0, 1, 0)
    points = starts + np.arange(4)[None, :, None] * (0, 0.3, 0) + r.uniform(-0.1, 0.1, (count, 4, 3))
    ribbons.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.reshape(-1, 3).astype(np.float32)))
    ribbons.CreateCurveVertexCountsAttr([4] * count)
    ribbons.CreateTypeAttr("cubic")
    ribbons.CreateBasisAttr("bezier")
    ribbons.CreateNormalsAttr([Gf.Vec3f(0, 0, 1)] * (2 * count))
    ribbons.SetNormalsInterpolation("varying")
    ribbons.CreateWidthsAttr([0.05])
    ribbons.SetWidthsInterpolation("constant")


def _sky(folder: Path) -> str:
    import OpenImageIO as oiio

    texels = np.random.default_rng(1).random((1024, 2048, 3), np.float32) ** 8
    image = oiio.ImageBuf(oiio.ImageSpec(2048, 1024, 3, "half"))
    image.set_pixels(oiio.ROI(0, 2048, 0, 1024), texels)
    file = folder / "sky.exr"
    if not image.write(str(file)):
        raise OSError(image.geterror())
    return str(file)


def measure(stage: Usd.Stage, steps: int) -> Steps:
    """Return the seconds of the first set-up, and of that at each step around the stage's middle."""
    box = UsdGeom.BBoxCache(Usd.TimeCode.EarliestTime(), ["default", "render"]).ComputeWorldBound(stage.GetPseudoRoot())
    around = box.ComputeAlignedRange()
    middle, distance = around.GetMidpoint(), DISTANCE * around.GetSize().GetLength()
    up = Gf.Vec3d(0, 0, 1) if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z else Gf.Vec3d(0, 1, 0)
    camera = UsdGeom.Camera.Define(stage, CAMERA)
    camera.GetPrim().CreateAttribute("primray:nearest", Sdf.ValueTypeNames.Double).Set(distance / 2)
    place = camera.AddTransformOp()
    kept = KeptStage(stage, SETTINGS)

    def go_to(angle: float) -> tuple[float, float]:
        aside = Gf.Rotation(up, math.degrees(angle)).TransformDir(Gf.Vec3d(1, 0, 0)) + 0.4 * up
        view = Gf.Matrix4d().SetLookAt(middle + aside.GetNormalized() * distance, middle, up)
        with Sdf.ChangeBlock():
            place.Set(view.GetInverse())
        return seconds(lambda: kept.prepare(SETTINGS, Costs(), Diagnostics()))

    return Steps(go_to(0.0), [go_to(STEP * (k + 1)) for k in range(steps)])


def report(name: str, steps: int) -> str:
    with tempfile.TemporaryDirectory() as folder:
        found = measure(stage_called(name, Path(folder)), steps)
    wall, cpu = zip(*found.others, strict=True)
    shown = [*found.first, statistics.median(wall), max(wall), statistics.median(cpu), max(cpu)]
    return f"| {Path(name).stem} | {' | '.join(f'{s:.3f}' for s in shown)} | {peak_rss_bytes() / 1e6:.0f} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("stages", nargs="*", default=list(MADE))
    parser.add_argument("--steps", type=int, default=40)
    parser.add_argument("--alone", action="store_true", help="print the row of one stage, measured in this process")
    asked = parser.parse_args()
    if asked.alone:
        print(report(asked.stages[0], asked.steps))
        return
    print("| stage | first, s | first, CPU s | step, s | at worst | step, CPU s | at worst | peak MB |")
    print("|---" * 8 + "|")
    for name in asked.stages:
        command = [sys.executable, "-m", "tests.bench.setup.orbits", "--alone", "--steps", str(asked.steps), name]
        done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
        print(done.stdout.splitlines()[-1], flush=True)


if __name__ == "__main__":
    main()
