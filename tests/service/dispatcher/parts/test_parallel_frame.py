"""A frame in parts, by scripted workers: all samples once, whatever is lost; how it ends, and who gives way."""

from __future__ import annotations

import asyncio
import random
import time
from pathlib import Path

import pytest
from tests.service.dispatcher.parts.one_render import end_of_one, noisy
from tests.service.dispatcher.parts.pieces import Pieces
from tests.service.dispatcher.play import play
from tests.service.dispatcher.rig import Rig
from tests.service.dispatcher.scripted import ScriptedExecutor, Worker, killed_outside, segfault

from primray.distributed import planner
from primray_service.dispatcher.frames import run_completion
from primray_service.dispatcher.parts import merge_run, part_run
from primray_service.jobs import JobState, PartState

TO_64 = {"stop": {"max_samples": 64}}


def parts_of(executor: ScriptedExecutor) -> list[Worker]:
    return [worker for worker in executor.workers if worker.command.get("part")]


def has_first_samples(rig: Rig, job: str) -> bool:
    """They are merged, or in a part that is done."""
    done = [part for part in rig.store.parts(job, 0) if part.state is PartState.DONE]
    return rig.frame(job).merged > 0 or any(part.first == 0 for part in done)


def merges_of(executor: ScriptedExecutor) -> list[Worker]:
    return [worker for worker in executor.workers if worker.command["do"] == "merge"]


def test_a_frame_is_cut_merged_and_shown_once(tmp_path: Path) -> None:
    pieces = Pieces()

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        job = rig.submit(rig.scene(), settings=TO_64, parallel="auto")
        [ended] = await rig.ended(job.id)
        assert ended.state is JobState.SUCCEEDED, ended.error
        assert ended.result is not None
        assert ended.result["stop"] == {"reason": "samples", "target_met": None}
        assert len(rig.outputs(job.id)) == 3
        frame = rig.frame(job.id)
        assert frame.merged == 64
        assert rig.store.parts(job.id, 0) == []
        assert [path.suffix for path in rig.data.frame(job.id, 0).iterdir()].count(".prc") == 1
        assert frame.cpu_s == 0.5 * len(executor.workers)
        assert ended.effective_settings is None
        assert ended.progress["fraction"] == 1.0

    executor = play(tmp_path, pieces.script, act, slots=3)
    assert pieces.shown == [(0, 64)]
    ends = sorted(pieces.taken)
    assert [first for first, _ in ends] == [0, *(end for _, end in ends[:-1])]
    assert ends[-1][1] == 64
    assert len(ends) > 3
    assert len(merges_of(executor)) <= 3, "a place was idle at the end"
    assert len({worker.command["settings"]["sample_range"][0] for worker in parts_of(executor)}) == len(ends)


@pytest.mark.parametrize("seed", range(6))
def test_whatever_is_lost_is_given_out_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seed: int) -> None:
    """Workers are killed at random, before and after they have saved; every sample is in the picture once."""
    for module in (part_run, run_completion):
        monkeypatch.setattr(module, "FIRST_PAUSE_S", 0.001)
    chance = random.Random(seed)

    async def hook(worker: Worker, where: str) -> None:
        await asyncio.sleep(0.01 * chance.random())
        if chance.random() < 0.3:
            raise killed_outside()

    pieces = Pieces(hook)

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        job = rig.submit(rig.scene(), settings={"stop": {"max_samples": 96}}, parallel=3)
        [ended] = await rig.ended(job.id, timeout_s=60)
        assert ended.state is JobState.SUCCEEDED, ended.error
        assert len(rig.outputs(job.id)) == 3

    play(tmp_path, pieces.script, act, slots=4)
    assert pieces.shown[-1] == (0, 96)


def test_parallel_is_the_most_that_run_at_a_time(tmp_path: Path) -> None:
    pieces = Pieces(pause_s=0.02)
    most = 0

    async def hook(worker: Worker, where: str) -> None:
        nonlocal most
        most = max(most, sum(not other.has_left for other in parts_of(running[0])))

    running: list[ScriptedExecutor] = []
    pieces.hook = hook

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        running.append(executor)
        job = rig.submit(rig.scene(), settings=TO_64, parallel=2)
        await rig.ended(job.id)

    play(tmp_path, pieces.script, act, slots=4)
    assert most == 2
    assert pieces.shown == [(0, 64)]


