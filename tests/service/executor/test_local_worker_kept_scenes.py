"""Workers that keep a scene open for other jobs on it: the same tenant's, when nobody wants what the one before left."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from typing import Any

import pytest
from tests.service.executor.test_local_worker_staying import DONE, Played, is_there, play

KEPT: dict[str, Any] = {"scene": "tenant/sha256:1", "keep_s": 60.0, "more": False}


def test_another_job_on_the_scene_has_the_same_process(tmp_path: Path) -> None:
    async def act(played: Played) -> None:
        for group in ("a/1", "b/1", "", ""):
            ended = await played.play(DONE, group=group, **KEPT)
            assert ended.lives
            played.handles[-1].release()

    assert len(set(play(tmp_path, act).pids)) == 1


@pytest.mark.parametrize("other", ["other/sha256:1", "tenant/sha256:2", ""])
def test_another_tenant_or_scene_has_its_own(tmp_path: Path, other: str) -> None:
    async def act(played: Played) -> None:
        for scene in (KEPT["scene"], other, KEPT["scene"]):
            await played.play(DONE, group="", **{**KEPT, "scene": scene})
            played.handles[-1].release()

    played = play(tmp_path, act, slots=4)
    assert played.pids[0] == played.pids[2] != played.pids[1]


def test_it_is_not_given_away_while_its_files_are_wanted(tmp_path: Path) -> None:
    async def act(played: Played) -> None:
        await played.play(DONE, group="a/1", **KEPT)
        await played.play(DONE, group="b/1", **KEPT)

    assert len(set(play(tmp_path, act, slots=4).pids)) == 2


def test_another_job_does_not_find_what_the_first_one_left(tmp_path: Path) -> None:
    write = """
        out = json.loads(os.environ["PRIMRAY_SANDBOX"])["out"]
        print(json.dumps(sorted(os.listdir(out))), file=sys.stderr, flush=True)
        open(os.path.join(out, "beauty.exr"), "w").write("picture")
        say(at='done', outputs=[], report={})
        """

    async def act(played: Played) -> None:
        for job in ("a/1", "a/1", "b/1"):
            await played.play(write, group=job, **{**KEPT, "more": True})
            assert (played.ends[-1].folder / "beauty.exr").read_text() == "picture"
            played.handles[-1].release()

    found = [json.loads(end.log) for end in play(tmp_path, act).ends]
    assert ["beauty.exr" in names for names in found] == [False, True, False]


def test_a_long_render_keeps_its_scene_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("primray_service.executor.local_worker.STAYS_IF_CPU_S", 0.1)

    async def act(played: Played) -> None:
        ended = await played.play(f"say(at='phase', phase='sampling')\nwhile time.process_time() < 0.4: pass\n{DONE}", **KEPT)
        assert ended.lives

    play(tmp_path, act)


def test_one_that_does_something_while_it_waits_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("primray_service.executor.local.LOOK_AT_IDLE_EVERY_S", 0.1)
    monkeypatch.setattr("primray_service.executor.local.IDLE_CPU_S", 0.2)
    spin = "import threading\ndef spin():\n    while True: pass\nthreading.Thread(target=spin, daemon=True).start()\n"

    async def act(played: Played) -> None:
        await played.play(DONE, group="", **{**KEPT, "scene": "tenant/quiet"})
        await played.play(spin + DONE, group="", **KEPT)
        for _ in range(1000):
            if not is_there(played.pids[1]):
                break
            await asyncio.sleep(0.02)
        assert not is_there(played.pids[1])
        assert is_there(played.pids[0])

    play(tmp_path, act, slots=4)
