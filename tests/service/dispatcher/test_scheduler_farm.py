"""A small farm, by simulated time: many nodes and tenants, frames that die and fail, a dispatcher that dies half way. The large
one: python -m tests.bench.service.simulation."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.bench.service.simulation.fleet import Chances
from tests.bench.service.simulation.simulate import Farm, simulate

from primray_service.store import open_store

SMALL = Farm(nodes=20, tenants=5, frames=240, frames_a_job=12, chances=Chances(lost=0.03, crashed=0.02, impossible=0.06))


def empty(path: Path) -> str:
    url = f"sqlite:///{path / 'primray.sqlite'}"
    store = open_store(url)
    store.migrate()
    store.close()
    return url


def test_nothing_is_lost_nothing_is_there_twice_and_tenants_share_evenly(tmp_path: Path) -> None:
    """Half of the frames are one tenant's; all hold as many nodes, as long as frames of theirs wait."""
    row = simulate(empty(tmp_path), tmp_path / "data", SMALL)
    assert row["wrong"] == []
    assert row["states"]["succeeded"] + row["states"]["failed"] == SMALL.frames
    assert row["states"]["failed"] > 0
    assert row["dispatchers"] == 2
    assert row["ends"]["lost"] > 0
    assert row["ends"]["signal"] > 0
    assert row["most_running"] == SMALL.nodes
    assert row["spread"]
    even = sum(looks for spread, looks in row["spread"].items() if spread <= 2)
    assert even >= 0.9 * sum(row["spread"].values()), row["spread"]
    assert row["restarts"].get("yield", 0) < 0.05 * SMALL.frames


@pytest.mark.parametrize("fault", ["rows", "nodes"])
def test_it_sees_what_is_wrong(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fault: str) -> None:
    from primray_service.store import SqlStore

    if fault == "rows":  # an end that is dropped: its frame runs for ever
        monkeypatch.setattr(SqlStore, "end_frame", lambda self, fence, frame, now, **_: self.job(frame.job_id))
        seen = "frames that run still"
    else:  # the same frame given out twice
        real = SqlStore.claim_frames
        monkeypatch.setattr(SqlStore, "claim_frames", lambda self, *asked: [one for c in real(self, *asked) for one in (c, c)])
        seen = "ran on two nodes at once"
    few = Farm(nodes=4, tenants=2, frames=40, frames_a_job=10)
    row = simulate(empty(tmp_path), tmp_path / "data", few, most_s=4.0, takeovers=0)
    assert any(seen in wrong for wrong in row["wrong"]), row["wrong"]
