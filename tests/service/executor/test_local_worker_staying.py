"""Workers that stay for the chunks of one group: programs that do anything, in place of ours, behind walls where they count."""

from __future__ import annotations

import asyncio
import json
import os
import textwrap
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from tests.service.sandbox.inside import needs

from primray_service.executor.base import Chunk, Ended
from primray_service.executor.local import LocalExecutor
from primray_service.executor.local_worker import Run, SandboxLayers
from primray_service.files import DataDirectory
from primray_service.limits import GiB, Limits, MiB

PROGRAM = """
import json, os, sys, time
def say(**message): print(json.dumps(message), flush=True)
entered = None
if ENTERS:
    from primray_service.sandbox import enter
    entered = enter()
say(at='ready')
for line in sys.stdin:
    command = json.loads(line)
    exec(command['script'])
    if not command['stay']: break
    say(at='ready')
"""
DONE = "say(at='done', outputs=[], report={})"
LIMITS = Limits(memory_bytes=2 * GiB, output_bytes=8 * MiB, log_bytes=256 * 1024)


@dataclass
class Played:
    """What became of chunks, in order."""

    executor: LocalExecutor
    pids: list[int] = field(default_factory=list)
    ends: list[Ended] = field(default_factory=list)
    heard: list[dict[str, Any]] = field(default_factory=list)
    handles: list[Run] = field(default_factory=list)

    async def play(self, script: str, *, group: str = "job/1", more: bool = True, **files: Any) -> Ended:
        self.begin(script, group=group, more=more, **files)
        return await self.end()

    def begin(self, script: str, *, group: str = "job/1", more: bool = True, **files: Any) -> None:
        command = {"do": "render", "script": textwrap.dedent(script)}
        chunk = Chunk("chunk", "render", command, group=group, more_follow=more, **files)
        handle = self.executor.submit(chunk, lambda message: self.heard.append(dict(message)))
        assert isinstance(handle, Run)
        self.handles.append(handle)
        self.pids.append(handle.pid)

    async def end(self) -> Ended:
        self.ends.append(await asyncio.wait_for(self.handles[-1].result(), 60))
        return self.ends[-1]


@asynccontextmanager
async def playing(folder: Path, *, layers: frozenset[str] = frozenset(), **options: Any) -> AsyncIterator[Played]:
    walls = SandboxLayers(layers, ("-c", f"ENTERS = {bool(layers)}\n{PROGRAM}"))
    executor = LocalExecutor(DataDirectory(folder), LIMITS, cores=2, sandbox_layers=walls, **{"warm": False, **options})
    await executor.start()
    try:
        yield Played(executor)
    finally:
        await executor.close()


Act = Callable[[Played], Coroutine[Any, Any, None]]


def play(folder: Path, act: Act, **options: Any) -> Played:
    async def run() -> Played:
        async with playing(folder, **options) as played:
            await act(played)
        return played

    return asyncio.run(run())


def is_there(pid: int) -> bool:
    return Path(f"/proc/{pid}").exists()


def test_ten_frames_are_one_process(tmp_path: Path) -> None:
    async def act(played: Played) -> None:
        for frame in range(10):
            ended = await played.play(f"sys.stderr.write('frame {frame}\\n'); {DONE}", more=frame < 9)
            assert ended.lives == (frame < 9)
            assert ended.log_file is not None
            assert ended.log_file.read_text() == ended.log == f"frame {frame}\n"
        for handle in played.handles:
            handle.release()

    played = play(tmp_path, act)
    assert len(set(played.pids)) == 1
    assert not is_there(played.pids[0])


def test_another_job_has_a_process_of_its_own(tmp_path: Path) -> None:
    """While the first one's waits, and whoever asks: another job, another attempt, one frame alone."""

    async def act(played: Played) -> None:
        for group in ("a/1", "b/1", "a/2", "", "", "a/1"):
            await played.play(DONE, group=group)

    played = play(tmp_path, act, slots=8)
    assert len(set(played.pids)) == 5
    assert played.pids[0] == played.pids[5]


def test_those_that_run_at_a_time_are_different(tmp_path: Path) -> None:
    async def act(played: Played) -> None:
        for _ in range(2):
            played.begin("time.sleep(0.3); " + DONE)
            played.begin("time.sleep(0.3); " + DONE)
            for handle in played.handles:
                await handle.result()

    played = play(tmp_path, act, slots=2)
    assert len(set(played.pids[:2])) == 2
    assert set(played.pids[2:]) == set(played.pids[:2])


def test_a_crash_ends_one_frame(tmp_path: Path) -> None:
    async def act(played: Played) -> None:
        await played.play(DONE)
        await played.play("os.kill(os.getpid(), 11)")
        await played.play(DONE)

    played = play(tmp_path, act)
    assert [(end.reason, end.signal) for end in played.ends] == [("exited", None), ("signal", 11), ("exited", None)]
    assert played.pids[0] == played.pids[1] != played.pids[2]


@pytest.mark.parametrize("last", ["say(at='yielded', number=1)", "say(at='failed', problem={})", "sys.exit(3)"])
def test_only_one_that_is_done_stays(tmp_path: Path, last: str) -> None:
    async def act(played: Played) -> None:
        ended = await played.play(f"{last}; os._exit(0)")
        assert not ended.lives
        await played.play(DONE)

    assert len(set(play(tmp_path, act).pids)) == 2


