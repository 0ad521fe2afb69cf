"""Stages meant to break what opens them, written to a folder, and a driver that opens and translates each.

`python -m tests.unit.usd.stage.hostile_stages FOLDER` prints one JSON line a stage, as it goes: who started it sees where it
hangs or dies.
"""

from __future__ import annotations

import json
import sys
import time
import traceback
from collections.abc import Iterator
from pathlib import Path

SAMPLED = 'def Xform "a"\n{\n def Sphere "s"\n {\n  double radius.timeSamples = { 1: 1, 2: 2 }\n }\n}\n'
RATES = ("0", "-24", "nan", "inf", "1e308", "1e-308")
GEOMETRY = "Mesh Sphere Cube Cone Cylinder Capsule Plane PointInstancer Points BasisCurves SphereLight DomeLight RectLight"
WRONG = (
    'string points = "here"',
    "int[] faceVertexCounts = [3, -1, 2000000000]",
    "float[] faceVertexIndices = [0, 1, 2]",
    "token radius = 'big'",
    "double[] height = [1]",
    "int2 size = (1, 2)",
    'string inputs:intensity = "bright"',
    "asset xformOp:translate = @x@",
    "matrix4d xformOp:transform = ( (nan, 0, 0, 0), (0, inf, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1) )",
    'uniform token[] xformOpOrder = ["xformOp:transform", "xformOp:nothing", "!invert!xformOp:transform", "xformOp:translate"]',
    "bool visibility = true",
    "int purpose = 3",
    'string primvars:displayColor = "red"',
    "float3[] protoIndices = [(1, 2, 3)]",
    "rel prototypes = </nowhere>",
    "quath[] orientations = [(0, 0, 0, 0)]",
    "point3f[] positions = [(nan, 0, 0)]",
    "double[] widths = [1]",
    'token model:drawMode = "cards"',
    "double3 model:drawModeColor = (nan, 1, 1)",
    "token normals = 'up'",
    "color3f[] primvars:normals = [(1, 1, 1)]",
    'token material:binding = "gold"',
)


def stage(metadata: str = "", body: str = SAMPLED) -> str:
    return "#usda 1.0\n" + (f"(\n {metadata}\n)\n" if metadata else "") + body


def prim(metadata: str, body: str = "", name: str = "r", kind: str = "") -> str:
    return f'def {kind} "{name}" (\n {metadata}\n)\n{{\n{body}\n}}\n'


def texts() -> dict[str, str]:
    """Name and text of every stage; they refer to each other as name.usda."""
    found = {"plain": stage("startTimeCode = 1")}
    for rate in RATES:
        found[f"rate {rate}"] = stage(f"timeCodesPerSecond = {rate}")
        found[f"reference to rate {rate}"] = stage(body=prim(f"references = @./rate {rate}.usda@</a>"))
        found[f"reference from rate {rate}"] = stage(f"timeCodesPerSecond = {rate}", prim("references = @./plain.usda@</a>"))
        found[f"sublayer of rate {rate}"] = stage(f"subLayers = [@./rate {rate}.usda@]", "")
        found[f"frames {rate}"] = stage(f"framesPerSecond = {rate}")
        found[f"reference to frames {rate}"] = stage(body=prim(f"references = @./frames {rate}.usda@</a>"))
        found[f"length {rate}"] = stage(f"metersPerUnit = {rate}")
        found[f"offset {rate}"] = stage(body=prim(f"references = @./plain.usda@</a> (offset = {rate}; scale = {rate})"))
    found |= {
        "end before start": stage("startTimeCode = 10\n endTimeCode = 1"),
        "no default prim": stage('defaultPrim = "nothing"'),
        "axis W": stage('upAxis = "W"'),
        "axis of numbers": stage("upAxis = 3"),
        "rate of text": stage('timeCodesPerSecond = "fast"'),
        "samples at nan": stage(body='def Sphere "s"\n{\n double radius.timeSamples = { nan: 1, inf: 2, 3: 3 }\n}\n'),
        "sublayer of itself": stage("subLayers = [@./sublayer of itself.usda@]"),
        "reference to itself": stage(body=prim("references = </r>")),
        "reference to its child": stage(body=prim("references = </r/c>", prim("references = </r>", name="c"))),
        "payload of itself": stage('defaultPrim = "r"', prim("payload = @./payload of itself.usda@")),
        "instance in itself": stage(
            body=prim("instanceable = true\n references = </r/c>", prim("instanceable = true\n references = </r>", name="c"))
        ),
        "inherits in a ring": stage(body=prim("inherits = </q>") + prim("inherits = </r>", name="q")),
        "unicode ü 日本 %20 %s": stage(body='def Sphere "kugel_ü"\n{\n}\n'),
        "everything is missing": stage(
            "subLayers = [@./no.usda@]", prim("references = @./no1.usda@</a>\n payload = @./no2.usda@\n inherits = </no>")
        ),
        "deep": stage(body="".join('def Xform "p"\n{\n' for _ in range(5000)) + 'def Sphere "s"\n{\n}\n' + "}\n" * 5000),
        "many references": stage(
            body="".join(prim("references = @./plain.usda@</a>", name=f"r{i}") for i in range(3000)),
        ),
        "drawn by cards without end": stage(body=prim('kind = "component"', 'token model:drawMode = "cards"', kind="Xform")),
    }
    for kind in GEOMETRY.split():
        found[f"wrong {kind}"] = stage(body="".join(f'def {kind} "p{i}"\n{{\n {line}\n}}\n' for i, line in enumerate(WRONG)))
        found[f"all wrong {kind}"] = stage(body=f'def {kind} "p"\n{{\n' + "\n".join(f" {line}" for line in WRONG) + "\n}\n")
    found["wrong Camera"] = stage(
        body='def Camera "c"\n{\n string focalLength = "far"\n float2 clippingRange = (nan, -1)\n double[] fStop = [1]\n}\n'
    )
    return found