def test_a_merge_takes_a_place(tmp_path: Path) -> None:
    """By an error there are merges while parts run."""

    async def hook(worker: Worker, where: str) -> None:
        await asyncio.sleep(0.05 if where == "merging" else 0.0)

    pieces = Pieces(hook, pause_s=0.005)

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        job = rig.submit(rig.scene(), settings={"stop": {"target_error": 0.001}}, parallel=2)
        [ended] = await rig.ended(job.id)
        assert ended.state is JobState.SUCCEEDED, ended.error

    executor = play(tmp_path, pieces.script, act, slots=2)
    assert len(merges_of(executor)) > 3
    assert executor.most_running == 2


@pytest.mark.parametrize("watched", [False, True])
def test_where_somebody_looks_there_are_merges_meanwhile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, watched: bool
) -> None:
    monkeypatch.setattr(merge_run, "GUESS_S", 0.01)  # so after 0.1 s if watched, else after 10 s
    monkeypatch.setattr(merge_run, "SHARE", 0.001)
    monkeypatch.setattr(merge_run, "MOST_WAITING", 100)
    monkeypatch.setattr(planner, "LEAST_S", 0.01)
    pieces = Pieces(pause_s=0.15)

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        job = rig.submit(rig.scene(), settings=TO_64, parallel=2)
        if watched:
            await rig.until(lambda: bool(executor.workers))
            rig.dispatcher.ask_preview(job.id, 0)
        [ended] = await rig.ended(job.id)
        assert ended.state is JobState.SUCCEEDED, ended.error

    executor = play(tmp_path, pieces.script, act, slots=2)
    after_the_first_merge = executor.workers[executor.workers.index(merges_of(executor)[0]) :]
    assert any(worker.command.get("part") for worker in after_the_first_merge) == watched
    assert pieces.shown == [(0, 64)]


def test_where_there_is_one_place_a_frame_is_rendered_whole(tmp_path: Path) -> None:
    async def script(worker: Worker) -> None:
        assert not worker.command.get("part")
        worker.sampling()
        worker.done()

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        [ended] = await rig.ended(rig.submit(rig.scene(), settings=TO_64, parallel="auto").id)
        assert ended.state is JobState.SUCCEEDED

    assert len(play(tmp_path, script, act).workers) == 1


def test_by_an_error_it_ends_where_one_render_does(tmp_path: Path) -> None:
    pieces = Pieces(pause_s=0.02)

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        job = rig.submit(rig.scene(), settings={"stop": {"target_error": 0.01}}, parallel="auto")
        [ended] = await rig.ended(job.id)
        assert ended.state is JobState.SUCCEEDED, ended.error
        assert ended.result is not None
        assert ended.result["stop"] == {"reason": "target-error", "target_met": True}
        assert ended.warnings == []

    executor = play(tmp_path, pieces.script, act, slots=3)
    [(first, end)] = pieces.shown
    assert (first, end) == (0, end_of_one(pieces.error_at, 0.01))
    picture = executor.workers[-1].command["settings"]
    assert (picture["spp"], picture["target_error"], picture["adaptive"]) == (end, 0.01, False)


@pytest.mark.parametrize("seed", range(4))
def test_by_an_error_it_ends_there_whatever_is_lost(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seed: int) -> None:
    """Workers are killed at random, before and after they have saved, and the server is stopped in the middle of it."""
    for module in (part_run, run_completion):
        monkeypatch.setattr(module, "FIRST_PAUSE_S", 0.001)
    chance = random.Random(seed)

    async def hook(worker: Worker, where: str) -> None:
        await asyncio.sleep(0.03 * chance.random())
        if chance.random() < 0.2:
            raise killed_outside()

    pieces = Pieces(hook, noisy(seed))
    jobs: list[str] = []

    async def begin(rig: Rig, executor: ScriptedExecutor) -> None:
        jobs.append(rig.submit(rig.scene(), settings={"stop": {"target_error": 0.01}}, parallel=3).id)
        await rig.until(lambda: rig.frame(jobs[0]).merged >= (8, 16, 32, 64)[seed])

    async def go_on(rig: Rig, executor: ScriptedExecutor) -> None:
        [ended] = await rig.ended(jobs[0], timeout_s=120)
        assert ended.state is JobState.SUCCEEDED, ended.error
        assert ended.result is not None
        assert ended.result["stop"] == {"reason": "target-error", "target_met": True}
        assert [path.suffix for path in rig.data.frame(ended.id, 0).iterdir()].count(".prc") == 1

    play(tmp_path, pieces.script, begin, slots=4)
    play(tmp_path, pieces.script, go_on, slots=4)
    assert pieces.shown[-1] == (0, end_of_one(pieces.error_at, 0.01))