def test_it_is_killed_while_it_works_and_only_then(tmp_path: Path) -> None:
    async def act(played: Played) -> None:
        await played.play(DONE)
        played.handles[0].kill()  # comes late
        played.handles[0].tell({"do": "stop"})
        played.begin("time.sleep(60)")
        await asyncio.sleep(0.1)
        played.handles[1].kill()
        await played.end()

    played = play(tmp_path, act)
    assert played.pids[0] == played.pids[1]
    assert [end.reason for end in played.ends] == ["exited", "killed"]


def test_it_does_not_wait_for_long(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("primray_service.executor.local.STAYS_S", 0.2)

    async def act(played: Played) -> None:
        await played.play(DONE)
        slot = played.ends[0].folder.parent
        for _ in range(400):
            if not is_there(played.pids[0]):
                break
            await asyncio.sleep(0.02)
        assert not is_there(played.pids[0])
        assert slot.exists()  # its files are wanted still
        played.handles[0].release()
        for _ in range(400):
            if not slot.exists():
                break
            await asyncio.sleep(0.02)
        assert not slot.exists()
        await played.play(DONE)

    assert len(set(play(tmp_path, act).pids)) == 2


def test_of_many_that_wait_the_oldest_goes(tmp_path: Path) -> None:
    async def act(played: Played) -> None:
        for group in ("a/1", "b/1", "a/1", "b/1"):
            await played.play(DONE, group=group)
            assert played.executor.health()["staying"] == 1

    assert len(set(play(tmp_path, act, slots=1).pids)) == 4


@pytest.mark.parametrize(
    ("script", "most_cpu_s"),
    [
        (f"kept = b'x' * (700 * 2**20); {DONE}", 20.0),
        (
            f"open(os.path.join(json.loads(os.environ['PRIMRAY_SANDBOX'])['out'], 'x'), 'wb').write(bytes(3 * 2**20)); {DONE}",
            20.0,
        ),
        (f"\nwhile time.process_time() < 0.4: pass\n{DONE}", 0.3),
    ],
    ids=["memory", "space", "time"],
)
def test_after_a_large_frame_it_does_not_stay(
    tmp_path: Path, script: str, most_cpu_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("primray_service.executor.local_worker.STAYS_IF_CPU_S", most_cpu_s)

    async def act(played: Played) -> None:
        ended = await played.play(f"say(at='phase', phase='sampling'); {script}")
        assert not ended.lives
        await played.play(DONE)

    assert len(set(play(tmp_path, act).pids)) == 2


READ = """
    job = json.loads(os.environ["PRIMRAY_SANDBOX"])["job"]
    found = {name: open(os.path.join(job, name)).read() for name in sorted(os.listdir(job))}
    print(json.dumps(found), file=sys.stderr, flush=True)
    say(at='done', outputs=[], report={})
    """


def test_each_chunk_finds_its_own_files(tmp_path: Path) -> None:
    for name in ("scene", "first", "second"):
        (tmp_path / name).write_text(name)
    scene = {"scene.usda": tmp_path / "scene"}

    async def act(played: Played) -> None:
        for checkpoint in ("first", "second", None):
            inputs = scene if checkpoint is None else {**scene, "checkpoint.prc": tmp_path / checkpoint}
            ended = await played.play(READ, inputs=inputs)
            expected = {"scene.usda": "scene"} if checkpoint is None else {"checkpoint.prc": checkpoint, "scene.usda": "scene"}
            assert json.loads(ended.log) == expected

    assert len(set(play(tmp_path / "data", act).pids)) == 1


TRIES = """
    import errno
    from primray_service.sandbox.attempts import tries
    found = {}
    for name, attempt in tries(targets, entered.job, entered.out).items():
        try:
            attempt()
        except OSError as error:
            found[name] = errno.errorcode.get(error.errno or 0, str(error))
        else:
            found[name] = "allowed"
    print(json.dumps(found), file=sys.stderr, flush=True)
    say(at='done', outputs=[], report={})
    """
LANDLOCK, BUBBLEWRAP = ("rlimits", "landlock", "seccomp"), ("rlimits", "bubblewrap", "seccomp")


@pytest.mark.parametrize("walls", [LANDLOCK, BUBBLEWRAP, (*LANDLOCK, "bubblewrap")], ids=["landlock", "bubblewrap", "all"])
def test_the_walls_stand_for_every_frame(tmp_path: Path, walls: tuple[str, ...]) -> None:
    """What a worker tries in its third frame is refused as in its first: the scene of another job that waits, too."""
    layers = needs(*walls)
    (tmp_path / "scene").write_text("#usda 1.0")

    async def act(played: Played) -> None:
        inputs = {"scene": tmp_path / "scene"}
        await played.play(DONE, group="other/1", inputs=inputs)
        other = played.ends[0].folder.parent
        targets: dict[str, Any] = {
            "server_pid": os.getpid(),
            "file": str(other / "job" / "scene"),
            "folder": str(other / "job"),
            "tcp_port": 9,
            "udp_port": 9,
            "abstract": "\0primray-nobody",
        }
        assert Path(targets["file"]).read_text() == "#usda 1.0"
        await played.play(DONE, inputs=inputs)
        await played.play(DONE, inputs=inputs)
        ended = await played.play(f"targets = {targets!r}\n{textwrap.dedent(TRIES)}", inputs=inputs)
        found = json.loads(ended.log)
        assert len(found) >= 23
        assert "allowed" not in found.values(), found

    played = play(tmp_path / "data", act, layers=layers, slots=4)
    assert played.pids[1] == played.pids[2] == played.pids[3] != played.pids[0]
