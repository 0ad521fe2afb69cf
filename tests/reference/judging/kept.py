"""The referee's pictures for the quick test, where they take longer than the renders: kept, and found again by what made them.

A picture's key is a digest of its case and of the referee's sources; with another key it is made anew. The test says so, and
`PRIMRAY_UPDATE=1 python -m pytest tests/reference` keeps them again.
"""

from __future__ import annotations

import ast
import hashlib
import json
import os
import time
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Usd
from tests.reference.cases.plane_cases import Case
from tests.reference.referee import Referees, expected

PICTURES = Path(__file__).parent / "pictures.json"
REFEREE = Path(__file__).parents[1] / "referee.py"
WORTH_KEEPING_S = 0.3  # of CPU time


def kept_or_made(case: Case, stage: Usd.Stage, resolution: tuple[int, int]) -> Referees:
    kept = pictures().get(case.id)
    if kept is not None and kept["key"] == key_of(case, resolution):
        return Referees(np.array(kept["picture"]), kept["error"])
    began = time.process_time()
    made = expected(stage, case.plane, resolution)
    if os.environ.get("PRIMRAY_UPDATE"):
        _keep(case, resolution, made if time.process_time() - began > WORTH_KEEPING_S else None)
    return made


@cache
def pictures() -> dict[str, dict[str, Any]]:
    found: dict[str, dict[str, Any]] = json.loads(PICTURES.read_text(encoding="utf-8"))
    return found


def key_of(case: Case, resolution: tuple[int, int]) -> str:
    plane = (case.plane.frame.tolist(), case.plane.half_x, case.plane.half_z)
    # Sines of one CPU are not another's to the last bit.
    assets = [(name, a if isinstance(a, str) else np.round(a, 4).tolist()) for name, a in sorted(case.assets.items())]
    return hashlib.sha256(repr((_sources(), case.prims, plane, case.up, assets, resolution)).encode()).hexdigest()[:16]


@cache
def _sources() -> str:
    return hashlib.sha256(b"".join(path.read_bytes() for path in modules())).hexdigest()


def modules() -> list[Path]:
    """referee.py, and what it imports of its folder, and what those do."""
    found, todo = set[Path](), [REFEREE]
    while todo:
        path = todo.pop()
        if path not in found:
            found.add(path)
            todo += _imported(path)
    return sorted(found)


def _imported(path: Path) -> Iterator[Path]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("tests.reference."):
            yield path.with_name(f"{(node.module or '').rpartition('.')[2]}.py")


def _keep(case: Case, resolution: tuple[int, int], made: Referees | None) -> None:
    rows = json.loads(PICTURES.read_text(encoding="utf-8"))
    rows.pop(case.id, None)
    if made is not None:
        rows[case.id] = {"key": key_of(case, resolution), "error": made.error, "picture": made.picture.tolist()}
    lines = [f"{json.dumps(name)}: {json.dumps(row)}" for name, row in sorted(rows.items())]
    PICTURES.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
