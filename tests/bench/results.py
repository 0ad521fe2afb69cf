"""Where raw figures are kept, and the facts of the machine that go with them."""

from __future__ import annotations

import datetime
import json
import os
import platform
import sys
from pathlib import Path
from typing import Any

from primray import core

RESULTS = Path(__file__).parent / "results"


def write_results(name: str, rows: list[dict[str, Any]], measured: str | None = None) -> Path:
    """The raw figures of one run, by benchmark, ISA class (this process' unless another was `measured`) and date."""
    RESULTS.mkdir(exist_ok=True)
    isa, lanes = (measured, core.DEFAULT_LANES[measured]) if measured else (core.isa(), core.lanes())
    today = datetime.date.today().isoformat()
    facts = {
        "date": today,
        "command": " ".join(["python", *sys.orig_argv[1:]]),
        "cpu": cpu_model(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "isa": isa,
        "lanes": lanes,
    }
    path = RESULTS / f"{name}_{isa}_{lanes}_{today}.json"
    path.write_text(json.dumps(facts | {"rows": rows}, indent=1) + "\n")
    return path


def latest(name: str, lanes: int | None = None, cpu: str = "") -> dict[str, Any] | None:
    """What was measured last by that name, with so many lanes and on a CPU of such a name if given; None if nothing was."""
    found = RESULTS.glob(f"{name}_v?_{lanes or '*'}_????-??-??.json")
    newest_first = sorted(found, key=lambda path: path.stem.rsplit("_", 1)[1], reverse=True)
    kept = (json.loads(path.read_text(encoding="utf-8")) for path in newest_first)
    return next((each for each in kept if cpu in each["cpu"]), None)


def cpu_model() -> str:
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return platform.processor()