def test_a_frame_that_had_met_its_error_when_the_server_stopped_takes_no_more_samples(tmp_path: Path) -> None:
    stopping = True

    async def hook(worker: Worker, where: str) -> None:
        if stopping and where == "picture":
            await worker.hears("yield")
            raise killed_outside()

    pieces = Pieces(hook)
    end = end_of_one(pieces.error_at, 0.01)
    jobs: list[str] = []

    async def begin(rig: Rig, executor: ScriptedExecutor) -> None:
        jobs.append(rig.submit(rig.scene(), settings={"stop": {"target_error": 0.01}}, parallel=2).id)
        await rig.until(lambda: rig.frame(jobs[0]).merged == end)
        await rig.until(lambda: any(not worker.has_left and worker.command["do"] == "render" for worker in executor.workers))

    async def go_on(rig: Rig, executor: ScriptedExecutor) -> None:
        [ended] = await rig.ended(jobs[0])
        assert ended.state is JobState.SUCCEEDED, ended.error
        assert parts_of(executor) == []

    play(tmp_path, pieces.script, begin, slots=2)
    stopping = False
    play(tmp_path, pieces.script, go_on, slots=2)
    assert pieces.shown == [(0, end)]


def test_parts_that_are_done_just_as_they_are_not_wanted_any_more_do_no_harm(tmp_path: Path) -> None:
    """Those across the next goal, and those beyond the end: their workers have left all that they were to leave."""
    pieces = Pieces()
    begun: list[int] = []
    late: list[int] = []

    async def script(worker: Worker) -> None:
        if not worker.command.get("part") or (first := worker.command["settings"]["sample_range"][0]) < 8:
            await pieces.script(worker)
            return
        worker.sampling()
        waited, begun[:] = bool(begun), [first]
        try:
            # The first of them, which is across the next goal, for as long as a busy machine takes to stop it.
            await asyncio.sleep(0.3 if waited else 30)
        except asyncio.CancelledError:
            late.append(first)
        await Pieces().script(worker)

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        [ended] = await rig.ended(rig.submit(rig.scene(), settings={"stop": {"target_error": 0.1}}, parallel=3).id)
        assert ended.state is JobState.SUCCEEDED, ended.error

    play(tmp_path, script, act, slots=3)
    assert late
    assert pieces.shown == [(0, end_of_one(pieces.error_at, 0.1))]


@pytest.mark.parametrize("goal", [8, 17, 1 << 40, None])
def test_a_merge_that_would_be_judged_where_no_render_is_is_not_believed(tmp_path: Path, goal: int | None) -> None:
    pieces = Pieces()

    async def script(worker: Worker) -> None:
        if worker.command["do"] != "merge":
            await pieces.script(worker)
            return
        worker.checkpoint(b"{}")
        end = 8 if len(worker.command["parts"]) == 2 else 4
        found = {"ranges": [[0, end]], "rays": 1, "error": None}
        found["judged"] = {"target_met": False, "goal": goal if end == 8 or goal is None else 8, "expected": None}
        worker.say("done", outputs=[], report={"samples": 1, "parts": found})

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        [ended] = await rig.ended(rig.submit(rig.scene(), settings={"stop": {"target_error": 0.01}}, parallel="auto").id)
        assert ended.state is JobState.FAILED
        assert ended.error is not None
        assert ended.error["type"] == "/problems/render-failed"

    play(tmp_path, script, act, slots=2)


def test_a_time_limit_ends_it_with_what_is_merged(tmp_path: Path) -> None:
    pieces = Pieces(pause_s=0.05)

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        job = rig.submit(rig.scene(), settings={"stop": {"max_seconds": 1.0}}, parallel="auto")
        began = time.monotonic()
        [ended] = await rig.ended(job.id)
        assert time.monotonic() - began < 10
        assert ended.state is JobState.SUCCEEDED, ended.error
        assert ended.result is not None
        assert ended.result["stop"]["reason"] == "time-limit"

    play(tmp_path, pieces.script, act, slots=2)
    assert pieces.shown[-1][0] == 0


def test_canceling_keeps_what_parts_have_taken(tmp_path: Path) -> None:
    async def hook(worker: Worker, where: str) -> None:
        if where == "sampling" and worker.command["settings"]["sample_range"][0] > 16:
            await asyncio.sleep(60)

    pieces = Pieces(hook)

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        job = rig.submit(rig.scene(), settings=TO_64, parallel="auto")
        await rig.until(lambda: has_first_samples(rig, job.id))
        rig.store.request_cancel(job.id, time.time())
        rig.dispatcher.wake()
        [ended] = await rig.ended(job.id)
        assert ended.state is JobState.CANCELED
        assert len(rig.outputs(job.id)) == 3
        assert ended.result is not None
        assert ended.result["stop"]["reason"] == "interrupted"

    play(tmp_path, pieces.script, act, slots=2)
    assert pieces.shown[0][1] < 64


