"""What the local executor does about workers that misbehave: programs that do anything, in place of ours."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from primray_service.executor.base import Chunk, Ended, Message
from primray_service.executor.local import LocalExecutor
from primray_service.executor.local_worker import Run, SandboxLayers
from primray_service.executor.process import READ_BYTES
from primray_service.files import DataDirectory
from primray_service.limits import GiB, Limits, MiB
from primray_service.problems import Problem
from primray_service.worker.protocol import MAX_LINE_BYTES

# A worker that is told what to do in Python.
PROGRAM = (
    "import json, os, sys, time\n"
    "def say(**message): print(json.dumps(message), flush=True)\n"
    "say(at='ready')\n"
    "line = sys.stdin.readline()\n"
    "exec(json.loads(line)['script']) if line else None\n"
)
DONE = "say(at='done', outputs=[], report={})"
LIMITS = Limits(memory_bytes=1 * GiB, output_bytes=8 * MiB, log_bytes=256 * 1024)


@asynccontextmanager
async def started(folder: Path, limits: Limits = LIMITS, **options: Any) -> AsyncIterator[LocalExecutor]:
    executor = LocalExecutor(
        DataDirectory(folder),
        limits,
        cores=2,
        sandbox_layers=SandboxLayers(frozenset(), ("-c", PROGRAM)),
        **{"warm": False, **options},
    )
    await executor.start()
    try:
        yield executor
    finally:
        await executor.close()


def chunk(script: str, **more: Any) -> Chunk:
    return Chunk("chunk", "render", {"do": "render", "script": textwrap.dedent(script)}, **more)


async def result_of(executor: LocalExecutor, work: Chunk) -> tuple[Ended, list[Message]]:
    heard: list[Message] = []
    handle = executor.submit(work, heard.append)
    return await asyncio.wait_for(handle.result(), 60), heard


@pytest.fixture
def ends(tmp_path: Path) -> Callable[..., tuple[Ended, list[Message]]]:
    """How a script ends, and what was heard of it."""

    def run(script: str, limits: Limits = LIMITS, **more: Any) -> tuple[Ended, list[Message]]:
        async def go() -> tuple[Ended, list[Message]]:
            async with started(tmp_path, limits) as executor:
                return await result_of(executor, chunk(script, **more))

        return asyncio.run(go())

    return run


Ends = Callable[..., tuple[Ended, list[Message]]]


@pytest.mark.parametrize(
    ("script", "why"),
    [
        ("print('Hello', flush=True)", "not JSON"),
        ("print('[' * 100000, flush=True)", "not JSON"),
        ('print(\'{"at": "row", "t_s": NaN}\', flush=True)', "not JSON"),
        ("print('[]', flush=True)", "not a message"),
        ("say(at='hello')", "'hello'"),
        ("say(at='row', t_s=1)", "malformed"),
        ("say(at='preview', **{'pass': 1, 'file': '../../etc/passwd', 'bytes': 1})", "malformed"),
        ("say(at='phase', phase='dancing')", "malformed"),
        ("say(at='facts', deep=eval('[' * 60 + ']' * 60))", "malformed"),
        (f"print('x' * {MAX_LINE_BYTES + 1}, flush=True)", "bytes"),
        (f"sys.stdout.write('x' * {MAX_LINE_BYTES + 70000}); sys.stdout.flush()", "bytes"),
        (f"{DONE}; {DONE}", "after 'done'"),
    ],
)
def test_what_is_no_message_ends_it(ends: Ends, script: str, why: str) -> None:
    ended, heard = ends(script + "; time.sleep(60)")
    assert ended.reason == "exited"
    assert why in ended.protocol_error
    assert [message["at"] for message in heard] == (["done"] if "done" in why else [])


def test_one_that_does_not_leave(ends: Ends, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("primray_service.executor.local_worker.LEAVE_WITHIN_S", 0.3)
    start = time.monotonic()
    ended, heard = ends(f"{DONE}; time.sleep(60)")
    assert time.monotonic() - start < 20
    assert "did not exit" in ended.protocol_error
    assert [message["at"] for message in heard] == ["done"]


@pytest.mark.parametrize(
    ("script", "expected"),
    [
        ("sys.exit(3)", ("exited", 3, None)),
        ("os.kill(os.getpid(), 11)", ("signal", None, 11)),
        ("os.kill(os.getpid(), 6)", ("signal", None, 6)),
        ("os.kill(os.getpid(), 24)", ("time-limit", None, 24)),
        ("os.kill(os.getpid(), 25)", ("exited", 0, None)),  # Python ignores SIGXFSZ, a write fails instead
        ("pass", ("exited", 0, None)),
    ],
)
def test_how_it_ended(ends: Ends, script: str, expected: tuple[str, int | None, int | None]) -> None:
    ended, heard = ends(script)
    assert (ended.reason, ended.exit_code, ended.signal) == expected
    assert heard == []


def test_its_memory_is_watched(ends: Ends) -> None:
    ended, _ = ends("kept = bytearray(300 * 2**20); time.sleep(60)", memory_bytes=100 * MiB)
    assert ended.reason == "memory-limit"
    assert ended.peak_rss_bytes > 100 * MiB


def test_that_of_its_children_too(ends: Ends) -> None:
    script = """
        for _ in range(3):
            if os.fork() == 0:
                kept = b"x" * (60 * 2**20)
                time.sleep(60)
        time.sleep(60)
        """
    ended, _ = ends(script, memory_bytes=150 * MiB)
    assert ended.reason == "memory-limit"


def test_cpu_seconds_before_sampling_are_watched(ends: Ends, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("primray_service.executor.local_worker.LOAD_WALL_PER_CPU", 1e6)
    ended, _ = ends("while True: pass", load_cpu_s=0.4)
    assert ended.reason == "time-limit"
    assert 0.4 <= ended.cpu_s < 2


def test_those_of_sampling_are_not(ends: Ends) -> None:
    script = f"""
        say(at='phase', phase='sampling')
        while time.process_time() < 1.2: pass
        {DONE}
        """
    ended, heard = ends(script, load_cpu_s=0.4)
    assert ended.reason == "exited"
    assert [message["at"] for message in heard] == ["phase", "done"]
    assert 0.9 < ended.cpu_s < 1.6


def test_one_that_sleeps(ends: Ends) -> None:
    ended, _ = ends("time.sleep(60)", load_cpu_s=0.02)
    assert ended.reason == "time-limit"
    assert ended.cpu_s < 0.5


def test_what_it_writes_is_watched(ends: Ends) -> None:
    script = """
        out = json.loads(os.environ["PRIMRAY_SANDBOX"])["out"]
        for i in range(20):
            open(os.path.join(out, f"file{i}"), "wb").write(bytes(2**20))
        time.sleep(60)
        """
    ended, _ = ends(script)
    assert ended.reason == "storage-limit"


def test_its_log_is_bounded(tmp_path: Path) -> None:
    async def go() -> None:
        async with started(tmp_path) as executor:
            script = f'sys.stderr.write("begin\\n" + "x" * {3 * MiB} + "\\nend\\n"); {DONE}'
            ended, _ = await result_of(executor, chunk(script))
            assert ended.log_file is not None
            kept = ended.log_file.read_text()
            assert len(kept) <= LIMITS.log_bytes
            assert kept.startswith("begin\n")
            assert kept.endswith("\nend\n")
            assert "bytes are left out here" in kept

    asyncio.run(go())


def test_one_that_talks_without_end_is_made_to_wait(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("primray_service.executor.process.LINES_A_SECOND", 50)

    async def go() -> None:
        async with started(tmp_path) as executor:
            row = json.dumps({"at": "row", "t_s": 1, "samples": 1, "relmse": 1, "ci95": [1, 1], "rmse": 1}) + "\n"
            heard: list[Message] = []
            handle = executor.submit(chunk(f"while True: sys.stdout.write({row * 1000!r})"), heard.append)
            while not heard:
                await asyncio.sleep(0.01)
            start = time.monotonic()
            await asyncio.sleep(0.8)
            seconds = time.monotonic() - start
            handle.kill()
            assert (await handle.result()).reason == "killed"
            # One read of 64 KiB more than is allowed, each second.
            assert len(heard) < (50 + READ_BYTES / len(row) + 1) * (seconds + 2)

    asyncio.run(go())


def test_what_is_told_early_comes_after_the_command(tmp_path: Path) -> None:
    async def go() -> None:
        async with started(tmp_path) as executor:
            script = f"assert json.loads(sys.stdin.readline()) == {{'do': 'stop'}}; {DONE}"
            heard: list[Message] = []
            handle = executor.submit(chunk(script), heard.append)
            handle.tell({"do": "stop"})
            assert (await handle.result()).exit_code == 0
            assert [message["at"] for message in heard] == ["done"]

    asyncio.run(go())


READ = """
    job = json.loads(os.environ["PRIMRAY_SANDBOX"])["job"]
    found = {}
    for folder, _, files in os.walk(job):
        for name in files:
            path = os.path.join(folder, name)
            found[os.path.relpath(path, job)] = [open(path).read(), os.stat(path).st_nlink]
    say(at='facts', found=found)
    """


@pytest.mark.parametrize("links", [2, 1], ids=["links", "copies"])
def test_it_finds_its_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, links: int) -> None:
    package = tmp_path / "package"
    (package / "textures").mkdir(parents=True)
    (package / "shot.usda").write_text("shot")
    (package / "textures" / "wood.png").write_text("wood")
    (tmp_path / "upload").write_text("scene")
    if links == 1:

        def no_link(*_: object, **__: object) -> None:
            raise OSError(18, "Invalid cross-device link")

        monkeypatch.setattr("os.link", no_link)

    async def go() -> None:
        async with started(tmp_path / "data") as executor:
            work = chunk(READ, inputs={"scene.usda": tmp_path / "upload"}, folders={"package": package})
            ended, heard = await result_of(executor, work)
            assert ended.exit_code == 0, ended.log
            assert heard[-1]["found"] == {
                "scene.usda": ["scene", links],
                "package/shot.usda": ["shot", links],
                "package/textures/wood.png": ["wood", links],
            }

    asyncio.run(go())


@pytest.mark.parametrize("bad", ["missing", "link", "outside"])
def test_files_that_cannot_be_put_in_place(tmp_path: Path, bad: str) -> None:
    (tmp_path / "there").write_text("x")
    (tmp_path / "link").symlink_to(tmp_path / "there")
    inputs = {
        "missing": {"scene.usda": tmp_path / "missing"},
        "link": {"scene.usda": tmp_path / "link"},
        "outside": {"../scene.usda": tmp_path / "there"},
    }[bad]

    async def go() -> None:
        async with started(tmp_path / "data") as executor:
            ended, heard = await result_of(executor, chunk(READ, inputs=inputs))
            assert ended.reason == "lost"
            assert "cannot be linked into its folder" in ended.protocol_error
            assert heard == []

    asyncio.run(go())


def test_close_ends_all_and_leaves_nothing(tmp_path: Path) -> None:
    async def go() -> list[int]:
        async with started(tmp_path, warm=True) as executor:
            handles = [executor.submit(chunk("time.sleep(60)"), lambda _: None) for _ in range(3)]
            pids = [handle.pid for handle in handles if isinstance(handle, Run)]
            await asyncio.sleep(0.1)
        ended = [await handle.result() for handle in handles]
        assert [end.reason for end in ended] == ["killed"] * 3
        with pytest.raises(Problem):
            executor.submit(chunk(DONE), lambda _: None)
        return pids

    pids = asyncio.run(go())
    assert len(pids) == 3
    assert not any(Path(f"/proc/{pid}").exists() for pid in pids)
    assert list((tmp_path / "slots").iterdir()) == []


def test_released_while_it_runs(tmp_path: Path) -> None:
    async def go() -> None:
        async with started(tmp_path) as executor:
            handle = executor.submit(chunk("time.sleep(60)"), lambda _: None)
            handle.release()
            assert handle.folder.is_dir()
            handle.kill()
            await handle.result()
            for _ in range(200):
                if not handle.folder.exists():
                    return
                await asyncio.sleep(0.02)
            pytest.fail("its files are still there")

    asyncio.run(go())


def test_a_waiting_worker_that_died_is_not_given_work(tmp_path: Path) -> None:
    async def go() -> None:
        async with started(tmp_path, warm=True) as executor:
            worker = executor._warm["render"]
            os.kill(worker.process.pid, signal.SIGKILL)
            await worker.process.exit
            await asyncio.sleep(0)
            ended, heard = await result_of(executor, chunk(DONE))
            assert ended.exit_code == 0
            assert [message["at"] for message in heard] == ["done"]

    asyncio.run(go())


def test_one_worker_waits_for_each_kind_and_is_replaced(tmp_path: Path) -> None:
    async def go() -> None:
        async with started(tmp_path, warm=True) as executor:
            assert executor.health()["warm"] == ["check", "render"]
            before = executor._warm["render"].process.pid
            handle = executor.submit(chunk(DONE), lambda _: None)
            assert isinstance(handle, Run)
            assert handle.pid == before
            assert executor.health()["warm"] == ["check"]
            await handle.result()
            await asyncio.sleep(0.1)
            assert executor._warm["render"].process.pid != before

    asyncio.run(go())


def test_where_no_worker_starts(tmp_path: Path) -> None:
    async def go() -> None:
        walls = SandboxLayers(frozenset(), ("-c", "raise SystemExit('no such luck')"))
        executor = LocalExecutor(DataDirectory(tmp_path), LIMITS, cores=2, sandbox_layers=walls)
        with pytest.raises(Problem, match="no such luck") as raised:
            await executor.start()
        assert raised.value.slug == "unavailable"
        assert not executor.health()["ok"]
        await executor.close()

    asyncio.run(go())


SERVER = """
import asyncio, sys
from pathlib import Path
from tests.service.executor.test_local_workers import chunk, started
async def go():
    async with started(Path(sys.argv[1]), warm=True) as executor:
        handle = executor.submit(chunk(sys.argv[2]), lambda message: None)
        await asyncio.sleep(0.3)
        print(handle.pid, executor._warm["check"].process.pid, flush=True)
        await asyncio.sleep(60)
