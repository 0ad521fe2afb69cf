"""A twin of a production set's textures, and what a budget for them costs: python -m tests.bench.setup.texture_twin FOLDER.

The whole set has 300 textures of 4096 x 4096 in tiles (TIFF of 8 bits, EXR in half precision), 30 that are not (PNG, JPEG, and
five EXRs of 8192 x 4096 floats in scanlines), and 2,000 prims, most of them seen small. `--share 0.1` makes a tenth of all. A
few master images are written; the others are copies with some texels of their own, so that no two have the same content.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import numpy.typing as npt
import OpenImageIO as oiio

TILED, UNTILED, HDR, PRIMS = 300, 30, 5, 2000
MASTERS = 4
STAMP = np.random.default_rng(99).integers(1, 255, 48).astype(np.uint8)  # a run of bytes that is found again in a file


def noisy(width: int, height: int, seed: int) -> npt.NDArray[np.float32]:
    """Detail at all scales, as paint and dirt have."""
    r = np.random.default_rng(seed)
    total = np.zeros((height, width, 3), np.float32)
    for step in (256, 64, 16, 4, 1):
        layer = r.random((max(height // step, 1), max(width // step, 1), 3), np.float32)
        total += layer.repeat(step, axis=0).repeat(step, axis=1)[:height, :width] * np.float32(step**0.25)
    return np.asarray(total / total.max(), np.float32)


def write(path: Path, texels: npt.NDArray[Any], kind: str, tile: int = 0, **attributes: object) -> None:
    height, width, _ = texels.shape
    spec = oiio.ImageSpec(width, height, 3, kind)
    if tile:
        spec.tile_width = spec.tile_height = tile
    for name, value in attributes.items():
        spec.attribute(name, value)
    file = oiio.ImageOutput.create(str(path))
    assert file
    assert file.open(str(path), spec), oiio.geterror()
    assert file.write_image(texels), file.geterror()
    file.close()


def write_tiled(folder: Path, count: int, size: int) -> list[str]:
    """Write masters without compression, and copies of them with a stamp of their own."""
    masters: list[tuple[str, bytes, int]] = []
    for k in range(MASTERS):
        texels = noisy(size, size, k)
        if k % 2 == 0:
            codes = np.round(texels * 255).astype(np.uint8)
            codes[32, :16] = STAMP.reshape(16, 3)
            path = folder / f"master{k}.tif"
            write(path, codes, "uint8", 64, compression="none")
        else:
            half = (texels * 2).astype(np.float16)
            half[32, :8] = STAMP.view(np.float16).reshape(8, 3) if np.isfinite(STAMP.view(np.float16)).all() else 0.123
            path = folder / f"master{k}.exr"
            write(path, half.astype(np.float32), "half", 64, compression="none")
        data = path.read_bytes()
        masters.append((path.suffix, data, max(data.find(STAMP.tobytes()), len(data) // 2)))
        path.unlink()
    names = []
    for k in range(count):
        suffix, data, at = masters[k % len(masters)]
        name = f"tiled{k:04}{suffix}"
        with open(folder / name, "wb") as file:
            file.write(data[:at] + f"{k:04}".encode() + data[at + 4 :])
        names.append(name)
    return names


def write_untiled(folder: Path, count: int, hdr: int, size: int) -> list[str]:
    names = []
    for k in range(count):
        if k < hdr:
            texels = noisy(2 * size, size, 100 + k) * 8
            name = f"sky{k}.exr"
            write(folder / name, texels, "float", compression="zips")
        else:
            is_png = (k - hdr) % 2 == 0
            name = f"plain{k:02}.{'png' if is_png else 'jpg'}"
            codes = np.round(noisy(size, size, 100 + k) * 255).astype(np.uint8)
            write(folder / name, codes, "uint8", **({"png:compressionLevel": 1} if is_png else {}))
        names.append(name)
    return names


def write_stage(folder: Path, names: list[str], prims: int) -> Path:
    """Plates on a ground, from near the camera to far away, turned about; each has one of the textures."""
    r = np.random.default_rng(7)
    text = [
        '#usda 1.0\n(upAxis = "Y")\n'
        'def Camera "cam" { float focalLength = 35\n float2 clippingRange = (0.1, 100000)\n'
        'double3 xformOp:translate = (0, 1.6, 0)\n uniform token[] xformOpOrder = ["xformOp:translate"] }\n'
        'def DomeLight "dome" { float inputs:intensity = 0.5 }\n'
        'def DistantLight "sun" { float inputs:intensity = 2\n double3 xformOp:rotateXYZ = (-50, 30, 0)\n'
        ' uniform token[] xformOpOrder = ["xformOp:rotateXYZ"] }\ndef Scope "looks" {\n'
    ]
    for k, name in enumerate(names):
        text.append(
            f'def Material "m{k}" {{ token outputs:surface.connect = </looks/m{k}/s.outputs:surface>\n'
            f'def Shader "s" {{ uniform token info:id = "UsdPreviewSurface"\n'
            f"color3f inputs:diffuseColor.connect = </looks/m{k}/t.outputs:rgb>\n"
            + (f"float inputs:roughness.connect = </looks/m{k}/t.outputs:g>\n" if k % 3 == 0 else "")
            + "token outputs:surface }\n"
            f'def Shader "t" {{ uniform token info:id = "UsdUVTexture"\n asset inputs:file = @./{name}@\n'
            f"float2 inputs:st.connect = </looks/m{k}/r.outputs:result>\n"
            'token inputs:wrapS = "repeat"\n token inputs:wrapT = "repeat"\n float3 outputs:rgb\n float outputs:g }\n'
            'def Shader "r" { uniform token info:id = "UsdPrimvarReader_float2"\n string inputs:varname = "st"\n'
            "float2 outputs:result } }\n"
        )
    text.append("}\n")
    for k in range(prims):
        depth = 3 * 100 ** (k / max(prims - 1, 1))  # as many near as far in each octave
        x, y, turn = r.uniform(-0.6, 0.6) * depth, r.uniform(0, 0.25) * depth, r.uniform(-60, 60)
        text.append(
            f'def Mesh "p{k}" (prepend apiSchemas = ["MaterialBindingAPI"]) {{ int[] faceVertexCounts = [4]\n'
            "int[] faceVertexIndices = [0, 1, 2, 3]\n point3f[] points = [(-1, 0, 0), (1, 0, 0), (1, 2, 0), (-1, 2, 0)]\n"
            'texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (interpolation = "vertex")\n'
            f"rel material:binding = </looks/m{k % len(names)}>\n"
            f"double3 xformOp:translate = ({x:.4f}, {y:.4f}, {-depth:.4f})\n double xformOp:rotateY = {turn:.3f}\n"
            'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateY"] }\n'
        )
    text.append(
        'def Mesh "ground" (prepend apiSchemas = ["MaterialBindingAPI"]) { int[] faceVertexCounts = [4]\n'
        "int[] faceVertexIndices = [0, 1, 2, 3]\n"
        "point3f[] points = [(-400, 0, 10), (400, 0, 10), (400, 0, -400), (-400, 0, -400)]\n"
        'texCoord2f[] primvars:st = [(0, 0), (80, 0), (80, 41), (0, 41)] (interpolation = "vertex")\n'
        f"rel material:binding = </looks/m{len(names) - 1}> }}\n"
    )
    path = folder / "set.usda"
    path.write_text("".join(text).replace(" }", "\n}"))  # USD ends a statement with its line
    return path


def make(folder: Path, share: float, size: int = 4096) -> Path:
    """Write a share of the set; return its stage."""
    folder.mkdir(parents=True, exist_ok=True)
    tiled = write_tiled(folder, max(round(TILED * share), 1), size)
    untiled = write_untiled(folder, max(round(UNTILED * share), 2), max(round(HDR * share), 1), size)
    return write_stage(folder, [*tiled, *untiled], max(round(PRIMS * share), 4))


def render(stage: Path, cache: Path | None, budget: int | None, spp: int, width: int, threads: int = 2) -> dict[str, Any]:
    """Render in a process of its own; return what of its report costs and pixels are."""
    settings = {"resolution": (width, width * 9 // 16), "spp": spp, "threads": threads, "camera": "/cam"}
    if budget is not None:
        settings |= {"texture_memory_bytes": budget, "texture_cache": str(cache)}
    script = (
        "import json, sys, primray\n"
        f"report = primray.render({str(stage)!r}, primray.RenderSettings(**{settings!r})).report\n"
        "names = 'stages_s', 'cpu_s', 'cpu_total_s', 'peak_rss_bytes', 'pixels_sha256', 'texture_memory'\n"
        "print(json.dumps({n: report.get(n) for n in names}))\n"
    )
    start = time.monotonic()
    done = subprocess.run([sys.executable, "-W", "ignore", "-c", script], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(done.stderr)
    return {**json.loads(done.stdout), "wall_s": time.monotonic() - start}


def row(name: str, found: dict[str, Any]) -> dict[str, Any]:
    tiles = found["texture_memory"] or {}
    made = {
        "run": name,
        "cpu_total_s": round(found["cpu_total_s"], 2),
        "sampling_cpu_s": round(found["cpu_s"], 2),
        "peak_rss_mb": round(found["peak_rss_bytes"] / 2**20),
        "sha256": found["pixels_sha256"][:16],
    }
    if tiles:
        made |= {name: tiles[name] for name in ("images", "tiles_read", "tiles_evicted")}
        made |= {"read_s": round(tiles["read_s"], 3), "peak_tiles_mb": round(tiles["peak_bytes"] / 2**20)}
        made |= {"written_mb": round(tiles["cache"]["written_bytes"] / 2**20)}
    print(json.dumps(made), flush=True)
    return made


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--share", type=float, default=0.1)
    parser.add_argument("--size", type=int, default=4096)
    parser.add_argument("--budgets", default="4,400", help="MiB, by commas")
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--width", type=int, default=960)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--whole", action="store_true", help="also without a budget, by turns with the largest")
    asked = parser.parse_args()
    stage, cache = asked.folder / "set.usda", asked.folder / "cache"
    if not stage.exists():
        make(asked.folder, asked.share, asked.size)
    budgets = [int(text) << 20 for text in asked.budgets.split(",")]
    rows = [row(f"{budgets[-1] >> 20} MiB, cold", render(stage, cache, budgets[-1], asked.spp, asked.width))]
    rows += [row(f"{b >> 20} MiB", render(stage, cache, b, asked.spp, asked.width)) for b in budgets]
    if asked.whole:
        costs: dict[str, list[float]] = {"whole": [], "budget": []}
        for _ in range(asked.rounds):
            for name, budget in (("whole", None), ("budget", budgets[-1])):
                found = render(stage, cache, budget, asked.spp, asked.width)
                rows.append(row(name, found))
                costs[name].append(found["cpu_s"])
        print(f"sampling with {budgets[-1] >> 20} MiB / whole: {median(costs['budget']) / median(costs['whole']):.3f}")
    assert len({each["sha256"] for each in rows}) == 1, "the pixels depend on the budget"


if __name__ == "__main__":
    main()