def test_a_part_that_crashes_again_and_again_fails_the_frame(tmp_path: Path) -> None:
    async def hook(worker: Worker, where: str) -> None:
        if where == "sampling" and worker.command["settings"]["sample_range"][0] == 0:
            raise segfault()

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        [ended] = await rig.ended(rig.submit(rig.scene(), settings=TO_64, parallel="auto").id)
        assert ended.state is JobState.FAILED
        assert ended.error is not None
        assert ended.error["type"] == "/problems/renderer-crashed"
        assert rig.outputs(ended.id) == []

    play(tmp_path, Pieces(hook).script, act, slots=2)


def test_a_merge_that_tells_of_other_samples_is_not_believed(tmp_path: Path) -> None:
    pieces = Pieces()

    async def script(worker: Worker) -> None:
        if worker.command["do"] != "merge":
            await pieces.script(worker)
            return
        worker.checkpoint(b"[[0, 1000]]")
        worker.say("done", outputs=[], report={"samples": 1, "parts": {"ranges": [[0, 1000]], "rays": 1, "error": None}})

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        [ended] = await rig.ended(rig.submit(rig.scene(), settings=TO_64, parallel="auto").id)
        assert ended.state is JobState.FAILED
        assert ended.error is not None
        assert ended.error["type"] == "/problems/render-failed"

    play(tmp_path, script, act, slots=2)


def test_what_cannot_be_merged_is_rendered_anew_once(tmp_path: Path) -> None:
    pieces = Pieces()
    refused = 0

    async def script(worker: Worker) -> None:
        nonlocal refused
        if worker.command["do"] == "merge" and refused == 0:
            refused += 1
            worker.fails("checkpoint-unusable")
            return
        await pieces.script(worker)

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        [ended] = await rig.ended(rig.submit(rig.scene(), settings=TO_64, parallel="auto").id)
        assert ended.state is JobState.SUCCEEDED, ended.error

    play(tmp_path, script, act, slots=2)
    assert pieces.shown == [(0, 64)]
    assert len([span for span in pieces.taken if span[0] == 0]) == 2


def test_parts_give_way_to_a_job_that_goes_before(tmp_path: Path) -> None:
    order: list[str] = []

    async def hook(worker: Worker, where: str) -> None:
        while where == "sampling" and not order and "yield" not in worker.told:
            await asyncio.sleep(0.01)

    pieces = Pieces(hook)

    async def script(worker: Worker) -> None:
        if worker.command.get("settings", {}).get("seed") != 7:
            await pieces.script(worker)
            return
        order.append("high")
        worker.sampling()
        worker.done()

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        low = rig.submit(rig.scene(), settings=TO_64, parallel="auto", priority=10)
        await rig.until(lambda: len(parts_of(executor)) == 2)
        high = rig.submit(rig.scene(), settings={**TO_64, "seed": 7}, priority=90)
        for ended in await rig.ended(high.id, low.id):
            assert ended.state is JobState.SUCCEEDED, ended.error
        assert sum("yield" in worker.told for worker in parts_of(executor)) == 1
        assert rig.dispatcher.metrics.restarts["part-yield"] == 1

    play(tmp_path, script, act, slots=2)
    assert order == ["high"]
    assert pieces.shown == [(0, 64)]


def test_a_server_that_stops_goes_on_with_the_parts_that_are_done(tmp_path: Path) -> None:
    stuck = True

    async def hook(worker: Worker, where: str) -> None:
        if stuck and where == "sampling" and worker.command["settings"]["sample_range"][0] > 0:
            await worker.hears("yield")
            raise killed_outside()

    pieces = Pieces(hook)
    jobs: list[str] = []

    async def begin(rig: Rig, executor: ScriptedExecutor) -> None:
        jobs.append(rig.submit(rig.scene(), settings=TO_64, parallel="auto").id)
        await rig.until(lambda: has_first_samples(rig, jobs[0]))

    async def go_on(rig: Rig, executor: ScriptedExecutor) -> None:
        [ended] = await rig.ended(jobs[0])
        assert ended.state is JobState.SUCCEEDED, ended.error

    play(tmp_path, pieces.script, begin, slots=2)
    stuck = False
    play(tmp_path, pieces.script, go_on, slots=2)
    assert pieces.shown == [(0, 64)]
    assert len([span for span in pieces.taken if span[0] == 0]) == 1
