"""Peak memory of renders against the estimate of `primray inspect`: python -m tests.bench.memory [SHEET.json ...].

Without arguments it renders generated stages, each large in one thing only; with the JSON of a contact sheet it compares what
that one measured. The first pair of figures is the whole process; the second leaves out what a process takes without a scene.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, Vt

from primray.cli.sheet_runs import Limits, Outcome, render_all
from primray.summary import PROCESS_BYTES

LIMITS = Limits(width=200, spp=1, timeout_s=300, memory_bytes=2**35, threads=None)
MIB = 2**20


@dataclass(frozen=True)
class Row:
    name: str
    measured: int  # peak of the process, in bytes
    estimated: int


def grid(stage: Usd.Stage, path: str, side: int) -> UsdGeom.Mesh:
    """side x side quads."""
    mesh = UsdGeom.Mesh.Define(stage, path)
    x, y = np.meshgrid(np.linspace(-1, 1, side + 1), np.linspace(-1, 1, side + 1))
    points = np.stack([x, y, 0.1 * np.sin(9 * x) * np.cos(9 * y)], axis=-1).reshape(-1, 3).astype(np.float32)
    k = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).reshape(-1, 1)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray(side * side, 4))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy((k + [0, 1, side + 2, side + 1]).ravel().astype(np.int32)))
    mesh.CreateSubdivisionSchemeAttr("none")
    return mesh


def triangles(stage: Usd.Stage) -> None:
    grid(stage, "/m", 700)


def triangles_with_normals(stage: Usd.Stage) -> None:
    mesh = grid(stage, "/m", 700)
    mesh.CreateNormalsAttr(Vt.Vec3fArray(701 * 701, Gf.Vec3f(0, 0, 1)))


def many_meshes(stage: Usd.Stage) -> None:
    with Sdf.ChangeBlock():
        for k in range(2000):
            Sdf.CreatePrimInLayer(stage.GetRootLayer(), f"/m{k}")
    for k in range(2000):
        grid(stage, f"/m{k}", 4)


def instances(stage: Usd.Stage) -> None:
    instancer = UsdGeom.PointInstancer.Define(stage, "/i")
    UsdGeom.Cube.Define(stage, "/i/c")
    instancer.CreatePrototypesRel().AddTarget("/i/c")
    count = 500_000
    instancer.CreateProtoIndicesAttr(Vt.IntArray(count, 0))
    positions = np.random.default_rng(0).random((count, 3), np.float32) * 1000
    instancer.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(positions))


def one_sphere(stage: Usd.Stage) -> None:
    UsdGeom.Sphere.Define(stage, "/s")


GENERATED: dict[str, Callable[[Usd.Stage], None]] = {
    "one sphere": one_sphere,
    "triangles": triangles,
    "triangles with normals": triangles_with_normals,
    "many meshes": many_meshes,
    "instances": instances,
}


def generated() -> Iterator[Row]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        paths = [folder / f"{case}.usdc" for case in GENERATED]
        for path, make in zip(paths, GENERATED.values(), strict=True):
            make(stage := Usd.Stage.CreateNew(str(path)))
            stage.Save()
        outcomes = render_all(folder, paths, LIMITS, 1, folder / "out", lambda outcome: None)
    yield from rows([as_row(outcome) for outcome in outcomes])


def as_row(outcome: Outcome) -> dict[str, Any]:
    return {"stage": outcome.stage, "peak_rss_bytes": outcome.peak_rss_bytes, "report": outcome.report}


def rows(measured: list[dict[str, Any]]) -> Iterator[Row]:
    """Of a contact sheet's JSON: the renders that came to an end."""
    for row in measured:
        if row["report"]:
            yield Row(row["stage"], row["peak_rss_bytes"], row["report"]["scene"]["process_bytes"])


def main() -> None:
    sources = [rows(json.loads(Path(file).read_text())) for file in sys.argv[1:]] or [generated()]
    for row in sorted((row for source in sources for row in source), key=lambda row: -row.measured):
        measured, estimated = row.measured / MIB, row.estimated / MIB
        above = [max(0.0, mib - PROCESS_BYTES / MIB) for mib in (measured, estimated)]
        ratio = f"{measured:7.1f} MiB measured {estimated:7.1f} estimated: {estimated / measured:.2f}"
        print(f"{ratio} ({above[0]:7.1f} {above[1]:7.1f})  {row.name}")


if __name__ == "__main__":
    main()
