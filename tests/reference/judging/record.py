"""What the long test found, kept in tests/reference/judging/results.json when asked for: PRIMRAY_UPDATE=1."""

from __future__ import annotations

import fcntl
import json
import os
import platform
from datetime import date
from pathlib import Path

from tests.reference.cases.plane_cases import Case
from tests.reference.cases.table import cases
from tests.reference.judging.judge import P_VALUE, Verdict

RESULTS = Path(__file__).parent / "results.json"
COMMAND = "PRIMRAY_UPDATE=1 python -m pytest -m long tests/reference"


def record(case: Case, found: Verdict, spp: int, seeds: int) -> None:
    if not os.environ.get("PRIMRAY_UPDATE"):
        return
    with RESULTS.with_suffix(".lock").open("w") as lock:  # parts of the table may be measured at once
        fcntl.flock(lock, fcntl.LOCK_EX)
        _keep(case, found, spp, seeds)


def _keep(case: Case, found: Verdict, spp: int, seeds: int) -> None:
    kept = json.loads(RESULTS.read_text(encoding="utf-8")) if RESULTS.exists() else {}
    about = {
        "command": COMMAND,
        "date": date.today().isoformat(),
        "machine": f"{platform.machine()}, {platform.system()}, {os.cpu_count()} threads",
        "core": _core(),
        "p_value": P_VALUE,
        "seeds": seeds,
    }
    row = {
        "group": case.group,
        "case": case.name,
        "pixels": found.pixels,
        "spp": spp * seeds,
        "mean_error": float(f"{found.mean_error:.3e}"),
        "mean_stderr": float(f"{found.mean_stderr:.2e}"),
        "chi_square": round(found.chi_square, 3),
        "largest_z": round(found.largest_z, 2),
        "referee_error": float(f"{found.referee_error:.1e}"),
        "lit": found.lit,
        "faults": found.faults(),
    }
    rows = {**kept.get("cases", {}), case.id: row}
    rows = {c.id: rows[c.id] for c in cases() if c.id in rows}
    RESULTS.write_text(json.dumps({"about": about, "cases": rows}, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def _core() -> dict[str, object]:
    from primray import core

    return {"isa": core.isa(), "lanes": core.lanes()}
