"""What a step around something costs before its first sample: python -m tests.bench.setup.orbits [STAGE ...].

A camera goes around the middle of a stage that stays, as `primray view` does it, at 480 x 270. Without names the stages are
made: boxes, one cage, boxes under a sky of 2,048 x 1,024. Prints the first set-up, then medians and the worst of the steps,
and the peak memory of a process for each stage.
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
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux

from primray.diagnostics import Diagnostics
from primray.incremental.scene import KeptStage
from primray.report.report import Costs, peak_rss_bytes
from primray.settings import RenderSettings

from .kept_scenes import make
from .kept_scenes import seconds_of as seconds

CAMERA = "/orbiting_camera"
SETTINGS = RenderSettings(resolution=(480, 270), spp=16, camera=CAMERA, threads=2)
STEP = 0.02  # radians
DISTANCE = 1.5  # from the middle, in diagonals of the box around everything
MADE = ("10,000 boxes", "a cage", "a sky of 2k")


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
    if name == MADE[1]:
        cage = UsdGeom.Mesh(stage.GetPrimAtPath("/world/g0/m7"))
        cage.GetSubdivisionSchemeAttr().Set("catmullClark")
        cage.AddScaleOp().Set(Gf.Vec3f(12.0))
    else:
        UsdLux.DomeLight(stage.GetPrimAtPath("/sky")).CreateTextureFileAttr(_sky(folder))
    return stage


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
