"""Renders that are stopped, continued and extended have the bits of those that ran through; other checkpoints are told."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import primray
from primray import core
from primray.checkpoints.checkpoint import load
from primray.checkpoints.checkpoint_file import read_checkpoint, write_checkpoint
from primray.checkpoints.checkpointing import Checkpointing
from primray.errors import CheckpointError, SettingsError
from primray.sampling.schedule import FIRST_ANCHOR
from primray.settings import Metric, RenderSettings

from .resuming import LONG, STAGE, Cutter, assert_same, begin, cutter, go_on, reached, run, save, scene, settings, sha256

__all__ = ["cutter"]  # a fixture


@pytest.fixture(scope="module")
def first_error() -> float:
    """relMSE at 16 samples: what targets are set by."""
    return run(spp=16).rows[-1].error.relmse.value


@pytest.mark.parametrize("adaptive", [False, True])
def test_threads_show_in_no_bit(adaptive: bool, first_error: float) -> None:
    renders = [run(spp=48, target_error=first_error / 50, adaptive=adaptive, threads=threads) for threads in (1, 2, 16)]
    for other in renders[1:]:
        assert_same(renders[0], other)
    low, high = renders[0].film.samples_per_pixel
    assert (low < high) == adaptive


def test_pauses_show_in_no_bit() -> None:
    paused = begin(spp=LONG)
    for _ in range(4):
        assert not paused.run(pause=lambda: True)
    samples = reached(paused.film.next)
    paused.schedule = replace(paused.schedule, settings=settings(spp=samples))
    paused.aim()
    while not paused.run(pause=lambda: True):
        pass
    assert_same(run(spp=samples), paused)


def test_lanes_may_change_on_the_way(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    save(run(spp=18), tmp_path / "a.prc")
    monkeypatch.setattr(core, "lanes", lambda: 4)
    going_on = go_on(tmp_path / "a.prc", spp=40)
    going_on.run()
    monkeypatch.undo()
    assert_same(run(spp=40), going_on)


@pytest.mark.parametrize(
    "how", [{"spp": 75}, {"target": 9.0}, {"target": 9.0, "adaptive": False}, {"spp": 64, "adaptive": True}]
)
def test_cut_anywhere_and_resumed(how: dict[str, Any], tmp_path: Path, first_error: float, cutter: Cutter) -> None:
    values = {**how}
    if "target" in values:
        values["target_error"] = first_error / values.pop("target")
    sampling, path = begin(**values), tmp_path / "a.prc"
    for _ in range(100):
        sampling.run()
        assert sampling.stop is not None
        if sampling.stop.reason != "interrupted":
            break
        sampling = go_on(save(sampling, path), threads=1, **{k: v for k, v in values.items() if k != "adaptive"})
    cuts, cutter.share = cutter.cuts, 0.0
    assert cuts >= 3
    whole = run(**values)
    assert_same(whole, sampling)
    assert whole.stop == sampling.stop
    assert [r.samples for r in whole.rows if r.decides] == [r.samples for r in sampling.rows if r.decides]
    assert len(sampling.rows) > len(whole.rows)  # the curve keeps what was measured when it was cut
    seconds = [row.seconds for row in sampling.rows]
    assert seconds == sorted(seconds)


@pytest.mark.parametrize("adaptive", [False, True])
@pytest.mark.parametrize("factors", [(2.5, 4.0), (3.0, 20.0), (7.0, 11.0)])
def test_extended_to_a_lower_error(adaptive: bool, factors: tuple[float, float], tmp_path: Path, first_error: float) -> None:
    loose, tight = (first_error / factor for factor in factors)
    extended = run(target_error=loose, adaptive=adaptive)
    assert extended.stop is not None
    assert extended.stop.reason == "target-error"
    before = extended.film.samples
    extended = go_on(save(extended, tmp_path / "a.prc"), target_error=tight)
    extended.run()
    direct = run(target_error=tight, adaptive=adaptive)
    assert extended.film.samples > before
    assert_same(direct, extended)
    assert direct.stop == extended.stop


@pytest.mark.parametrize("cap", [5, 16, 24, 37])
def test_a_cap_leaves_no_trace(cap: int, tmp_path: Path, first_error: float) -> None:
    capped = run(spp=cap, target_error=first_error / 4)
    assert capped.stop is not None
    assert (capped.stop.reason, capped.stop.target_met) == ("samples", False)
    going_on = go_on(save(capped, tmp_path / "a.prc"), target_error=first_error / 4)
    going_on.run()
    assert_same(run(target_error=first_error / 4), going_on)


@pytest.mark.parametrize("cut", [False, True])
def test_a_quick_look_leaves_no_trace(cut: bool, tmp_path: Path, cutter: Cutter) -> None:
    """Up to three samples are not split; with more it begins anew, wherever the few were left."""
    cutter.share = float(cut)
    look = run(spp=3)
    assert (look.stop is not None and look.stop.reason == "interrupted") == cut
    assert look.splits == core.Splits()
    cutter.share, path = 0.0, save(look, tmp_path / "a.prc")
    for samples in (3, 24):
        longer = go_on(path, spp=samples)
        longer.run()
        direct = run(spp=samples)
        assert_same(direct, longer)
    assert direct.splits.paths > 1


@pytest.mark.parametrize("few", [1, 2])
def test_a_quick_look_begins_anew_for_another(few: int, tmp_path: Path) -> None:
    """Of 3 samples, which share their sequences otherwise; 2 go on from 1."""
    path = save(run(spp=few), tmp_path / "a.prc")
    for samples in (2, 3):
        longer = go_on(path, spp=samples)
        longer.run()
        assert_same(run(spp=samples), longer)


def test_a_long_render_that_was_cut_soon_is_none_of_a_quick_look(tmp_path: Path, cutter: Cutter) -> None:
    cutter.share = 1.0
    path = save(run(spp=24), tmp_path / "a.prc")
    cutter.share = 0.0
    look = go_on(path, spp=2)
    look.run()
    assert_same(run(spp=2), look)


@pytest.mark.parametrize("factor", [1.3, 1.7, 2.1])
def test_no_cap_decides(factor: float, tmp_path: Path, first_error: float) -> None:
    """Caps before, at and after where a render without them looks at the error; some end below the target by chance."""
    rules: dict[str, Any] = {"target_error": first_error / factor, "adaptive": False}
    direct = run(**rules)
    assert 16 < direct.done < 48
    for cap in range(17, direct.done + 2):
        going_on = go_on(save(run(spp=cap, **rules), tmp_path / "a.prc"), **rules)
        going_on.run()
        assert (going_on.done, going_on.stop) == (direct.done, direct.stop), cap
        assert_same(direct, going_on)


@pytest.mark.parametrize("factor", [1.3, 1.5, 1.7])
def test_a_target_for_what_had_none(factor: float, tmp_path: Path, first_error: float) -> None:
    """Up to where it looks at the error for the first time beyond an anchor: there too, though that is measured already."""
    rules: dict[str, Any] = {"target_error": first_error / factor, "adaptive": False}
    direct = run(**rules)
    first = round(next(row.samples for row in direct.rows if row.due))
    for samples in (14, 17, first - 2, first):
        going_on = go_on(save(run(spp=samples, adaptive=False), tmp_path / "a.prc"), **rules)
        going_on.run()
        assert going_on.stop == direct.stop
        assert_same(direct, going_on)


@pytest.mark.parametrize("metric", Metric)
def test_a_target_that_is_missed_is_told_in_any_metric(metric: Metric) -> None:
    for samples in (1, 16, 20):
        stop = run(spp=samples, target_error=1e-6, error_metric=metric).stop
        assert stop is not None
        assert (stop.reason, stop.target_met) == ("samples", False)


def test_the_metric_may_change(tmp_path: Path) -> None:
    shown = run(spp=64, adaptive=False).rows[-1].error.of(Metric.DISPLAY).value
    path = save(run(spp=40, adaptive=False), tmp_path / "a.prc")
    rules: dict[str, Any] = {"target_error": shown, "error_metric": Metric.DISPLAY, "adaptive": False}
    going_on = go_on(path, **rules)
    going_on.run()
    assert_same(run(**rules), going_on)


def test_a_smaller_cap_takes_no_more(tmp_path: Path) -> None:
    path = save(run(spp=32), tmp_path / "a.prc")
    going_on = go_on(path, spp=8)
    going_on.run()
    assert_same(run(spp=32), going_on)
    assert going_on.stop is not None
    assert going_on.stop.reason == "samples"


def test_a_time_limit_is_continued(tmp_path: Path) -> None:
    path = tmp_path / "a.prc"
    stopped = run(spp=LONG, time_limit_s=0.08)
    going_on = go_on(save(stopped, path), spp=LONG, time_limit_s=0.05)
    going_on.run()
    for sampling in (stopped, going_on):
        assert sampling.stop is not None
        assert sampling.stop.reason == "time-limit"
    assert going_on.film.samples > stopped.film.samples  # the limit is of this run, not of all together
    assert going_on.seconds > stopped.seconds
    samples = reached(going_on.film.next)
    last = go_on(save(going_on, path), spp=samples)
    last.run()
    assert_same(run(spp=samples), last)


@pytest.mark.parametrize("adaptive", [False, True])
def test_a_target_in_many_short_runs(adaptive: bool, tmp_path: Path, first_error: float) -> None:
    """As in a queue that gives each job a few moments."""
    path, target = tmp_path / "a.prc", first_error / 25
    sampling, runs = begin(target_error=target, adaptive=adaptive, time_limit_s=0.01), 1
    while sampling.run() and sampling.stop is not None and sampling.stop.reason == "time-limit":
        sampling = go_on(save(sampling, path), target_error=target, time_limit_s=0.01 * (1 + runs))
        runs += 1
        assert runs < 100
    direct = run(target_error=target, adaptive=adaptive)
    assert runs > 1
    assert_same(direct, sampling)
    assert direct.stop == sampling.stop


def test_a_time_limit_does_not_decide_before_the_first_anchor(first_error: float) -> None:
    """A target that is met by chance at 2 samples would stop only those renders that have a time limit."""
    free, limited = (run(target_error=first_error * 4, time_limit_s=limit) for limit in (None, 60.0))
    assert_same(free, limited)
    assert free.done == FIRST_ANCHOR


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"seed": 3}, "seed is 0 in the checkpoint and 3 here"),
        ({"max_depth": 2}, "max depth is none in the checkpoint and 2 here"),
        ({"filter_width": 2.0}, "filter width is 1.0 in the checkpoint and 2.0 here"),
        ({"filter": primray.Filter.GAUSSIAN}, "filter is box in the checkpoint and gaussian here"),
        ({"resolution": (38, 23)}, "resolution is 37 x 23 in the checkpoint and 38 x 23 here"),
        ({"dicing_rate": 1.0}, "dicing rate is 4.0 in the checkpoint and 1.0 here"),
        ({"seed": 3, "max_depth": 2}, "max depth is none in the checkpoint and 2 here; seed is 0 in the checkpoint and 3 here"),
        ({"adaptive": True}, "its sampling is uniform, not adaptive"),
        ({"sample_range": (8, 32)}, "its samples begin at 0, not at 8"),
        ({"sample_range": (0, 8)}, "it has samples up to 16, beyond the end of the range at 8"),
    ],
)
def test_what_differs_is_named(changes: dict[str, Any], says: str, tmp_path: Path) -> None:
    path = save(run(spp=16), tmp_path / "a.prc")
    with pytest.raises(CheckpointError, match=says.replace("(", r"\(")) as caught:
        go_on(path, **changes)
    assert (caught.value.code, caught.value.where) == ("checkpoint-other", str(path))


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"isa": "v1"}, f"isa is v1 in the checkpoint and {core.isa()} here"),
        ({"core": "0"}, "core is 0 in the checkpoint"),
        ({"embree": "4.3.3"}, "embree is 4.3.3 in the checkpoint and 4.4.0 here"),
        ({"scene.lights": "0"}, "the scene's lights have changed"),
        ({"scene.camera": "0"}, "the scene's camera has changed"),
        ({"scene.lights": "0", "scene.camera": "0"}, "the scene's lights and camera have changed"),
        ({"more": 1}, "more is 1 in the checkpoint and none here"),
    ],
)
def test_other_machines_and_scenes_are_named(changes: dict[str, Any], says: str, tmp_path: Path) -> None:
    path = save(run(spp=2), tmp_path / "a.prc", **changes)
    with pytest.raises(CheckpointError, match=says):
        go_on(path, spp=4)


def test_an_adaptive_render_stays_one(tmp_path: Path, first_error: float) -> None:
    path = save(run(target_error=first_error / 4), tmp_path / "a.prc")
    with pytest.raises(CheckpointError, match="its sampling is adaptive, not uniform"):
        go_on(path, spp=100, adaptive=False)
    with pytest.raises(CheckpointError, match="its sampling is adaptive, not uniform"):
        go_on(path, sample_range=(0, 512))
    assert go_on(path, spp=100).settings.adapts


def test_rows_of_another_target_decide_nothing(tmp_path: Path, first_error: float) -> None:
    path = save(run(target_error=first_error / 3, adaptive=False), tmp_path / "a.prc")
    assert any(row.due for row in load(path).rows)
    assert not any(row.due for row in go_on(path, target_error=first_error / 8).rows)
    assert not any(row.due for row in go_on(path, target_error=first_error / 3, error_metric=Metric.RMSE).rows)
    assert any(row.due for row in go_on(path, target_error=first_error / 3).rows)


NUMBERS: list[Any] = [None, -1, 0.5, "x", 10**30, [], {}, True]


@pytest.mark.parametrize("value", NUMBERS, ids=str)
def test_headers_that_make_no_sense(tmp_path: Path, value: Any) -> None:
    """One after the other is something else; what the digests say is right."""
    path = save(run(spp=16, adaptive=True), tmp_path / "a.prc")
    header, arrays = read_checkpoint(path)
    del header["arrays"]
    others = [{**header, name: value} for name in header]
    others += [{**header, "rows": [{**header["rows"][0], name: value}]} for name in header["rows"][0]]
    estimates = header["rows"][0]["error"]
    others += [{**header, "rows": [{**header["rows"][0], "error": {**estimates, "relmse": value}}]}]
    refused = 0
    for other in others:
        write_checkpoint(path, other, arrays)
        try:
            going_on = go_on(path, target_error=1e-3, spp=24)
        except (CheckpointError, SettingsError):
            refused += 1
        else:
            going_on.run()
    assert refused > 8
    for name in header:
        write_checkpoint(path, {key: header[key] for key in header if key != name}, arrays)
        with pytest.raises(CheckpointError, match="is not valid"):
            load(path)


def test_films_that_make_no_sense(tmp_path: Path) -> None:
    path = save(run(spp=4), tmp_path / "a.prc")
    header, arrays = read_checkpoint(path)
    for name, array in arrays.items():
        for other in (array[:-1], array[None], array.astype("<f8") if array.dtype.str != "<f8" else array.astype("<i8")):
            write_checkpoint(path, header, {**arrays, name: other})
            with pytest.raises(CheckpointError, match="is not valid"):
                load(path)
        write_checkpoint(path, header, {key: arrays[key] for key in arrays if key != name})
        with pytest.raises(CheckpointError, match="is not valid"):
            load(path)
    for name, value in (("film.bins", 90), ("film.bins", -90), ("film.next", 2**32 - 1)):
        write_checkpoint(path, header, {**arrays, name: np.full_like(arrays[name], value)})
        with pytest.raises(CheckpointError, match="is not valid"):
            load(path)
    pixels = {"x": 0, "y": 0, "width": 65536, "height": 65536}
    huge = {**header, "frame": {**header["frame"], "pixels": pixels}}
    write_checkpoint(path, huge, arrays)
    with pytest.raises(CheckpointError, match="is not valid"):
        load(path)


def test_an_image_says_nothing_of_its_checkpoints(tmp_path: Path) -> None:
    small = RenderSettings(resolution=(24, 16), spp=4)
    saved = primray.render(STAGE, small, checkpointing=Checkpointing(tmp_path / "a.prc"))
    assert saved.metadata == primray.render(STAGE, small).metadata
    assert settings().resolution == scene().resolution
    assert len(sha256(run(spp=2))) == 64
