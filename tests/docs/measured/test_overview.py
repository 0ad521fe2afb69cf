"""The chart that the page of benchmarks opens with."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from tests.bench.peers.scenes import SCENES
from tests.bench.results import latest
from tests.docs.measured import benchmark_tables, overview


def test_every_scene_has_a_kind_a_target_and_an_aim() -> None:
    of_kinds = [scene for scenes in overview.KINDS.values() for scene in scenes]
    assert sorted(of_kinds) == sorted(SCENES)
    assert set(benchmark_tables.TARGETS) == set(benchmark_tables.AHEAD) == set(SCENES)


def test_a_lead_is_that_of_the_scene_s_own_table() -> None:
    kept = latest("curve-shelf")
    assert kept is not None
    [lead] = [lead for lead in overview.leads() if lead.scene == "shelf" and lead.date == kept["date"]]
    times = {
        row["renderer"]: found[0]
        for row in benchmark_tables.measured(kept["rows"])
        if (found := benchmark_tables.seconds_to(row, benchmark_tables.TARGETS["shelf"]))
    }
    ours = times.pop("primray")
    assert lead.ratio == pytest.approx(min(times.values()) / ours)
    assert times[lead.peer] == min(times.values())


def test_both_vendors_are_drawn_and_what_is_missing_is_said() -> None:
    intel = next(lead for lead in overview.leads() if lead.vendor == "Intel")
    both = [intel, replace(intel, vendor="AMD", ratio=0.5)]
    chart = overview.drawn(both)
    assert chart.count("<circle") == 2  # one of them in the legend
    assert chart.count('width="9"') == 2
    assert chart.count(f">{intel.scene}<") == 1
    assert f"{intel.scene} (0.50 of" in overview.words(both)
    missing = dict(sentence.split(": ") for sentence in overview.unmeasured(both))
    assert set(missing) == {"on Intel CPUs", "on AMD CPUs"}
    assert intel.scene not in missing["on AMD CPUs"].split(", ")
    assert "pool" in missing["on AMD CPUs"].split(", ")


def test_of_both_leads_the_smaller_one_is_drawn() -> None:
    def row(renderer: str, relmse: float, trimmed: float) -> dict[str, Any]:
        pictures = [{"samples": 16, "seconds": 1.0, "relmse": relmse, "trimmed": trimmed}]
        return {"renderer": renderer, "rounds": [{"pictures": pictures}]}

    ours, rare, plain = row("primray", 0.02, 0.01), row("rare", 200.0, 0.05), row("plain", 0.2, 0.08)
    assert benchmark_tables.trimmed_lead([ours, rare, plain]) == (pytest.approx(5.0), "rare")
    del rare["rounds"][0]["pictures"][0]["trimmed"]
    assert benchmark_tables.trimmed_lead([ours, rare, plain]) is None
