"""The 95 % intervals of a denoised picture's error hold the true one about 95 % of the time, and the estimates add up to it.

`python -m tests.statistics.errors.test_denoised_coverage` runs the full study and keeps its figures in
tests/bench/results/denoised-coverage.json.
"""

from __future__ import annotations

import json
import sys
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.statistics.errors.calibration import STAGES, Case, case, holds

from primray.denoising import denoiser
from primray.denoising.denoised import Denoising, guides_of

RESULTS = Path(__file__).resolve().parents[2] / "bench" / "results" / "denoised-coverage.json"
REFERENCE_SPP, QUICK_REFERENCE_SPP = 1 << 13, 1 << 11
SAMPLES = (4, 16, 64, 256)
ROUGH = ("sphere",)  # whose few pixels about a bright rim hold all of the relative error

pytestmark = pytest.mark.skipif(not denoiser.has_denoiser(), reason="primray[denoise] is not installed")


def study(of: Case, spp: int, renders: int) -> dict[str, Any]:
    """Coverage and sums for one cell: a scene at a number of samples."""
    denoising = Denoising(guides_of(of.scene, of.settings), of.scene.exposure_scale, of.settings)
    rows = []
    for seed in range(renders):
        sampling = of.render(spp=spp, seed=1000 * spp + seed)
        made = denoising.of(sampling.film)
        assert made.error is not None
        squares = (made.pixels - of.reference) ** 2
        true = float((squares / (of.reference**2 + 0.01)).mean()) - of.reference_relmse
        true_square = max(float(squares.mean()) - of.reference_mse, 0.0)
        held = holds(made.error.relmse, true), holds(made.error.rmse, true_square**0.5)
        rows.append((true, made.error.relmse.value, *held, true_square, made.error.rmse.value**2))
    found = np.array(rows, np.float64)
    true, estimate, held, square_held, true_square, square = found.T
    return {
        "spp": spp,
        "renders": renders,
        "relmse": float(true.mean()),
        "coverage": float(held.mean()),
        "rmse_coverage": float(square_held.mean()),
        "ratio": float(estimate.sum() / true.sum()),
        "mse_ratio": float(square.sum() / true_square.sum()),
        "two_standard_errors": float(2 * np.std(estimate - true) / true.mean() / renders**0.5),
    }


@pytest.mark.parametrize("name", ["texture", "sky"])
def test_a_few_renders(name: str) -> None:
    cell = study(case(name, QUICK_REFERENCE_SPP), 16, 20)
    assert cell["coverage"] >= 0.85, cell
    assert cell["rmse_coverage"] >= 0.85, cell
    assert cell["ratio"] == pytest.approx(1, abs=0.1 + cell["two_standard_errors"]), cell
    assert cell["mse_ratio"] == pytest.approx(1, abs=0.1 + cell["two_standard_errors"]), cell


@pytest.mark.long
def test_many_renders() -> None:
    cells = {name: [study(case(name, REFERENCE_SPP), spp, 40) for spp in SAMPLES] for name in STAGES}
    usual = [cell for name, row in cells.items() if name not in ROUGH for cell in row]
    assert np.mean([cell["coverage"] for cell in usual]) >= 0.88, cells
    assert all(abs(cell["ratio"] - 1) < 0.25 + cell["two_standard_errors"] for cell in usual), cells


def main() -> None:
    cells = {}
    for name in sys.argv[1:] or STAGES:
        cells[name] = [study(case(name, REFERENCE_SPP), spp, 40) for spp in SAMPLES]
        for cell in cells[name]:
            print(name, json.dumps(cell), flush=True)
    every = [(name, cell["coverage"]) for name, row in cells.items() for cell in row]
    found = {
        "date": date.today().isoformat(),
        "command": "python -m tests.statistics.errors.test_denoised_coverage",
        "denoiser": denoiser.denoiser_name(),
        "pooled_coverage": float(np.mean([coverage for _, coverage in every])),
        "without_rough": float(np.mean([coverage for name, coverage in every if name not in ROUGH])),
        "cells": cells,
    }
    RESULTS.write_text(json.dumps(found, indent=2) + "\n")


if __name__ == "__main__":
    main()
