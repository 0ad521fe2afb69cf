"""What the service's worker adds to a render: python -m tests.bench.service.overhead [--repetitions N] [--spp N].

The same work on the command line and by LocalExecutor, by turns, both at the workers' priority (nice 10). Render seconds are
the reports' own (the service's include its checkpoint and its first picture); wall seconds go from the start of the process,
or from `submit`, to its end. First picture: from `submit` to the message that a preview of all pixels is there.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tests.bench.results import write_results

from primray_service.executor.base import Chunk
from primray_service.executor.local import LocalExecutor
from primray_service.files import DataDirectory
from primray_service.limits import Limits

SCENES = ("features/glass", "features/dome-texture", "features/clearcoat")
RESOLUTION = (640, 480)
PRIMRAY = str(Path(sys.executable).with_name("primray"))
QUIET_S = 2.5  # until the next warm worker waits


def command_line(scene: Path, spp: int, folder: Path) -> dict[str, float]:
    outputs = ["-o", str(folder / "a.exr"), "-o", str(folder / "a.png"), "--report", str(folder / "a.json")]
    size = [str(side) for side in RESOLUTION]
    program = ["nice", "-n", "10", PRIMRAY, "render", str(scene), "--res", *size, "--spp", str(spp)]
    start = time.perf_counter()
    subprocess.run([*program, *outputs], check=True, capture_output=True)
    wall = time.perf_counter() - start
    return figures(json.loads((folder / "a.json").read_text()), wall)


def figures(report: Mapping[str, Any], wall_s: float) -> dict[str, Any]:
    stages = report["stages_s"]
    return {
        "render_s": stages["render"],
        "stages_s": sum(stages.values()),
        "wall_s": wall_s,
        "sampling_s": report["sampling_s"],
        "render_cpu_s": report["cpu_s"],
        "sha256": report["pixels_sha256"],
    }


async def service(executor: LocalExecutor, scene: Path, spp: int) -> dict[str, Any]:
    times: dict[str, float] = {}
    done: dict[str, Any] = {}
    start = time.perf_counter()

    def hear(message: Mapping[str, Any]) -> None:
        name = message["phase"] if message["at"] == "phase" else message["at"]
        times.setdefault(str(name), time.perf_counter() - start)
        if message["at"] == "done":
            done.update(message["report"])

    command = {"do": "render", "file": "scene.usda", "settings": {"resolution": list(RESOLUTION), "spp": spp}, "number": 0}
    folder = {} if not (scene.parent / "textures").is_dir() else {"textures": scene.parent / "textures"}
    beside = {path.name: path for path in scene.parent.iterdir() if path.is_file()}
    handle = executor.submit(Chunk("bench", "render", command, beside, folder), hear)
    ended = await handle.result()
    wall = time.perf_counter() - start
    assert done, ended
    handle.release()
    return figures(done, wall) | {"sampling_after_s": times["sampling"], "picture_after_s": times["preview"]}


async def measure(name: str, spp: int, repetitions: int, folder: Path) -> dict[str, Any]:
    scene = Path(__file__).parents[3] / "scenes" / name / "scene.usda"
    warm = LocalExecutor(DataDirectory(folder / "warm"), Limits(), cores=2)
    cold = LocalExecutor(DataDirectory(folder / "cold"), Limits(), cores=2, warm=False)
    await warm.start()
    await cold.start()
    rows: dict[str, list[dict[str, Any]]] = {"command line": [], "service": [], "cold": []}
    for _ in range(repetitions):
        rows["command line"].append(command_line(scene, spp, folder))
        rows["service"].append(await service(warm, scene, spp))
        await asyncio.sleep(QUIET_S)
        rows["cold"].append(await service(cold, scene, 2))
    await warm.close()
    await cold.close()
    assert len({row["sha256"] for row in rows["command line"] + rows["service"]}) == 1
    return {"scene": name, "spp": spp, "resolution": RESOLUTION, "runs": rows}


def median(rows: list[dict[str, Any]], name: str) -> float:
    return statistics.median(row[name] for row in rows)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.bench.service.overhead", description=__doc__)
    parser.add_argument("--repetitions", type=int, default=7)
    parser.add_argument("--spp", type=int, default=64)
    options = parser.parse_args()
    rows = []
    for name in SCENES:
        with tempfile.TemporaryDirectory() as folder:
            row = asyncio.run(measure(name, options.spp, options.repetitions, Path(folder)))
        rows.append(row)
        line, served, cold = (row["runs"][which] for which in ("command line", "service", "cold"))
        ratio = {n: median(served, n) / median(line, n) for n in ("render_s", "render_cpu_s", "stages_s", "wall_s")}
        print(
            f"{name:24} render {median(line, 'render_s'):.2f} s, x {ratio['render_s']:.3f} in the service, CPU x "
            f"{ratio['render_cpu_s']:.3f}; "
            f"all stages x {ratio['stages_s']:.3f}, wall x {ratio['wall_s']:.3f}; sampling after "
            f"{median(served, 'sampling_after_s'):.3f} s warm, {median(cold, 'sampling_after_s'):.3f} s cold; picture after "
            f"{median(served, 'picture_after_s'):.3f} s warm, {median(cold, 'picture_after_s'):.3f} s cold"
        )
    path = write_results("service_overhead", rows)
    print(f"written: {path.relative_to(Path.cwd())}")


if __name__ == "__main__":
    main()
