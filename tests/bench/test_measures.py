"""Errors, ablations and the run as a whole: what the benchmark computes from pictures and sources."""

from __future__ import annotations

import json
import sys
from typing import Any

import numpy as np
import pytest
from tests.bench.cores.ablation_rows import ROWS, Edit, Row
from tests.bench.figures.relmse import agreement, reference_of, relmse, save, saved, trimmed_relmse

from . import __main__ as whole
from .ablations import _worth, edited, with_earlier
from .curves import medians
from .curves import with_earlier as with_earlier_peers
from .features_off import counted_in
from .figures.denoised import ratios, seconds_to

SHAPE = (64, 64, 3)


def noisy(truth, sigma, count, seed):
    rng = np.random.default_rng(seed)
    return [truth + rng.normal(0, sigma, SHAPE) for _ in range(count)]


def test_the_references_own_noise_is_subtracted(tmp_path):
    truth = np.random.default_rng(1).uniform(0.8, 1.5, SHAPE)
    reference = reference_of(noisy(truth, 0.05, 4, 2), 64)
    expected = float((0.05**2 / (truth**2 + 0.01)).mean())
    assert reference.noise == pytest.approx(expected / 4, rel=0.1)
    [picture] = noisy(truth, 0.05, 1, 3)
    assert relmse(picture, reference) == pytest.approx(expected, rel=0.1)
    assert relmse(truth, reference) == pytest.approx(0, abs=0.1 * expected)
    save(reference, tmp_path / "r.npz")
    again = saved(tmp_path / "r.npz")
    assert again.samples == 256
    assert again.noise == pytest.approx(reference.noise, rel=1e-4)


def test_a_trimmed_error_leaves_out_the_worst_pixels() -> None:
    rng = np.random.default_rng(7)
    truth = np.full((50, 40, 3), 2.0)
    reference = reference_of([truth, truth], 64)
    noisy = truth + rng.normal(0, 0.1, truth.shape)
    rare = noisy.copy()
    rare[3, :15] = 1e3
    assert relmse(rare, reference) > 1e3 * relmse(noisy, reference)
    assert trimmed_relmse(rare, reference) == pytest.approx(trimmed_relmse(noisy, reference), rel=0.05)
    assert 0.9 * relmse(noisy, reference) < trimmed_relmse(noisy, reference) < relmse(noisy, reference)


def test_more_pictures_make_a_reference_quieter():
    truth = np.full(SHAPE, 0.5)
    four = reference_of(noisy(truth, 0.1, 4, 2), 64)
    twelve = four.with_more(reference_of(noisy(truth, 0.1, 8, 3), 64))
    assert twelve.samples == 3 * four.samples
    assert twelve.noise == pytest.approx(four.noise / 3, rel=0.1)
    apart = agreement(four, twelve)
    assert abs(apart["mean"]) < 0.005
    assert 0 < apart["blocks"] < 0.02


def test_medians_are_over_the_rounds_of_equal_samples():
    rounds = [
        {"pictures": [{"samples": 4, "seconds": s, "relmse": e}, {"samples": 16, "seconds": 4 * s, "relmse": e / 4}]}
        for s, e in ((1.0, 0.4), (2.0, 0.2), (9.0, 0.3))
    ]
    rounds[2]["pictures"].pop()
    assert medians({"rounds": rounds}) == [(4, 2.0, 0.3), (16, 6.0, pytest.approx(0.075))]


def test_a_run_of_some_rows_keeps_the_others():
    first, second = ROWS[0], ROWS[1]
    now: list[dict[str, object]] = [{"name": first.name, "instead": first.instead, "scene": first.scenes[0], "error": 2.0}]
    others: list[dict[str, object]] = [
        {"name": second.name, "instead": second.instead, "scene": scene} for scene in second.scenes
    ]
    older: list[dict[str, object]] = [now[0] | {"error": 1.0}, *others]
    gone = {"name": second.name, "instead": "what no row says", "scene": second.scenes[0]}
    lacked = {"name": second.name, "instead": second.instead, "left_out": "not built"}
    earlier = {"date": "2026-01-01", "cpu": "this one", "isa": "v4", "rows": [*older, gone, lacked]}
    kept = with_earlier(now, earlier)
    assert kept[0] == now[0]
    assert kept[1:] == [{**row, "date": "2026-01-01", "cpu": "this one", "isa": "v4"} for row in older[1:]]
    assert with_earlier(now, None) == now


