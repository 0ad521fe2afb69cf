"""The floor under the time to a first picture: python -m tests.bench.startup [--rounds N].

Whole processes, by turns: Python with nothing imported, with USD's modules, with NumPy, with both; and a first picture of a
scene with next to nothing in it, at 640 x 360 and one sample.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from .peer_runs import PRIMRAY, ROOT
from .results import write_results

CASES = {
    "python": "pass",
    "python with USD": "from pxr import Usd, UsdGeom, UsdLux, UsdShade",
    "python with NumPy": "import numpy",
    "python with USD and NumPy": "import numpy; from pxr import Usd, UsdGeom, UsdLux, UsdShade",
}
STAGE = ROOT / "scenes/features/light-rect/scene.usda"
ROUNDS = 5


def measure(rounds: int) -> list[dict[str, Any]]:
    with tempfile.TemporaryDirectory() as folder:
        commands = {name: [sys.executable, "-c", code] for name, code in CASES.items()}
        size = ["--res", "640", "360", "--spp", "1"]
        commands["primray --version"] = [*PRIMRAY, "--version"]
        commands["a first picture"] = [*PRIMRAY, "render", str(STAGE), *size, "-o", str(Path(folder) / "a.exr")]
        seconds: dict[str, list[float]] = {name: [] for name in commands}
        for _ in range(rounds):
            for name, command in commands.items():
                start = time.perf_counter()
                subprocess.run(command, check=True, capture_output=True)
                seconds[name].append(round(time.perf_counter() - start, 4))
    return [{"name": name, "seconds": found} for name, found in seconds.items()]


def report(rounds: int) -> None:
    rows = measure(rounds)
    for row in rows:
        print(f"{row['name']:28} {statistics.median(row['seconds']):.3f} s", flush=True)
    write_results("startup", rows)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.bench.startup", description=__doc__)
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    report(parser.parse_args().rounds)


if __name__ == "__main__":
    main()
