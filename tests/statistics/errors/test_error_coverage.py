"""The 95 % intervals of a picture's error hold the true error about 95 % of the time, and the estimates add up to the truth.

`python -m tests.statistics.errors.test_error_coverage` runs the full study (200 renders a cell) and keeps its figures in
tests/bench/results/error-coverage.json.
"""

from __future__ import annotations

import json
import sys
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.statistics.errors.calibration import ROUGH, STAGES, Case, case, holds

RESULTS = Path(__file__).resolve().parents[2] / "bench" / "results" / "error-coverage.json"
REFERENCE_SPP = 1 << 15
QUICK_REFERENCE_SPP = 1 << 11  # its own error is known and taken away, and is below a hundredth of that of 16 samples
SAMPLES = (16, 64, 256)


def study(of: Case, spp: int, renders: int) -> dict[str, Any]:
    """Coverage and sums for one cell: a scene at a number of samples."""
    truths, estimates, held, rmse_held = [], [], [], []
    for seed in range(renders):
        sampling = of.render(spp=spp, seed=1000 * spp + seed)
        error = sampling.rows[-1].error
        truth = of.true_relmse(sampling)
        truths.append(truth)
        estimates.append(error.relmse.value)
        held.append(holds(error.relmse, truth))
        rmse_held.append(holds(error.rmse, of.true_rmse(sampling)))
    ratio = sum(estimates) / sum(truths)
    return {
        "spp": spp,
        "renders": renders,
        "relmse": float(np.mean(truths)),
        "coverage": float(np.mean(held)),
        "rmse_coverage": float(np.mean(rmse_held)),
        "ratio": ratio,
        "two_standard_errors": float(2 * np.std(truths) / np.mean(truths) / np.sqrt(renders)),
    }


@pytest.mark.parametrize("name", ["texture", "sky", "instancer"])
def test_a_few_renders(name: str) -> None:
    """25 of 30 and more: at 95 % fewer come by chance once in 800 cells."""
    cell = study(case(name, QUICK_REFERENCE_SPP), 16, 30)
    assert cell["coverage"] >= 25 / 30, cell
    assert cell["ratio"] == pytest.approx(1, abs=0.08 + cell["two_standard_errors"]), cell


@pytest.mark.long
def test_many_renders() -> None:
    cells = {name: [study(case(name, REFERENCE_SPP), spp, 100) for spp in SAMPLES] for name in STAGES}
    usual = [cell for name, row in cells.items() if name not in ROUGH for cell in row]
    assert 0.92 <= np.mean([cell["coverage"] for cell in usual]) <= 0.985
    assert min(cell["coverage"] for cell in usual) >= 0.84, cells
    assert min(cell["coverage"] for name in ROUGH for cell in cells[name]) >= 0.8, cells


def main() -> None:
    cells = {}
    for name in sys.argv[1:] or STAGES:
        cells[name] = [study(case(name, REFERENCE_SPP), spp, 200) for spp in (4, *SAMPLES)]
        for cell in cells[name]:
            print(name, json.dumps(cell), flush=True)
    every = [(name, cell["coverage"]) for name, row in cells.items() for cell in row if cell["spp"] in SAMPLES]
    pooled = float(np.mean([coverage for _, coverage in every]))
    usual = float(np.mean([coverage for name, coverage in every if name not in ROUGH]))
    print(f"pooled over {', '.join(map(str, SAMPLES))} samples: {pooled:.3f}, without {' and '.join(ROUGH)} {usual:.3f}")
    command = "python -m tests.statistics.errors.test_error_coverage"
    found = {
        "date": date.today().isoformat(),
        "command": command,
        "pooled_coverage": pooled,
        "without_rough": usual,
        "cells": cells,
    }
    RESULTS.write_text(json.dumps(found, indent=2) + "\n")


if __name__ == "__main__":
    main()
