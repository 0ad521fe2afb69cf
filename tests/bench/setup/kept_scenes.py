"""What an edit of a scene that stays costs before its first sample: python -m tests.bench.setup.kept_scenes [COUNT ...].

Boxes with materials of their own kind, a light, a sky and a camera; edits of each kind in turn, and a new render after each
round of them. Prints medians; compares nothing (tests/properties/test_kept_scenes.py does).
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from functools import partial

from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade

from primray.diagnostics import Diagnostics
from primray.incremental.scene import KeptStage
from primray.render import open_once, prepare
from primray.report.report import Costs
from primray.settings import RenderSettings

FACES = [0, 1, 3, 2, 4, 6, 7, 5, 0, 4, 5, 1, 2, 3, 7, 6, 0, 2, 6, 4, 1, 5, 7, 3]
CORNERS = [Gf.Vec3f(x, y, z) for x in (-0.4, 0.4) for y in (-0.4, 0.4) for z in (-0.4, 0.4)]
SETTINGS = RenderSettings(resolution=(320, 180), spp=16, time_code=1.0)
MATERIALS = 20

Edit = Callable[[Usd.Stage, int], object]


def make(count: int) -> Usd.Stage:
    stage = Usd.Stage.CreateInMemory()
    for k in range(MATERIALS):
        made, shader = UsdShade.Material.Define(stage, f"/mats/m{k}"), UsdShade.Shader.Define(stage, f"/mats/m{k}/s")
        shader.CreateIdAttr("UsdPreviewSurface")
        shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(0.5)
        made.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    side = int(count**0.5) + 1
    for i in range(count):
        mesh = UsdGeom.Mesh.Define(stage, f"/world/g{i // 100}/m{i}")
        mesh.CreatePointsAttr(CORNERS)
        mesh.CreateFaceVertexCountsAttr([4] * 6)
        mesh.CreateFaceVertexIndicesAttr(FACES)
        mesh.CreateSubdivisionSchemeAttr("none")
        mesh.AddTranslateOp().Set(Gf.Vec3d(i % side - side / 2, 0, i // side - side / 2))
        UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(
            UsdShade.Material(stage.GetPrimAtPath(f"/mats/m{i % MATERIALS}"))
        )
    moving = UsdGeom.Xformable(stage.GetPrimAtPath("/world/g0/m1")).GetOrderedXformOps()[0]
    for t in (1, 9):
        moving.Set(Gf.Vec3d(0, t, 0), t)
    lamp = UsdLux.SphereLight.Define(stage, "/lamp")
    lamp.CreateIntensityAttr(1000)
    lamp.AddTranslateOp().Set(Gf.Vec3d(0, side, 0))
    UsdLux.DomeLight.Define(stage, "/sky").CreateIntensityAttr(0.3)
    camera = UsdGeom.Camera.Define(stage, "/cam")
    camera.AddTranslateOp().Set(Gf.Vec3d(0, side / 3, side))
    camera.AddRotateXOp().Set(-20)
    return stage


def _setting(path: str, name: str, value: Callable[[int], object]) -> Edit:
    return lambda stage, k: stage.GetPrimAtPath(path).GetAttribute(name).Set(value(k))


EDITS: dict[str, Edit] = {
    "light": _setting("/lamp", "inputs:intensity", lambda k: 500.0 + k),
    "material": _setting("/mats/m3/s", "inputs:roughness", lambda k: 0.3 + k / 100),
    "camera turns": _setting("/cam", "xformOp:rotateX", lambda k: -21.0 - k / 10),
    "camera moves": _setting("/cam", "xformOp:translate", lambda k: Gf.Vec3d(k / 100, 30, 100)),
    "transform": _setting("/world/g0/m5", "xformOp:translate", lambda k: Gf.Vec3d(0, 1 + k / 100, 0)),
    "time code": lambda stage, k: None,
    "nothing": lambda stage, k: None,
}


def measure(count: int, rounds: int) -> tuple[dict[str, list[tuple[float, float]]], list[tuple[float, float]]]:
    """Wall and CPU seconds of each round: by edit, and of new renders, one a round."""
    stage = make(count)
    kept, found, new = KeptStage(stage, SETTINGS), {name: list[tuple[float, float]]() for name in EDITS}, []
    kept.prepare(SETTINGS, Costs(), Diagnostics())
    time_code = 1.0
    for k in range(rounds):
        for name, edit in EDITS.items():
            edit(stage, k)
            time_code = 2.0 + k % 5 if name == "time code" else time_code
            settings = RenderSettings(resolution=(320, 180), spp=16, time_code=time_code)
            found[name].append(seconds_of(partial(kept.prepare, settings, Costs(), Diagnostics())))
        opened = open_once(stage, SETTINGS)
        new.append(seconds_of(partial(prepare, stage, opened.diagnostics, SETTINGS, Costs(), Diagnostics())))
    return found, new


def seconds_of(done: Callable[[], object]) -> tuple[float, float]:
    wall, cpu = time.perf_counter(), time.process_time()
    done()
    return time.perf_counter() - wall, time.process_time() - cpu


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("counts", type=int, nargs="*", default=[100, 10_000])
    parser.add_argument("--rounds", type=int, default=5)
    asked = parser.parse_args()
    for count in asked.counts:
        found, new = measure(count, asked.rounds)
        print(f"| {count:,} prims | seconds | at worst | CPU seconds |\n|---|---|---|---|")
        for name, each in [*found.items(), ("a new render", new)]:
            wall, cpu = zip(*each, strict=True)
            print(f"| {name} | {statistics.median(wall):.3f} | {max(wall):.3f} | {statistics.median(cpu):.3f} |")


if __name__ == "__main__":
    main()