def write(folder: Path) -> None:
    for name, text in texts().items():
        (folder / f"{name}.usda").write_text(text)
    (folder / "empty.usda").write_bytes(b"")
    (folder / "garbage.usda").write_bytes(bytes(range(256)) * 40)
    (folder / "garbage.usdc").write_bytes(b"PXR-USDC" + bytes(range(256)) * 40)
    (folder / "garbage.usdz").write_bytes(b"PK\3\4" + bytes(range(256)) * 40)
    (folder / "a folder.usda").mkdir()
    (folder / "picture.usda").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100))
    _truncated(folder)
    layers = ",\n".join(f"@./layers/{i}.usda@" for i in range(1000))
    (folder / "layers").mkdir()
    for i in range(1000):
        (folder / f"layers/{i}.usda").write_text(stage(body=f'def Sphere "s{i}"\n{{\n}}\n'))
    (folder / "many sublayers.usda").write_text(stage(f"subLayers = [{layers}]", ""))

    (folder / "too many sublayers.usda").write_text(stage(f"subLayers = [{', '.join(['@./plain.usda@'] * 4001)}]", ""))


def _truncated(folder: Path) -> None:
    from pxr import Sdf, UsdUtils

    Sdf.Layer.FindOrOpen(str(folder / "many references.usda")).Export(str(folder / "whole.usdc"))
    UsdUtils.CreateNewUsdzPackage(str(folder / "plain.usda"), str(folder / "whole.usdz"))
    for name in ("whole.usdc", "whole.usdz"):
        content = (folder / name).read_bytes()
        for part in (0.1, 0.5, 0.99):
            (folder / f"{part:g} of {name}").write_bytes(content[: int(len(content) * part)])


def outcomes(folder: Path) -> Iterator[dict[str, object]]:
    """What became of each stage: an error's code, or the diagnostics' codes."""
    from primray.diagnostics import Diagnostics
    from primray.errors import PrimrayError
    from primray.settings import RenderSettings
    from primray.usd import count_undrawn_shapes, open_stage, stage_facts, translate
    from primray.usd.inspect.scene_facts import scene_facts

    for path in sorted(p for p in folder.iterdir() if p.suffix.startswith(".usd")):
        print(f"# {path.name}", flush=True)
        start = time.process_time()
        found: dict[str, object] = {"name": path.name}
        try:
            for time_code in (None, 1.5):
                opening = Diagnostics()
                stage = open_stage(path, opening)
                _, translating = translate(stage, RenderSettings(time_code=time_code))
            json.dumps(stage_facts(stage))
            count_undrawn_shapes(stage, RenderSettings())
            json.dumps(scene_facts(path).facts)
            found["codes"] = sorted({d.code for d in (*opening, *translating)})
        except PrimrayError as error:
            str(error).encode()
            found["error"] = error.code
            found["exit_code"] = error.exit_code
        except Exception as error:
            found["defect"] = f"{type(error).__name__} {error} at {traceback.extract_tb(error.__traceback__)[-1]}"
        yield found | {"seconds": round(time.process_time() - start, 2)}


if __name__ == "__main__":
    for outcome in outcomes(Path(sys.argv[1])):
        print(json.dumps(outcome), flush=True)
