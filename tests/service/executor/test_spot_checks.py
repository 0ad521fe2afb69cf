"""A service whose parts come from machines that it does not trust: what a cheating worker sends is not in the picture."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.service.dispatcher.rig import Rig, dispatching

from primray import RenderSettings, render
from primray.checkpoints.checkpoint_file import read_checkpoint, write_checkpoint
from primray.distributed.local_processes import render_part
from primray.images.image import pixels_sha256
from primray.settings import settings_of_json
from primray_service.executor.base import Capacity, Chunk, Handle, OnMessage
from primray_service.executor.local import LocalExecutor
from primray_service.executor.spot_checks import CheckedExecutor
from primray_service.files import DataDirectory
from primray_service.jobs import Job, JobState, Json
from primray_service.limits import Limits

SCENE = Path(__file__).parents[3] / "scenes/features/glass/scene.usda"
SIZE = (64, 48)  # 12 tiles
SAMPLES = 48
ASKED = {"resolution": list(SIZE), "seed": 5, "stop": {"max_samples": SAMPLES}}

Cheat = Callable[[Path, RenderSettings], None]  # changes a part's file


def changed(file: Path, films: dict[str, Any]) -> None:
    header, arrays = read_checkpoint(file)
    file.unlink()
    write_checkpoint(file, {name: value for name, value in header.items() if name != "arrays"}, {**arrays, **films})


def other_film(file: Path, settings: RenderSettings) -> None:
    """Put the film of other settings under a part's header, with all that counts its samples put right."""
    beside = file.with_name("other.prc")
    render_part(str(SCENE), settings, beside)
    films = read_checkpoint(beside)[1]
    changed(file, {name: films[name] for name in films if name != "film.next"})
    beside.unlink()


def wrong_bits(file: Path, settings: RenderSettings) -> None:
    parts = np.array(read_checkpoint(file)[1]["film.parts"])
    parts[0, 20, 30, 1, 0] += 1 << 40
    changed(file, {"film.parts": parts})


def right_looking_noise(file: Path, settings: RenderSettings) -> None:
    other_film(file, replace(settings, seed=99))


def replayed(file: Path, settings: RenderSettings) -> None:
    first, end = settings.sample_range or (0, 0)
    other_film(file, replace(settings, sample_range=(first + 1024, end + 1024)))


class Cheating:
    """A LocalExecutor that changes its first part before it says that it is there."""

    def __init__(self, inner: LocalExecutor, cheat: Cheat) -> None:
        self.inner, self.cheat = inner, cheat
        self.kinds: list[str] = []
        self.cheated = self.saved = 0

    def capacity(self) -> Capacity:
        return self.inner.capacity()

    async def start(self) -> None:
        await self.inner.start()

    def submit(self, chunk: Chunk, on_message: OnMessage) -> Handle:
        self.kinds.append("part" if chunk.command.get("part") else chunk.command["do"])
        handles: list[Handle] = []

        def hear(message: Any) -> None:
            self.saved += message["at"] == "checkpoint"
            if message["at"] == "checkpoint" and not self.cheated:
                self.cheated += 1
                settings = settings_of_json(chunk.command["settings"])
                self.cheat(handles[0].folder / message["file"], replace(settings, threads=1, max_memory_bytes=None))
            on_message(message)

        handles.append(self.inner.submit(chunk, hear))
        return handles[0]

    def health(self) -> Json:
        return self.inner.health()

    async def close(self) -> None:
        await self.inner.close()


class TwoNodes(Cheating):
    """Gives parts to two nodes by turns, of which one cheats after its first part; an excluded one gets none."""

    def __init__(self, inner: LocalExecutor, cheat: Cheat) -> None:
        super().__init__(inner, cheat)
        self.excluded: dict[str, str] = {}
        self.of_bad = 0

    def exclude(self, worker: str, why: str) -> None:
        self.excluded[worker] = why

    def submit(self, chunk: Chunk, on_message: OnMessage) -> Handle:
        self.kinds.append("part")
        worker = "bad" if len(self.kinds) % 2 and "bad" not in self.excluded else "good"
        handles: list[Any] = []

        def hear(message: Any) -> None:
            if message["at"] == "checkpoint" and worker == "bad":
                self.of_bad += 1
                if self.of_bad > 1:
                    settings = settings_of_json(chunk.command["settings"])
                    self.cheat(handles[0].folder / message["file"], replace(settings, threads=1, max_memory_bytes=None))
            on_message(message)

        handles.append(self.inner.submit(chunk, hear))
        handles[0].worker = worker
        return handles[0]  # type: ignore[no-any-return]


def served(
    root: Path,
    cheat: Cheat,
    tiles: int,
    act: Callable[[Rig, CheckedExecutor, Any], Awaitable[None]],
    kind: type[Cheating] = Cheating,
    limits: Limits | None = None,
) -> None:
    made: list[tuple[CheckedExecutor, Cheating]] = []

    def make(data: DataDirectory, limits: Limits) -> CheckedExecutor:
        outside = kind(LocalExecutor(data, limits, slots=2, cores=2), cheat)
        inside = LocalExecutor(data, limits, slots=1, cores=1)
        made.append((CheckedExecutor(outside, inside, data, tiles=tiles), outside))
        return made[0][0]

    async def run() -> None:
        async with dispatching(root, make, limits=limits) as rig:
            await act(rig, *made[0])

    asyncio.run(run())


def pixels(job: Job) -> str:
    assert job.state is JobState.SUCCEEDED, job.error
    assert job.result is not None
    return str(job.result["pixels_sha256"][0]["sha256"])