def test_worth_is_without_over_with():
    base = [{"relmse": 0.1, "seconds": 1.0}, {"relmse": 0.1, "seconds": 2.0}, {"relmse": 0.2, "seconds": 4.0}]
    without = [{"relmse": 0.3, "seconds": 0.5}, {"relmse": 0.3, "seconds": 1.0}, {"relmse": 0.8, "seconds": 2.0}]
    assert _worth(base, without) == {"error": 3.5, "seconds": 0.5, "error_seconds": 1.75, "range": [1.5, 2.0]}


@pytest.mark.parametrize("row", [row for row in ROWS if row.edits], ids=lambda row: f"{row.name}, {row.instead}")
def test_what_an_ablation_changes_stands_in_the_sources(row):
    """Where the sources have moved on: change the row with them, or take it out."""
    for file, text in edited(row).items():
        assert text != (whole.ROOT / "renderer/core" / file).read_text(encoding="utf-8")


def test_a_change_that_does_not_apply_is_refused():
    with pytest.raises(SystemExit, match=r"sampler\.hpp does not have"):
        edited(Row("x", "y", edits=(Edit("sampler/sampler.hpp", "no such text", ""),)))


def test_a_stopped_run_goes_on_where_it_was(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("PRIMRAY_BENCH", str(tmp_path))
    ran: list[str] = []
    broken = {"b"}

    def step(name: str) -> None:
        if name in broken:
            raise SystemExit("no such peer")
        ran.append(name)

    monkeypatch.setattr(whole, "steps", lambda quick: {name: lambda name=name: step(name) for name in "abc"})
    monkeypatch.setattr(sys, "argv", ["bench"])
    with pytest.raises(SystemExit):
        whole.main()
    assert ran == ["a"]
    assert json.loads((tmp_path / "begun.json").read_text())["done"] == ["a"]
    broken.clear()
    whole.main()
    assert ran == ["a", "b", "c"]
    assert "a: done before" in capsys.readouterr().out
    whole.main()
    assert ran == [*"abcabc"]


CALLGRIND = """\
events: Ir
ob=(1) /usr/lib/libc.so.6
fn=(1) 0x2300
0 1000
ob=(2) /made/_core_v3.so
fn=(1)
0 5
cob=(1)
cfn=(1)
calls=3 0
0 700
+1 8
ob=(1)
fn=(2) free
* 90
ob=(2)
fn=(3) next
-4 100
totals: 1203
"""


def test_instructions_are_the_objects_own():
    """Without what it calls, and though another object has a function of the same name."""
    lines = CALLGRIND.splitlines()
    assert counted_in("_core_v3", lines) == 5 + 8 + 100
    assert counted_in("libc", lines) == 1090
    assert counted_in("", lines) == 1203


def test_a_peer_that_is_not_there_keeps_its_last_curve_of_the_same_scene():
    gone = {"renderer": "b", "left_out": "not installed"}
    now: list[dict[str, Any]] = [{"renderer": "a", "rounds": [2]}, gone, {"renderer": "c", "left_out": "takes minutes"}]
    rows = [{"renderer": name, "digest": "x", "rounds": [1]} for name in "abc"]
    earlier = {"date": "2026-11-01", "cpu": "old", "rows": rows}
    kept = {"renderer": "b", "digest": "x", "rounds": [1], "date": "2026-11-01", "cpu": "old"}
    assert with_earlier_peers(now, earlier, "x") == [now[0], kept, now[2]]
    assert with_earlier_peers(now, earlier, "y") == now
    assert with_earlier_peers(now, None, "x") == now
    assert with_earlier_peers([gone], {"date": "2026-11-02", "cpu": "new", "rows": [kept]}, "x") == [kept]


def test_seconds_to_an_error_lie_between_pictures() -> None:
    curve = [(4, 1.0, 0.04), (16, 4.0, 0.01), (64, 16.0, 0.0025)]
    assert seconds_to(0.02, curve) == pytest.approx(2.0)
    assert seconds_to(0.01, curve) == pytest.approx(4.0)
    assert seconds_to(0.001, curve) is None
    twice = [(n, 2 * s, e) for n, s, e in curve]
    assert ratios(curve, twice) == [(e, pytest.approx(2.0)) for e in (0.04, 0.01, 0.0025)]
