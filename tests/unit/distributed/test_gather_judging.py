"""A frame's parts merged a few at a time, from file to file: it ends where one render does, with what that one measured."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.images.checkpoints.resuming import go_on, run, save, sha256

from primray.distributed.gather import Judgement, merge_and_judge
from primray.images.image import pixels_sha256

TARGET = 0.002


def merged_by(folder: Path, rng: np.random.Generator, spp: int | None, target: float) -> tuple[Path, Judgement]:
    """Ranges are cut at the goal that was told last, and anywhere before it."""
    file, done = folder / "sum-0.prc", 0
    judgement = Judgement(None, 8, None)
    while judgement.stop is None:
        cuts = 2 * rng.integers(done // 2, judgement.goal // 2 + 1, 2)
        paths = [file] if done else []
        for a, b in pairwise(sorted({done, *cuts.tolist(), judgement.goal})):
            part = save(run(sample_range=(a, b)), folder / f"{a}-{b}.prc")
            if len(paths) == 2:  # some are merged before there are all: that decides nothing
                file, meanwhile = merge(folder, paths, a, spp, target)
                assert (meanwhile.stop, meanwhile.goal) == (None, judgement.goal)
                paths = [file]
            paths.append(part)
        done = judgement.goal
        file, judgement = merge(folder, paths, done, spp, target)
    return file, judgement


def merge(folder: Path, paths: list[Path], end: int, spp: int | None, target: float) -> tuple[Path, Judgement]:
    merged, judgement = merge_and_judge(paths, spp, target, "relmse")
    assert merged.image.report["sample_ranges"] == [[0, end]]
    file = folder / f"sum-{end}.prc"
    merged.save_checkpoint(file)
    return file, judgement


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("spp", "target"), [(None, TARGET), (20, 1e-9)])
def test_it_ends_where_one_render_does(tmp_path: Path, seed: int, spp: int | None, target: float) -> None:
    asked: dict[str, Any] = {"spp": spp, "target_error": target, "adaptive": False}
    whole = run(**asked)
    assert whole.done & (whole.done - 1), "between two anchors"
    file, judgement = merged_by(tmp_path, np.random.default_rng(seed), spp, target)
    assert whole.stop is not None
    assert judgement.stop is not None
    assert (judgement.goal, judgement.stop.reason) == (whole.done, whole.stop.reason)
    merged, again = merge_and_judge([file], spp, target, "relmse")  # a server that died judges once more
    assert again == judgement
    assert pixels_sha256(merged.image.pixels) == sha256(whole)
    picture = go_on(file, **asked)
    picture.run()
    assert sha256(picture) == sha256(whole)
    assert picture.stop == whole.stop
    assert [row.samples for row in picture.rows] == [row.samples for row in whole.rows]


def test_what_was_due_for_another_target_is_not_for_this(tmp_path: Path) -> None:
    file, first = merged_by(tmp_path, np.random.default_rng(1), None, TARGET)
    _, further = merge_and_judge([file], None, TARGET / 2, "relmse")
    assert further.stop is None
    assert first.goal < further.goal <= run(target_error=TARGET / 2, adaptive=False).done
