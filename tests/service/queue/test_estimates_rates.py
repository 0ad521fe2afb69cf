"""What frames took lately, by their work."""

from __future__ import annotations

from dataclasses import replace

import pytest

from primray_service.jobs import Job, JobState
from primray_service.queue import estimates
from primray_service.queue.estimates import Rates, key_of, work_of

JOB = Job("job_1", "studio", JobState.QUEUED, "sha256:a", None, {"resolution": [32, 32], "seed": 1}, 0.0, 0.0, 1.0, 1.0)


def test_what_is_the_same_work() -> None:
    assert work_of(JOB) == work_of(replace(JOB, id="job_2", settings={"seed": 7, "frames": "1-9", "resolution": [32, 32]}))
    assert work_of(JOB) != work_of(replace(JOB, scene_id="sha256:b"))
    assert work_of(JOB) != work_of(replace(JOB, settings={"resolution": [64, 32]}))


def test_the_newest_counts_most(monkeypatch: pytest.MonkeyPatch) -> None:
    known = Rates()
    assert known.of(work_of(JOB)) is None
    known.note(JOB, 8.0)
    known.note(JOB, 4.0)
    assert known.of(work_of(JOB)) == 6.0
    monkeypatch.setattr(estimates, "MOST_RATES", 1)
    known.note(replace(JOB, scene_id="sha256:b"), 1.0)
    assert known.of(work_of(JOB)) is None


def test_the_store_is_told_what_is_news_and_read_again_after_a_moment(monkeypatch: pytest.MonkeyPatch) -> None:
    stored: dict[str, float] = {}
    known, other = Rates(), Rates(lambda: stored)
    assert known.note(JOB, 8.0) == (key_of(work_of(JOB)), 8.0)
    assert known.note(JOB, 8.2) is None
    told = known.note(JOB, 4.0)
    assert told is not None
    other.refresh()
    stored.update([told])
    other.refresh()
    assert other.of(work_of(JOB)) is None
    monkeypatch.setattr(estimates, "RATES_GOOD_FOR_S", 0.0)
    other = Rates(lambda: stored)
    other.refresh()
    assert other.of(work_of(JOB)) == told[1]
