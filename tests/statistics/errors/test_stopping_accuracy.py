"""Targets are met closely, predictions come true, and deciding by the samples leaves pictures without a bias that matters.

`python -m tests.statistics.errors.test_stopping_accuracy` runs the full study and keeps its figures in
tests/bench/results/stopping-accuracy.json.
"""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.statistics.errors.calibration import Case, case

from primray.sampling.prediction import run_pilot

RESULTS = Path(__file__).resolve().parents[2] / "bench" / "results" / "stopping-accuracy.json"
REFERENCE_SPP = 1 << 14
RESOLUTION = (128, 96)  # of 64 x 48 pixels the true error itself varies by 8 to 14 % from seed to seed
# relMSE that takes some 30 and some 150 samples.
TARGETS = {
    "texture": (4e-4, 6e-5),
    "sky": (7e-4, 6e-5),
    "lens": (4e-4, 4e-5),
    "clearcoat": (6e-4, 1.3e-4),
    "instancer": (5e-4, 9e-5),
}


def of_targets(of: Case, target: float, renders: int) -> dict[str, Any]:
    """True error over target, and the samples that adaptive and uniform sampling took."""
    ratios, samples, uniform = [], [], []
    for seed in range(renders):
        sampling = of.render(target_error=target, seed=7000 + seed)
        ratios.append(of.true_relmse(sampling) / target)
        samples.append(sampling.mean_samples())
        uniform.append(of.render(target_error=target, seed=7000 + seed, adaptive=False).mean_samples())
    inside = [0.8 <= ratio <= 1.1 for ratio in ratios]
    return {
        "target": target,
        "renders": renders,
        "inside": float(np.mean(inside)),
        "mean": float(np.mean(ratios)),
        "deviation": float(np.std(ratios)),
        "samples": float(np.mean(samples)),
        "uniform_samples": float(np.mean(uniform)),
    }


def of_predictions(of: Case, target: float, renders: int, pilot_s: float = 0.3) -> dict[str, Any]:
    """Predicted over real samples and seconds, by pilots that stop well before the target."""
    samples, seconds = [], []
    for seed in range(renders):
        settings = replace(of.settings, spp=None, target_error=target, seed=9000 + seed)
        pilot = run_pilot(of.scene, settings, pilot_s)
        assert pilot is not None
        found = pilot.predict(target)
        real = of.render(target_error=target, seed=9000 + seed)
        assert found.samples is not None
        assert found.seconds is not None
        samples.append(found.samples.value / real.mean_samples())
        seconds.append(found.seconds.value / real.seconds)
    return {
        "target": target,
        "renders": renders,
        "samples_within_25_percent": float(np.mean([0.75 <= s <= 1.25 for s in samples])),
        "samples_median": float(np.median(samples)),
        "seconds_within_35_percent": float(np.mean([0.65 <= s <= 1.35 for s in seconds])),
        "seconds_median": float(np.median(seconds)),
    }


def bias(of: Case, spp: int, renders: int) -> tuple[float, float]:
    """Of adaptive pictures' mean, relative, with its standard error."""
    truth = of.reference.mean()
    means = [
        of.render(spp=spp, seed=20_000 + s, adaptive=True).film.pixels[..., :3].mean(dtype=np.float64) for s in range(renders)
    ]
    return float(np.mean(means) / truth - 1), float(np.std(means) / truth / np.sqrt(renders))


def test_a_few_targets() -> None:
    cell = of_targets(case("texture", 1 << 13), 6e-5, 8)
    assert cell["inside"] >= 0.6, cell
    assert cell["samples"] < 1.05 * cell["uniform_samples"], cell


def test_adaptive_pictures_have_no_bias() -> None:
    """Within three standard errors and a thousandth."""
    found, error = bias(case("instancer", 1 << 13), 40, 24)
    assert abs(found) < 3 * error + 1e-3


@pytest.mark.long
@pytest.mark.parametrize("name", TARGETS)
def test_many_targets(name: str) -> None:
    for target in TARGETS[name]:
        cell = of_targets(case(name, REFERENCE_SPP, RESOLUTION), target, 30)
        # Where the true error varies more than the range is wide, no rule could stay inside.
        assert cell["inside"] >= (0.85 if cell["deviation"] < 0.08 else 0.5), cell


@pytest.mark.long
@pytest.mark.parametrize("name", TARGETS)
def test_many_predictions(name: str) -> None:
    cell = of_predictions(case(name, REFERENCE_SPP, RESOLUTION), TARGETS[name][1], 30)
    assert cell["samples_within_25_percent"] >= 0.8, cell


@pytest.mark.long
@pytest.mark.parametrize("name", TARGETS)
def test_adaptive_pictures_have_no_bias_in_many(name: str) -> None:
    found, error = bias(case(name, REFERENCE_SPP, RESOLUTION), 48, 100)
    assert abs(found) < 3 * error + 3e-4


def main() -> None:
    rows: dict[str, Any] = {}
    for name in sys.argv[1:] or TARGETS:
        of = case(name, REFERENCE_SPP, RESOLUTION)
        found, error = bias(of, 48, 100)
        rows[name] = {
            "targets": [of_targets(of, target, 30) for target in TARGETS[name]],
            "prediction": of_predictions(of, TARGETS[name][1], 30),
            "bias": {"relative": found, "standard_error": error, "renders": 100, "spp": 48},
        }
        print(name, json.dumps(rows[name]), flush=True)
    command = "python -m tests.statistics.errors.test_stopping_accuracy"
    RESULTS.write_text(json.dumps({"date": date.today().isoformat(), "command": command, "rows": rows}, indent=2) + "\n")


if __name__ == "__main__":
    main()
