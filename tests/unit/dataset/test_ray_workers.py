"""What workers on a cluster refuse, and what becomes of samples whose workers are lost."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from primray.dataset import ray_workers
from primray.dataset.ray_workers import LOST, RayWorker, RayWorkers
from primray.errors import PrimrayError, SettingsError


class Lost(Exception):
    pass


class Kept:
    """Workers in place of actors: some of their answers are lost."""

    def __init__(self, lost: dict[int, int]) -> None:
        self._lost = lost
        self.made: list[int] = []
        self.make = SimpleNamespace(remote=lambda index: (self, index))

    def get(self, index: int) -> dict[str, Any]:
        if self._lost.get(index, 0) > 0:
            self._lost[index] -= 1
            raise Lost("its node is gone")
        self.made.append(index)
        return {"index": index}


def run(samples: list[int], lost: dict[int, int], count: int = 2) -> tuple[list[int], int]:
    """Return the samples that were made, and the number of workers."""
    workers: list[Kept] = []

    def new() -> Kept:
        workers.append(Kept(lost))
        return workers[-1]

    ray = SimpleNamespace(
        wait=lambda refs: (refs[:1], refs[1:]),
        get=lambda ref: ref[0].get(ref[1]),
        kill=lambda worker: None,
        exceptions=SimpleNamespace(RayError=Lost),
    )
    done: list[int] = []
    ray_workers._run(ray, new, count, samples, lambda answer: done.append(answer["index"]))  # type: ignore[arg-type]
    return done, len(workers)


def test_each_sample_is_made_once_by_workers_that_stay() -> None:
    done, workers = run(list(range(9)), {})
    assert sorted(done) == list(range(9))
    assert workers == 2


def test_the_sample_of_a_lost_worker_is_made_by_another() -> None:
    done, workers = run(list(range(5)), {0: 1, 3: LOST - 1})
    assert sorted(done) == list(range(5))
    assert workers == 2 + 1 + LOST - 1


def test_a_sample_that_loses_every_worker_is_named() -> None:
    with pytest.raises(PrimrayError, match=f"lost {LOST} times: its node is gone") as caught:
        run(list(range(3)), {1: LOST})
    assert caught.value.code == "dataset-worker"
    assert caught.value.where == "sample 1"


def test_a_node_with_another_primray_renders_nothing() -> None:
    answer = RayWorker({}, ["9.9", "v1"]).make(3)
    exit_code, code, message, _ = answer["error"]
    assert (exit_code, code) == (SettingsError.exit_code, "dataset-node")
    assert "and the caller 9.9 with core v1" in message


@pytest.mark.parametrize("wrong", [{"workers": 0}, {"cores": -1}])
def test_less_than_one_worker_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(SettingsError, match="must be 1 or more"):
        RayWorkers(**wrong)
