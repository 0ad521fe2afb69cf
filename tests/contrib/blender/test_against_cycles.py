"""What the add-on renders beside what Cycles does: lamps, worlds, cameras, surfaces, instances and curves.

Each scene of scenes.py is rendered by both. `mean` is how far the mean may be off, `each` the mean difference of pixels, both
relative.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from . import host
from .expected import EXPECTED, expected_in

Rows = dict[str, dict[str, Any]]


@pytest.fixture(scope="module")
def jobs() -> dict[str, Rows]:
    """Rows by job and version, of those that have run: a job renders all of its scenes."""
    return {}


def rows_of(jobs: dict[str, Rows], job: str, folder: Path) -> Rows:
    key = f"{job} in {host.version()}"
    if key not in jobs:
        jobs[key] = {row["name"]: row for row in host.run(job, folder)}
    return jobs[key]


def compare(rows: Rows, name: str) -> tuple[float, float, set[str]]:
    """Return the relative difference of means, that of pixels, and the codes of notes."""
    assert name in rows, f"Blender ended before {name}"
    row = rows[name]
    assert "error" not in row, row["error"]
    ours, theirs = (host.read(row[key])[..., :3].astype(np.float64) for key in ("ours", "theirs"))
    assert np.isfinite(ours).all()
    size = theirs.mean()
    assert size > 0
    return float(ours.mean() / size - 1), float(np.abs(ours - theirs).mean() / size), {note["code"] for note in row["notes"]}


@pytest.mark.parametrize(("job", "name"), [(job, name) for job, names in EXPECTED.items() for name in names])
def test_beside_cycles(
    blender: str, job: str, name: str, jobs: dict[str, Rows], tmp_path_factory: pytest.TempPathFactory
) -> None:
    expected = expected_in(blender, job, name)
    mean, each, codes = compare(rows_of(jobs, job, tmp_path_factory.mktemp(job)), name)
    assert abs(mean - expected.mean) <= expected.tolerance, f"mean off by {mean:+.4f}"
    assert each <= expected.each, f"pixels off by {each:.4f}"
    assert codes == set(expected.notes)
