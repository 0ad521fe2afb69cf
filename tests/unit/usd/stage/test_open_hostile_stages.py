"""Stages meant to break what opens them end in a clear error or carry on, in bounded time; one process tries them all."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from .hostile_stages import RATES, write

TIMEOUT_S = 600  # for what hangs; CPU time tells what is slow
Outcomes = dict[str, dict[str, Any]]


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory: pytest.TempPathFactory) -> Outcomes:
    folder = tmp_path_factory.mktemp("hostile")
    write(folder)
    command = [sys.executable, "-m", "tests.unit.usd.stage.hostile_stages", str(folder)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT_S, cwd=Path(__file__).parents[4])
    except subprocess.TimeoutExpired as hung:
        pytest.fail(f"hangs on {(hung.stdout or b'').decode().splitlines()[-1]}")
    assert done.returncode == 0, f"dies on {done.stdout.splitlines()[-1]}\n{done.stderr}"
    assert done.stderr == ""
    lines = [json.loads(line) for line in done.stdout.splitlines() if not line.startswith("#")]
    return {Path(line["name"]).name: line for line in lines}


def test_none_shows_a_defect(outcomes: Outcomes) -> None:
    assert len(outcomes) > 100
    assert [outcome for outcome in outcomes.values() if "defect" in outcome] == []


def test_each_takes_seconds(outcomes: Outcomes) -> None:
    assert {name for name, outcome in outcomes.items() if outcome["seconds"] > 30} == set()


def test_each_error_is_the_scenes_fault_or_a_limit(outcomes: Outcomes) -> None:
    ended = {name: outcome["exit_code"] for name, outcome in outcomes.items() if "error" in outcome}
    assert ended.pop("too many sublayers.usda") == 4
    assert set(ended.values()) == {3}


@pytest.mark.parametrize("rate", set(RATES) - {"-24"})
@pytest.mark.parametrize("how", ["reference to", "reference from", "sublayer of"])
def test_rates_that_hang_usd_are_errors(rate: str, how: str, outcomes: Outcomes) -> None:
    assert outcomes[f"{how} rate {rate}.usda"].get("error") == "time-metadata"


@pytest.mark.parametrize("rate", RATES)
def test_rates_that_nothing_is_mapped_by_are_told(rate: str, outcomes: Outcomes) -> None:
    assert "time-metadata" in outcomes[f"rate {rate}.usda"]["codes"]


@pytest.mark.parametrize(
    ("name", "code"),
    [
        ("axis W", "stage-metadata"),
        ("length 0", "stage-metadata"),
        ("length nan", "stage-metadata"),
        ("sublayer of itself", "composition-error"),
        ("reference to its child", "composition-error"),
        ("payload of itself", "composition-error"),
        ("instance in itself", "composition-error"),
        ("everything is missing", "composition-error"),
        ("all wrong Mesh", "invalid-mesh"),
        ("all wrong PointInstancer", "invalid-instancer"),
        ("all wrong Sphere", "wrong-type"),
        ("wrong Camera", "wrong-type"),
    ],
)
def test_what_is_wrong_is_told(name: str, code: str, outcomes: Outcomes) -> None:
    assert code in outcomes[f"{name}.usda"]["codes"]


@pytest.mark.parametrize(
    "name", ["empty.usda", "garbage.usda", "garbage.usdc", "garbage.usdz", "a folder.usda", "picture.usda"]
)
def test_what_is_no_stage_does_not_open(name: str, outcomes: Outcomes) -> None:
    assert outcomes[name].get("error") == "stage-open"


@pytest.mark.parametrize("name", ["many sublayers", "many references", "deep", "unicode ü 日本 %20 %s", "plain"])
def test_what_is_only_unusual_opens_without_a_word(name: str, outcomes: Outcomes) -> None:
    assert outcomes[f"{name}.usda"]["codes"] == ["camera-automatic", "default-light"]