asyncio.run(go())
"""


def test_a_server_that_is_killed_takes_its_workers_along(tmp_path: Path) -> None:
    script = "sys.stdin.read(); os._exit(4)"  # as ours do, in a thread
    server = subprocess.Popen([sys.executable, "-c", SERVER, str(tmp_path), script], stdout=subprocess.PIPE, text=True)
    assert server.stdout is not None
    pids = [int(word) for word in server.stdout.readline().split()]
    assert len(pids) == 2
    server.kill()
    server.wait()
    end = time.monotonic() + 10
    while any(is_alive(pid) for pid in pids):
        assert time.monotonic() < end
        time.sleep(0.02)
    assert len(list((tmp_path / "slots").iterdir())) > 1

    async def go() -> None:
        async with started(tmp_path):
            names = {path.name.partition("-")[0].partition(".")[0] for path in (tmp_path / "slots").iterdir()}
            assert len(names) == 1  # this one's alone

    asyncio.run(go())


def is_alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_a_living_servers_slots_are_left_alone(tmp_path: Path) -> None:
    async def go() -> None:
        async with started(tmp_path) as first:
            handle = first.submit(chunk("time.sleep(60)"), lambda _: None)
            async with started(tmp_path):
                assert handle.folder.is_dir()
            assert handle.folder.is_dir()

    asyncio.run(go())
