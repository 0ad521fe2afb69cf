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


def write_results(name: str, rows: list[dict[str, Any]]) -> Path:
    """The raw figures of one run, by benchmark, ISA class and date."""
    RESULTS.mkdir(exist_ok=True)
    today = datetime.date.today().isoformat()
    facts = {
        "date": today,
        "command": " ".join(sys.orig_argv),
        "cpu": cpu_model(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "isa": core.isa(),
        "lanes": core.lanes(),
    }
    path = RESULTS / f"{name}_{core.isa()}_{core.lanes()}_{today}.json"
    path.write_text(json.dumps(facts | {"rows": rows}, indent=1) + "\n")
    return path


def latest(name: str, kernel: str = "v4_16") -> dict[str, Any] | None:
    """What was measured last by that name; None if nothing was."""
    found = sorted(RESULTS.glob(f"{name}_{kernel}_????-??-??.json"))
    return json.loads(found[-1].read_text(encoding="utf-8")) if found else None


def cpu_model() -> str:
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return platform.processor()
