"""Renders that somebody watches: looking early, counting time that was spent, and hearing of checkpoints change no pixel."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from tests.images.checkpoints import resuming

from primray.checkpoints.checkpoint import load
from primray.checkpoints.checkpointing import Saver
from primray.settings import SAMPLE_BLOCK


@pytest.mark.parametrize("values", [{"spp": 50}, {"spp": 2}, {"spp": 400, "target_error": 1e-3}, {"spp": 64, "adaptive": True}])
def test_a_first_look_changes_nothing(values: dict[str, float]) -> None:
    plain = resuming.run(**values)
    looked = resuming.begin(**values)
    looked.schedule = replace(looked.schedule, first_look=True)
    assert looked.run()
    resuming.assert_same(plain, looked)
    assert looked.rows[0].samples == SAMPLE_BLOCK
    decided = [(row.samples, row.error.relmse) for row in looked.rows if row.decides]
    assert decided == [(row.samples, row.error.relmse) for row in plain.rows if row.decides]


def test_a_part_of_a_frame_does_not_measure_at_its_end() -> None:
    """Whoever merges it does; its samples are the same."""
    plain = resuming.run(sample_range=(8, 24))
    part = resuming.begin(sample_range=(8, 24))
    part.schedule = replace(part.schedule, is_part=True)
    assert part.run()
    assert part.rows == ()
    assert part.stop is not None
    assert plain.stop is not None
    assert part.stop.reason == plain.stop.reason == "samples"
    assert part.film.image()[0].tobytes() == plain.film.image()[0].tobytes()


def test_passes_are_told() -> None:
    sampling = resuming.begin(spp=20)
    sampling.schedule = replace(sampling.schedule, first_look=True)
    done: list[int] = []
    sampling.on_pass = lambda: done.append(sampling.done)
    sampling.run()
    assert done == [2, 8, 16, 20]


def test_resumed_after_a_first_look(tmp_path: Path) -> None:
    plain = resuming.run(spp=40)
    looked = resuming.begin(spp=40)
    looked.schedule = replace(looked.schedule, first_look=True)
    looked.run(lambda fraction, samples, rays: looked.done < SAMPLE_BLOCK)
    assert looked.mean_samples() == SAMPLE_BLOCK
    resumed = resuming.go_on(resuming.save(looked, tmp_path / "a.prc"), spp=40)
    resumed.schedule = replace(resumed.schedule, first_look=True)
    assert resumed.run()
    resuming.assert_same(plain, resumed)


@pytest.mark.parametrize(("spent", "goes_on"), [(0.0, True), (99.9, False)])
def test_time_that_was_spent_counts(tmp_path: Path, spent: float, goes_on: bool) -> None:
    path = resuming.save(resuming.run(spp=8), tmp_path / "a.prc")
    sampling = resuming.go_on(path, time_limit_s=0.3)
    sampling.count_as_spent(spent)
    sampling.run()
    assert sampling.stop is not None
    assert sampling.stop.reason == "time-limit"
    assert (sampling.mean_samples() > 8) is goes_on


def test_each_checkpoint_has_its_own_name_and_is_told(tmp_path: Path) -> None:
    told: list[tuple[str, float]] = []
    sampling = resuming.begin(spp=32)
    sampling.schedule = replace(sampling.schedule, first_look=True)
    saver = Saver(
        resuming.about(sampling.settings),
        1e-6,
        lambda: tmp_path / f"{len(told)}.prc",
        lambda file, samples, seconds: told.append((file.name, samples)),
    )
    ends = [2, 8, 16]
    while ends:
        sampling.run(lambda fraction, samples, rays: sampling.done < ends[0])
        del ends[0]
        assert saver.is_due()
        saver.save_meanwhile(sampling)
        saver.wait()
    sampling.run()
    saver.save(sampling)
    assert [name for name, _ in told] == [f"{number}.prc" for number in range(len(told))]
    assert [samples for _, samples in told] == [2, 8, 16, 32]
    assert load(tmp_path / told[-1][0]).ranges == ((0, 32),)
    assert saver.as_json()["written"] == len(told)
