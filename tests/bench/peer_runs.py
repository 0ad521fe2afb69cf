"""Runs one renderer on one compared scene in a process of its own, ours through its command line, the others through their
runner; and the scenes' files, made when they are first asked for."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

from primray import __version__

from .peers.installed import DENOISED, OURS, PACKAGES, Renderer
from .peers.scene import Scene
from .peers.scenes import SCENES
from .peers.write_usd import CAMERA

ROOT = Path(__file__).parents[2]
PEERS = Path(__file__).parent / "peers"
PRIMRAY = [sys.executable, str(Path(sys.executable).with_name("primray"))]
# What scenes are made by.
SOURCES = tuple(
    f"{name}.py" for name in ("scene", "scenes", "dim_rooms", "glass_scenes", "moving_scenes", "surfaces", "grooms", "shapes")
)
LIMIT_S = 900  # for a process
Rows = list[dict[str, Any]]


def kept() -> Path:
    """Where scenes and references are kept between runs: $PRIMRAY_BENCH, or a folder for temporary files."""
    return Path(os.environ.get("PRIMRAY_BENCH", Path(tempfile.gettempdir()) / "primray_bench"))


@cache
def digest(scene: str) -> str:
    """Of everything the scene is made of; references of another scene by that name are not taken for this one's."""
    sources = hashlib.sha256(b"".join((PEERS / name).read_bytes() for name in SOURCES)).hexdigest()[:12]
    known = kept() / "digests" / f"{scene}_{sources}"  # making a scene takes seconds
    if not known.exists():
        known.parent.mkdir(parents=True, exist_ok=True)
        known.write_text(_digest_of(SCENES[scene]()))
    return known.read_text()


def _digest_of(made: Scene) -> str:
    found = hashlib.sha256()
    for mesh in made.meshes.values():
        found.update(mesh.points.tobytes() + mesh.faces.tobytes())
    for image in made.images.values():
        found.update(image.tobytes())
    if made.placed is not None:
        found.update(made.placed.matrices().tobytes())
    for points in made.ends.values():
        found.update(points.tobytes())
    if made.strands is not None:
        found.update(made.strands.points.tobytes() + repr((made.strands.radius, made.strands.look)).encode())
    if made.moves:
        found.update(repr((made.glides, made.pan, made.placed and made.placed.shifts)).encode())
    found.update(repr((made.resolution, made.depth, made.camera, made.looks, made.objects, made.lamps)).encode())
    return found.hexdigest()[:12]


def folder_of(scene: str) -> Path:
    """The scene's files, written if they are not there."""
    folder = kept() / "scenes" / f"{scene}_{digest(scene)}"
    if not (folder / f"{scene}.json").exists():
        from .peers.write_plain import write_scene

        write_scene(scene, folder)
    return folder


def run(
    renderer: Renderer, scene: str, pictures: Sequence[tuple[int, int]], out: Path, limit_s: float, total_s: float = 1e9
) -> Rows:
    """Rows as loop.py tells them: the first picture, then `pictures` (samples, seed) up to the limits."""
    out.mkdir(parents=True, exist_ok=True)
    if renderer.peer == OURS:
        return _ours(renderer, scene, pictures, out, limit_s, total_s)
    job = {
        "folder": str(folder_of(scene)), "scene": scene, "variant": renderer.variant, "threads": os.cpu_count(),
        "package": PACKAGES[renderer.peer],
        "pictures": list(pictures), "limit_s": limit_s, "total_s": total_s, "out": str(out), "launched": time.monotonic(),
    }  # fmt: skip
    module = f"tests.bench.peers.run_{renderer.peer}"
    done = subprocess.run(
        [str(renderer.python), "-m", module, json.dumps(job)],
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
        check=False,
    )
    rows = [json.loads(line)["primray-bench"] for line in done.stdout.splitlines() if line.startswith('{"primray-bench"')]
    if done.returncode or len(rows) < 2:
        raise SystemExit(f"{renderer.name} on {scene}:\n{done.stderr[-3000:]}\n{done.stdout[-1000:]}")
    return rows


def _ours(
    renderer: Renderer, scene: str, pictures: Sequence[tuple[int, int]], out: Path, limit_s: float, total_s: float
) -> Rows:
    """A process for each picture, as anyone would run it; a picture's seconds are those of rendering, and of denoising."""
    flags = ["--denoise"] if renderer.variant == DENOISED else []
    report, took = _command_line(scene, 1, 1, out, flags)
    rows: Rows = [
        {
            "what": "first",
            "version": __version__,
            "process_s": took,
            "render_s": report["stages_s"]["render"],
            "peak_mb": report["peak_rss_bytes"] / 2**20,
            "stages_s": {name: s for name, s in report["stages_s"].items() if name not in ("render", "write")},
        }
    ]
    per_sample, spent = 0.0, 0.0
    for k, (samples, seed) in enumerate(pictures):
        if per_sample * samples > limit_s or (k >= 2 and spent > total_s):
            break
        report, _ = _command_line(scene, samples, seed, out, flags)
        seconds = report["stages_s"]["render"] + report["stages_s"].get("denoise", 0.0)
        rows.append(
            {
                "what": "picture",
                "samples": samples,
                "seed": seed,
                "seconds": seconds,
                "cpu_s": report["cpu_s"],
                "peak_mb": report["peak_rss_bytes"] / 2**20,
                "path": str(out / f"{samples}_{seed}.exr"),
            }
        )
        per_sample, spent = seconds / samples, spent + seconds
    return rows


@cache
def facts(scene: str) -> dict[str, Any]:
    """What write_plain.py says of a scene."""
    read: dict[str, Any] = json.loads((folder_of(scene) / f"{scene}.json").read_text())
    return read


def _command_line(scene: str, samples: int, seed: int, out: Path, flags: Sequence[str] = ()) -> tuple[dict[str, Any], float]:
    about = facts(scene)
    path, report = out / f"{samples}_{seed}.exr", out / "report.json"
    options = ["--camera", CAMERA, "--res", *map(str, about["resolution"]), "--max-depth", str(about["depth"])]
    if about.get("motion"):
        options += ["--frame", "0"]
    options += ["--filter", "box", "--filter-width", "1", "--spp", str(samples), "--seed", str(seed), *flags]
    stage = folder_of(scene) / f"{scene}.usdc"
    start = time.perf_counter()
    done = subprocess.run(
        [*PRIMRAY, "render", str(stage), "-o", str(path), "--report", str(report), *options],
        capture_output=True,
        text=True,
        check=False,
    )
    took = time.perf_counter() - start
    if done.returncode:
        raise SystemExit(done.stderr)
    return json.loads(report.read_text()), took
