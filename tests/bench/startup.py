"""The floor under the time to a first picture: python -m tests.bench.startup [--rounds N].

Whole processes, by turns: Python with nothing imported, with USD's modules, with NumPy, with both; a first picture of a scene
with next to nothing in it, at 640 x 360 and one sample; and a process that imports what that picture's does, as the command
imports, and nothing else. CPU seconds are of all threads.
"""

from __future__ import annotations

import argparse
import resource
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
# Prints the modules that a command line has imported when it ends.
MODULES = """
import os, sys
sys.stdout, out = sys.stderr, sys.stdout
leave = os._exit
os._exit = lambda code: (print(*[name for name in sys.modules if name != "__main__"], file=out, flush=True), leave(code))
from primray.cli import main
main()
"""
IMPORTS = """
import importlib, os, sys
from primray.cli import _start
_start()
for name in sys.argv[1:]:
    importlib.import_module(name)
os._exit(0)
"""
STAGE = ROOT / "scenes/features/light-rect/scene.usda"
ROUNDS = 5


def measure(rounds: int) -> list[dict[str, Any]]:
    with tempfile.TemporaryDirectory() as folder:
        commands = {name: [sys.executable, "-c", code] for name, code in CASES.items()}
        size = ["--res", "640", "360", "--spp", "1"]
        commands["primray --version"] = [*PRIMRAY, "--version"]
        picture = ["render", str(STAGE), *size, "-o", str(Path(folder) / "a.exr")]
        listed = subprocess.run([sys.executable, "-c", MODULES, *picture], check=True, capture_output=True, text=True)
        commands["what it imports"] = [sys.executable, "-c", IMPORTS, *listed.stdout.split()]
        commands["a first picture"] = [*PRIMRAY, *picture]
        seconds: dict[str, list[float]] = {name: [] for name in commands}
        cpu: dict[str, list[float]] = {name: [] for name in commands}
        for _ in range(rounds):
            for name, command in commands.items():
                start, spent = time.perf_counter(), _cpu_s()
                subprocess.run(command, check=True, capture_output=True)
                seconds[name].append(round(time.perf_counter() - start, 4))
                cpu[name].append(round(_cpu_s() - spent, 4))
    return [{"name": name, "seconds": seconds[name], "cpu_s": cpu[name]} for name in commands]


def _cpu_s() -> float:
    """CPU seconds of the processes that have ended, which other work on the machine leaves as they are, mostly."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def report(rounds: int) -> None:
    rows = measure(rounds)
    for row in rows:
        medians = (statistics.median(row[of]) for of in ("seconds", "cpu_s"))
        print("{:28} {:.3f} s, CPU {:.3f} s".format(row["name"], *medians), flush=True)
    write_results("startup", rows)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.bench.startup", description=__doc__)
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    report(parser.parse_args().rounds)


if __name__ == "__main__":
    main()
