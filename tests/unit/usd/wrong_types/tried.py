"""Runs stages through everything that reads one, in one process for all of a folder."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

Outcomes = dict[str, dict[str, Any]]


def tried(folder: Path, timeout_s: float = 600) -> Outcomes:
    """By the stages' names: the codes of what was said, an error, or a defect. What hangs or dies is named."""
    command = [sys.executable, "-m", "tests.unit.usd.stage.hostile_stages", str(folder)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=timeout_s, cwd=Path(__file__).parents[4])
    except subprocess.TimeoutExpired as hung:
        raise AssertionError(f"hangs on {(hung.stdout or b'').decode().splitlines()[-1]}") from None
    lines = done.stdout.splitlines()
    assert done.returncode == 0, f"dies on {lines[-1:]}\n{done.stderr[-3000:]}"
    assert "Traceback" not in done.stderr, done.stderr[-3000:]
    found = (json.loads(line) for line in lines if not line.startswith("#"))
    return {Path(line["name"]).stem: line for line in found}


def defects(outcomes: Outcomes) -> dict[str, str]:
    return {name: outcome["defect"] for name, outcome in outcomes.items() if "defect" in outcome}
