"""What every runner does once its renderer has the scene: a first picture, then pictures of more and more samples.

Standard library alone, as it runs in the Pythons of other renderers. A runner is `run_X.py JOB`, JOB a JSON object:
folder, scene, variant, package, threads, pictures ([samples, seed] each), limit_s (for one), total_s (for all but the first
two), out (where they go, `<samples>_<seed>.exr`), launched (the machine's monotonic clock). It writes one JSON object a line:
the first picture (seconds since the launch), then each picture's own seconds.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

from .plain import PlainScene

Render = Callable[[int, int], None]  # samples, seed; returns when the picture is finished
Save = Callable[[str], object]
Stages = dict[str, float]
Setup = Callable[[PlainScene, dict[str, Any]], tuple[Render, Save, Stages]]


def cpu_seconds() -> float:
    times = os.times()
    return times.user + times.system


def peak_mb() -> float:
    """The most this program has held (proc(5)); getrusage(2) would count what its parent held as well."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmHWM:"):
            return int(line.split()[1]) / 1024
    return 0.0


def tell(**facts: Any) -> None:
    """On the descriptor the parent reads, whatever the renderer prints."""
    sys.stdout.write("\n" + json.dumps({"primray-bench": facts}) + "\n")
    sys.stdout.flush()


def run(setup: Setup) -> None:
    job = json.loads(sys.argv[1])
    render, save, stages = setup(PlainScene(Path(job["folder"]), job["scene"]), job)
    began = time.perf_counter()
    render(1, 1)
    first = time.perf_counter() - began
    told = {"what": "first", "version": version(job["package"])}
    tell(**told, process_s=time.monotonic() - job["launched"], render_s=first, peak_mb=peak_mb(), stages_s=stages)
    per_sample, spent_s = 0.0, 0.0
    for k, (samples, seed) in enumerate(job["pictures"]):
        if per_sample * samples > job["limit_s"] or (k >= 2 and spent_s > job["total_s"]):
            break
        cpu, began = cpu_seconds(), time.perf_counter()
        render(samples, seed)
        seconds, cpu = time.perf_counter() - began, cpu_seconds() - cpu
        path = f"{job['out']}/{samples}_{seed}.exr"
        save(path)
        tell(what="picture", samples=samples, seed=seed, seconds=seconds, cpu_s=cpu, peak_mb=peak_mb(), path=path)
        per_sample = seconds / samples
        spent_s += seconds
