"""A worker that was taken over by what somebody uploaded: whatever it says or leaves, its own frame fails and nothing else."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from tests.service.dispatcher.play import play
from tests.service.dispatcher.rig import Rig
from tests.service.dispatcher.scripted import ScriptedExecutor, Worker

from primray_service.dispatcher.chunks import messages
from primray_service.dispatcher.chunks.messages import NotBelieved
from primray_service.jobs import JobState


def links_checkpoint(worker: Worker) -> None:
    worker.write("d.prc", b"x")
    (worker.out / "c.prc").symlink_to(worker.out / "d.prc")
    worker.say("checkpoint", number=1, file="c.prc")


def hard_links_checkpoint(worker: Worker) -> None:
    worker.write("c.prc", b"x")
    os.link(worker.out / "c.prc", worker.out / "d.prc")
    worker.say("checkpoint", number=1, file="c.prc")


def names_file_outside(worker: Worker) -> None:
    worker.say("checkpoint", number=1, file="../../../primray.sqlite")


def names_folder(worker: Worker) -> None:
    (worker.out / "c.prc").mkdir()
    worker.say("checkpoint", number=1, file="c.prc")


def names_pipe(worker: Worker) -> None:
    os.mkfifo(worker.out / "c.prc")
    worker.say("checkpoint", number=1, file="c.prc")


def skips_a_number(worker: Worker) -> None:
    worker.write("c.prc", b"x")
    worker.say("checkpoint", number=7, file="c.prc")


def names_what_is_not_there(worker: Worker) -> None:
    worker.say("checkpoint", number=1, file="c.prc")


def says_nan(worker: Worker) -> None:
    worker.say("progress", fraction=float("nan"))


def says_too_many_warnings(worker: Worker) -> None:
    for i in range(10_001):
        worker.say("warning", code="w", prim=f"/{i}", detail="d")


def lies_about_digest(worker: Worker) -> None:
    worker.done(sha256="0" * 64)


def makes_what_was_not_asked(worker: Worker) -> None:
    worker.write("x.html", b"<script>")
    item = {"name": "x.html", "file": "x.html", "sha256": "0" * 64, "media_type": "text/html"}
    worker.say("done", outputs=[item], report={"stop": {"reason": "samples"}})


def links_output(worker: Worker) -> None:
    worker.done()
    for name in worker.command["outputs"]:
        (worker.out / name).rename(worker.out / f"kept-{name}")
        (worker.out / name).symlink_to(worker.out / f"kept-{name}")


def tells_of_no_stop(worker: Worker) -> None:
    worker.done("because")


def invents_a_problem(worker: Worker) -> None:
    worker.say("failed", problem={"type": "/problems/unauthenticated-nonsense", "detail": "x"})


HOSTILE = [
    links_checkpoint,
    hard_links_checkpoint,
    names_file_outside,
    names_folder,
    names_pipe,
    skips_a_number,
    names_what_is_not_there,
    says_nan,
    says_too_many_warnings,
    lies_about_digest,
    makes_what_was_not_asked,
    links_output,
    tells_of_no_stop,
    invents_a_problem,
]


@pytest.mark.parametrize("finishes", [False, True], ids=["stays", "finishes"])
@pytest.mark.parametrize("does", HOSTILE, ids=lambda does: does.__name__)
def test_the_frame_fails_and_nothing_is_adopted(tmp_path: Path, does: Callable[[Worker], None], finishes: bool) -> None:
    """Whether the worker stays after it or reports the end of its frame before anybody has looked at what it left."""

    async def script(worker: Worker) -> None:
        worker.sampling()
        if worker.command["settings"]["seed"] == 1:
            does(worker)
            if worker.has_left:
                return
            if not finishes:
                await asyncio.Event().wait()
        worker.done()

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        bad = rig.submit(rig.scene(), settings={"seed": 1})
        good = rig.submit(rig.scene())
        job, other = await rig.ended(bad.id, good.id)
        assert job.state is JobState.FAILED
        assert job.error is not None
        assert job.error["type"] == "/problems/render-failed"
        assert rig.outputs(job.id) == []
        assert {path.name for path in rig.data.frame(job.id, 0).glob("checkpoint*")} == set()
        assert other.state is JobState.SUCCEEDED

    play(tmp_path, script, act)


def test_texts_of_a_worker_can_be_stored_and_shown() -> None:
    warning = messages.warning_of({"code": "c", "prim": "/a\x00b", "detail": "\ud800 \x1b[31m red\nline"})
    assert warning == {"code": "c", "prim": "/a?b", "detail": "? ?[31m red\nline"}
    more = messages.warning_of(
        {"code": "c", "detail": "", "kind": "k\x00" * 99, "attribute": "\x1b" * 9999, "severity": "info"}
    )
    assert (len(more["kind"]), more["attribute"], more["severity"]) == (20, "?" * 1024, "info")


def test_a_problem_keeps_its_own_title_and_status() -> None:
    said = {"type": "/problems/time-limit", "title": "<b>", "status": 200, "detail": "d", "limit": 3, "retryable": True}
    problem = messages.failed_of({"problem": said}).problem
    assert (problem["title"], problem["status"], problem["retryable"]) == ("The render took longer than is allowed", 422, False)
    assert problem["limit"] == 3


def nested(depth: int) -> Any:
    value: Any = 1
    for _ in range(depth):
        value = [value]
    return value


@pytest.mark.parametrize("value", [nested(50), list(range(60_000)), {"a": 1e400}, {"a": float("-inf")}, {"a": object()}])
def test_too_much_is_not_believed(value: Any) -> None:
    with pytest.raises(NotBelieved):
        messages.clean(value)


@pytest.mark.parametrize("name", ["", ".", "..", "a/b", "/etc/passwd", ".hidden", "a..b", "a\x00b", "ä", "a" * 101, 3, None])
def test_only_plain_names_are_files(name: Any) -> None:
    with pytest.raises(NotBelieved):
        messages.file_name(name)
