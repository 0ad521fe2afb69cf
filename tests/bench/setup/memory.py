"""Peak memory of renders against the estimate of `primray inspect`: python -m tests.bench.setup.memory [SHEET.json FOLDER].

Without arguments it renders generated stages, each large in one thing only; with the JSON of a contact sheet of a folder it
compares what that one measured. The first pair of figures is the whole process; the second leaves out what a process takes
without a scene.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt
from tests.bench.results import write_results

from primray import usd
from primray.cli.sheet_renders import Limits, render_all
from primray.diagnostics import Diagnostics
from primray.report.summary import PROCESS_BYTES, summary, texture_sizes
from primray.settings import RenderSettings

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


def cage(stage: Usd.Stage) -> None:
    grid(stage, "/m", 500).CreateSubdivisionSchemeAttr("catmullClark")


def textures(stage: Usd.Stage) -> None:
    """Images of 8 bits: three read as colours, of the last one channel."""
    colors = [(f"{field}.png", 3, "uint8", field, "rgb") for field in ("diffuseColor", "emissiveColor", "specularColor")]
    bound_to_images(stage, [*colors, ("r.png", 3, "uint8", "roughness", "r")])


def float_textures(stage: Usd.Stage) -> None:
    bound_to_images(stage, [("c.exr", 3, "half", "diffuseColor", "rgb"), ("e.exr", 3, "half", "emissiveColor", "rgb")])


def bound_to_images(stage: Usd.Stage, images: list[tuple[str, int, str, str, str]]) -> None:
    """A quad with a material that reads images of 4096 x 4096: file, channels, type, input, output."""
    mesh = grid(stage, "/m", 1)
    st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, "vertex")
    st.Set(Vt.Vec2fArray([(0, 0), (1, 0), (0, 1), (1, 1)]))
    material = UsdShade.Material.Define(stage, "/look")
    surface = UsdShade.Shader.Define(stage, "/look/surface")
    surface.CreateIdAttr("UsdPreviewSurface")
    material.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")
    reader = UsdShade.Shader.Define(stage, "/look/st")
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
    for name, channels, kind, field, output in images:
        write_image(Path(stage.GetRootLayer().realPath).parent / name, channels, kind)
        texture = UsdShade.Shader.Define(stage, f"/look/{field}")
        texture.CreateIdAttr("UsdUVTexture")
        texture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(Sdf.AssetPath(f"./{name}"))
        texture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(reader.ConnectableAPI(), "result")
        wanted = Sdf.ValueTypeNames.Color3f if output == "rgb" else Sdf.ValueTypeNames.Float
        surface.CreateInput(field, wanted).ConnectToSource(texture.ConnectableAPI(), output)
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)


def write_image(path: Path, channels: int, kind: str, side: int = 4096) -> None:
    row = np.linspace(0, 1, side, dtype=np.float32)
    pixels = np.broadcast_to((row[:, None] * row)[:, :, None], (side, side, channels))
    image = oiio.ImageBuf(oiio.ImageSpec(side, side, channels, kind))
    image.set_pixels(oiio.ROI(0, side, 0, side), np.ascontiguousarray(pixels))
    image.write(str(path))


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
    "a cage": cage,
    "textures": textures,
    "float textures": float_textures,
    "many meshes": many_meshes,
    "instances": instances,
}


def generated() -> Iterator[Row]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        # In another process: the peak of one that starts renders counts as theirs (getrusage(2) across fork).
        with ProcessPoolExecutor(1, get_context("spawn")) as process:
            paths = process.submit(make_all, folder).result()
        outcomes = render_all(folder, paths, LIMITS, 1, folder / "out", lambda outcome: None)
        estimates = {outcome.stage: estimate(folder / outcome.stage, LIMITS.width) for outcome in outcomes}
    for outcome in outcomes:
        yield Row(outcome.stage, outcome.peak_rss_bytes, estimates[outcome.stage])


def make_all(folder: Path) -> list[Path]:
    paths = [folder / f"{case}.usdc" for case in GENERATED]
    for path, make in zip(paths, GENERATED.values(), strict=True):
        make(stage := Usd.Stage.CreateNew(str(path)))
        stage.Save()
    return paths


def estimate(stage: Path, width: int) -> int:
    """As `primray inspect` says it: of what is translated, before cages are diced and images are read."""
    description, _ = usd.translate(usd.open_stage(stage, Diagnostics()), RenderSettings(resolution=(width, 0)))
    sizes = texture_sizes(description, usd.read_asset).values()
    return summary(description, images=[size for size in sizes if size]).process_bytes


def of_sheet(sheet: Path, folder: Path) -> Iterator[Row]:
    """The renders of a contact sheet's JSON that came to an end."""
    for row in json.loads(sheet.read_text()):
        if row["report"]:
            width = row["report"]["settings"]["resolution"][0]
            yield Row(row["stage"], row["peak_rss_bytes"], estimate(folder / row["stage"], width))


def main() -> None:
    found = of_sheet(Path(sys.argv[1]), Path(sys.argv[2])) if len(sys.argv) > 2 else generated()
    rows = sorted(found, key=lambda row: -row.measured)
    write_results("memory_of_a_folder" if len(sys.argv) > 2 else "memory", [asdict(row) for row in rows])
    for row in rows:
        measured, estimated = row.measured / MIB, row.estimated / MIB
        above = [max(0.0, mib - PROCESS_BYTES / MIB) for mib in (measured, estimated)]
        ratio = f"{measured:7.1f} MiB measured {estimated:7.1f} estimated: {estimated / measured:.2f}"
        print(f"{ratio} ({above[0]:7.1f} {above[1]:7.1f})  {row.name}")


if __name__ == "__main__":
    main()