@pytest.fixture(scope="module")
def plain() -> str:
    return pixels_sha256(render(str(SCENE), RenderSettings(resolution=SIZE, seed=5, adaptive=False, spp=SAMPLES)).pixels)


def honest(file: Path, settings: RenderSettings) -> None:
    pass


@pytest.mark.parametrize("cheat", [honest, wrong_bits, right_looking_noise, replayed])
def test_a_cheating_worker_is_found_and_the_picture_is_that_of_one_render(tmp_path: Path, cheat: Cheat, plain: str) -> None:
    """All tiles are rendered again: one of this scene that is empty has the same bits whatever was sampled."""

    async def act(rig: Rig, checked: CheckedExecutor, outside: Cheating) -> None:
        job = rig.submit(rig.scene(SCENE.read_bytes()), settings=ASKED, parallel="auto")
        [ended] = await rig.ended(job.id, timeout_s=240)
        assert pixels(ended) == plain
        assert outside.cheated == 1
        assert checked.refused == (0 if cheat is honest else 1)
        assert set(outside.kinds) == {"part"}  # merges and the picture are made here
        assert checked.health()["spot_checks"] == {"tiles": checked.tiles, "refused": checked.refused, "excluded": []}
        log = (rig.data.frame(job.id, 0) / "log.txt").read_text()
        assert ("the part is refused: pixels" in log) == (cheat is not honest)

    served(tmp_path, cheat, 12, act)


def test_parts_that_save_under_way_are_checked_when_they_are_done(tmp_path: Path) -> None:
    async def act(rig: Rig, checked: CheckedExecutor, outside: Cheating) -> None:
        asked = {**ASKED, "stop": {"max_samples": 512}}
        job = rig.submit(rig.scene(SCENE.read_bytes()), settings=asked, parallel="auto")
        [ended] = await rig.ended(job.id, timeout_s=240)
        whole = render(str(SCENE), RenderSettings(resolution=SIZE, seed=5, adaptive=False, spp=512))
        assert pixels(ended) == pixels_sha256(whole.pixels)
        assert outside.saved > outside.kinds.count("part")

    served(tmp_path, honest, 1, act, limits=Limits(free_disk_bytes=0, checkpoint_every_s=0.001))


def test_frames_that_are_not_in_parts_are_rendered_here(tmp_path: Path, plain: str) -> None:
    async def act(rig: Rig, checked: CheckedExecutor, outside: Cheating) -> None:
        scene = rig.scene(SCENE.read_bytes())
        jobs = [rig.submit(scene, settings={**ASKED, "adaptive": False}) for _ in range(2)]
        assert {pixels(job) for job in await rig.ended(*(job.id for job in jobs), timeout_s=240)} == {plain}
        assert outside.kinds == []

    served(tmp_path, wrong_bits, 1, act)


def test_a_job_is_canceled_while_its_parts_run(tmp_path: Path) -> None:
    async def act(rig: Rig, checked: CheckedExecutor, outside: Cheating) -> None:
        job = rig.submit(rig.scene(SCENE.read_bytes()), settings={**ASKED, "stop": {"max_samples": 2**20}}, parallel="auto")
        await rig.until(lambda: "part" in outside.kinds, 60)
        rig.store.request_cancel(job.id, time.time())
        rig.dispatcher.wake()
        [ended] = await rig.ended(job.id, timeout_s=120)
        assert ended.state is JobState.CANCELED

    served(tmp_path, honest, 1, act)


def test_a_node_of_two_wrong_parts_is_excluded_and_its_frame_begins_again(tmp_path: Path) -> None:
    """Its first part was right, or its tiles were, and is in the frame: nobody knows which."""

    async def act(rig: Rig, checked: CheckedExecutor, outside: TwoNodes) -> None:
        scene = rig.scene(SCENE.read_bytes())
        logs = ""
        for seed in range(8):
            asked = {**ASKED, "seed": seed}
            job = rig.submit(scene, settings=asked, parallel="auto")
            [ended] = await rig.ended(job.id, timeout_s=240)
            whole = render(str(SCENE), RenderSettings(resolution=SIZE, seed=seed, adaptive=False, spp=SAMPLES))
            assert pixels(ended) == pixels_sha256(whole.pixels)
            logs += (rig.data.frame(job.id, 0) / "log.txt").read_text()
            if outside.excluded:
                break
        assert list(outside.excluded) == ["bad"]
        assert outside.excluded["bad"].startswith("2 of its parts")
        assert checked.refused == 2
        assert checked.health()["spot_checks"]["excluded"] == ["bad"]
        assert logs.count("the part is refused: pixels") == 2

    served(tmp_path, wrong_bits, 12, act, TwoNodes)


def test_frames_with_parts_of_an_excluded_node_begin_again_once(tmp_path: Path) -> None:
    data = DataDirectory(tmp_path)
    local = LocalExecutor(data, Limits(), slots=1, cores=1)
    checked = CheckedExecutor(TwoNodes(local, honest), local, data, tiles=1)
    checked.accepts("bad", "job-1")
    checked.accepts("good", "job-2")
    checked.refuses("bad", "its pixels differ")
    assert not checked.is_excluded("bad")  # a bit may flip once
    assert not checked.withdraws("job-1")
    checked.refuses("bad", "its pixels differ")
    assert checked.is_excluded("bad")
    assert [checked.withdraws(job) for job in ("job-2", "job-1", "job-1")] == [False, True, False]
    for _ in range(3):
        checked.refuses("", "nobody knows whose part it was")
    assert list(checked.excluded) == ["bad"]
