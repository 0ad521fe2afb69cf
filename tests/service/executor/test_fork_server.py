"""Forked workers: they have the walls of those that are started as programs, share nothing, and outlive the process that they
are forked from, which is started again.

tests/service/sandbox runs its programs in forked workers as well, and test_local_executor.py its contract.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from tests.service.executor.contract import FOREVER, Watched
from tests.service.executor.scenes import ROOM
from tests.service.executor.test_local_workers import is_alive
from tests.service.sandbox import inside
from tests.service.sandbox.inside import make_slot, needs, run_inside

from primray_service.executor import fork_server
from primray_service.executor.base import Chunk
from primray_service.executor.fork_server import ForkedProcess, ForkServer, attempts_in
from primray_service.executor.local import LocalExecutor
from primray_service.executor.local_worker import Run, SandboxLayers
from primray_service.executor.slots import Slots
from primray_service.files import DataDirectory
from primray_service.limits import GiB, Limits
from primray_service.sandbox import Budget
from primray_service.sandbox.bubblewrap import interpreter_links, readable_paths
from primray_service.sandbox.namespaces import REQUIRED
from primray_service.sandbox.spawn import worker_fork

LANDLOCK, BUBBLEWRAP = ("rlimits", "landlock", "seccomp"), ("rlimits", "bubblewrap", "seccomp")
SOON_S = 60.0


@asynccontextmanager
async def started(folder: Path, layers: frozenset[str] | None = None) -> AsyncIterator[LocalExecutor]:
    walls = SandboxLayers(layers)
    executor = LocalExecutor(DataDirectory(folder), Limits(memory_bytes=2 * GiB), slots=2, cores=2, sandbox_layers=walls)
    await executor.start()
    try:
        yield executor
    finally:
        await executor.close()


def submit(executor: LocalExecutor, folder: Path, **settings: Any) -> tuple[Run, Watched]:
    scene = folder / "room.usda"
    scene.write_text(ROOM)
    memory = settings.pop("memory_bytes", None)
    command = {
        "do": "render",
        "file": "scene.usda",
        "settings": {"resolution": [64, 48], "spp": 4, **settings},
        "checkpoint": None,
        "number": 0,
    }
    watched = Watched(Chunk("chunk", "render", command, {"scene.usda": scene}, memory_bytes=memory))
    run = executor.submit(watched.chunk, watched.hear)
    assert isinstance(run, Run)
    watched.handle = run
    return run, watched


def server_of(executor: LocalExecutor) -> ForkServer:
    assert executor._fork_servers is not None
    found = executor._fork_servers.current
    assert found is not None, executor._fork_servers.why_not
    return found


async def until(holds: Callable[[], bool]) -> None:
    end = time.monotonic() + SOON_S
    while not holds():
        assert time.monotonic() < end
        await asyncio.sleep(0.02)


def parent_of(pid: int) -> int:
    return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])


@pytest.mark.parametrize("walls", [LANDLOCK, BUBBLEWRAP, (*LANDLOCK, "bubblewrap")], ids=["landlock", "bubblewrap", "all"])
def test_nothing_gets_out_of_a_forked_worker(walls: tuple[str, ...], tmp_path: Path) -> None:
    async def go() -> dict[str, str]:
        slots = Slots(tmp_path / "slots", "test")
        slots.open()
        server = ForkServer(slots.make())
        await asyncio.wait_for(server.ready.wait(), SOON_S)
        found = await attempts_in(server, slots.folder, needs(*walls))
        server.leave()
        assert (await asyncio.wait_for(server.process.exit, SOON_S)).returncode == 0, server.process.log.tail()
        return found

    found = asyncio.run(go())
    assert len(found) >= 23
    assert [name for name, result in found.items() if not result.startswith("refused: ")] == []


def test_a_forked_worker_is_in_the_root_and_the_namespaces_that_bubblewrap_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(inside, "FORKS", True)
    program = f"""
spaces = {{name: os.stat(f"/proc/self/ns/{{name}}").st_ino for name in {REQUIRED!r}}}
processes = [int(name) for name in os.listdir("/proc") if name.isdigit()]
say([spaces, os.getuid(), os.listdir("/"), processes, os.getpid(), socket.gethostname()])
"""
    ended = run_inside(make_slot(tmp_path), program, needs(*BUBBLEWRAP))
    assert ended.said is not None, ended.errors
    spaces, user, root, processes, own, host = ended.said
    assert {name for name, number in spaces.items() if number == os.stat(f"/proc/self/ns/{name}").st_ino} == set()
    assert (user, host) == (65534, "worker")
    # What Python needs may lie anywhere on this machine, below /root too.
    needed = {path.split("/")[1] for path in (*readable_paths(), *(link for link, _ in interpreter_links()))}
    assert {"job", "out"} < set(root) <= {"job", "out", "cat", "proc", "dev", "sys"} | needed
    assert own in processes
    assert max(processes) < 10  # bubblewrap, the program that waits, and itself


def test_forked_workers_share_no_random_numbers(tmp_path: Path) -> None:
    """One fork server, two workers: their random numbers, the names of their temporary files and their ids differ."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    program = (
        "import json, random, tempfile, uuid, numpy\n"
        "print(json.dumps([random.random(), numpy.random.rand(), next(tempfile._get_candidate_names()), str(uuid.uuid4()), "
        "tempfile.tempdir]), flush=True)\n"
    )
    code = (
        "import random, tempfile, uuid, numpy\ntempfile.mktemp(); random.random(); numpy.random.rand()\n" + inside.FORK_SERVER
    )

    async def go() -> list[list[Any]]:
        with theirs:
            command = [sys.executable, "-c", code, str(theirs.fileno())]
            environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
            server = subprocess.Popen(command, env=environment, pass_fds=(theirs.fileno(),))
        found = []
        for number in range(2):
            slot = make_slot(tmp_path / str(number))
            request = worker_fork(slot, Budget(2 * GiB), frozenset())
            lines: list[bytes] = []
            more = {"kind": "program", "targets": {"program": program}}
            forked = ForkedProcess(ours, request | more, slot / "log.txt", 2**20, lines.append)
            await asyncio.wait_for(asyncio.shield(forked.exit), SOON_S)
            assert lines, (slot / "log.txt").read_text()
            found.append(json.loads(lines[-1]))
        ours.close()
        assert server.wait(20) == 0
        return found

    one, other = asyncio.run(go())
    assert [a for a, b in zip(one, other, strict=True) if a == b] == [None]  # each finds its own folder of temporary files


def test_nothing_of_a_job_is_in_the_memory_that_the_next_is_forked_from(tmp_path: Path) -> None:
    async def go() -> None:
        async with started(tmp_path) as executor:
            run, watched = submit(executor, tmp_path)
            marks = [b"beauty-of-a-tenant", run.folder.parent.name.encode()]
            await watched.ended()
            run.release()
            await asyncio.wait_for(executor._warm["render"].ready.wait(), SOON_S)
            own = executor._warm["render"].slot.root.name.encode()
            memory = _memory_of(server_of(executor).process.pid)
            assert b"primray_service.worker.fork_server" in memory  # so it is that process' memory
            assert [mark for mark in (*marks, own) if mark in memory] == []

    asyncio.run(go())


def _memory_of(pid: int) -> bytes:
    """All private memory of a process that it can write to."""
    found = []
    with open(f"/proc/{pid}/mem", "rb", buffering=0) as memory:
        for line in Path(f"/proc/{pid}/maps").read_text().splitlines():
            begin, end = (int(word, 16) for word in line.split()[0].split("-"))
            if line.split()[1].startswith("rw") and end - begin < 2**28:
                memory.seek(begin)
                with contextlib.suppress(OSError):
                    found.append(memory.read(end - begin))
    return b"".join(found)


def test_workers_outlive_the_fork_server_which_is_started_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fork_server, "AGAIN_AFTER_S", 0.1)

    async def go() -> None:
        async with started(tmp_path) as executor:
            run, watched = submit(executor, tmp_path, spp=FOREVER)
            await watched.until("progress")
            before = server_of(executor).process.pid
            os.kill(before, signal.SIGKILL)
            passes = len(watched.said("progress"))
            _, other = submit(executor, tmp_path)  # whether it is noticed yet or not
            ended = await other.ended()
            assert ended.reason == "lost" or other.last["at"] == "done"
            await until(lambda: executor.health()["fork_server"] == "on" and server_of(executor).process.pid != before)
            await until(lambda: len(watched.said("progress")) > passes)
            _, third = submit(executor, tmp_path)
            assert (await third.ended()).exit_code == 0
            assert third.last["at"] == "done"
            run.kill()
            assert (await watched.ended()).reason == "killed"

    asyncio.run(go())


def test_a_worker_without_its_keeper_is_lost_and_ends(tmp_path: Path) -> None:
    async def go() -> None:
        async with started(tmp_path) as executor:
            run, watched = submit(executor, tmp_path, spp=FOREVER)
            await watched.until("progress")
            worker = run.pid
            keeper = parent_of(worker)
            assert parent_of(keeper) == server_of(executor).process.pid
            os.kill(keeper, signal.SIGKILL)
            ended = await watched.ended()
            assert (ended.reason, ended.signal) == ("lost", signal.SIGKILL)
            await until(lambda: not is_alive(worker))

    asyncio.run(go())


def test_one_with_too_much_memory_takes_no_other_along(tmp_path: Path) -> None:
    async def go() -> None:
        async with started(tmp_path) as executor:
            _, watched = submit(executor, tmp_path, spp=FOREVER)
            await watched.until("progress")
            _, other = submit(executor, tmp_path, spp=FOREVER, memory_bytes=50 * 2**20)
            ended = await other.ended()
            assert ended.reason == "memory-limit" or other.last["problem"]["type"] == "/problems/memory-limit"
            passes = len(watched.said("progress"))
            await until(lambda: len(watched.said("progress")) > passes)

    asyncio.run(go())


def test_no_zombies_are_left(tmp_path: Path) -> None:
    def below(pid: int) -> list[int]:
        return [int(word) for word in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]

    async def go() -> None:
        async with started(tmp_path) as executor:
            for _ in range(3):
                run, watched = submit(executor, tmp_path)
                await watched.ended()
                run.release()
            waiting = len(executor._warm)
            await until(lambda: len(below(server_of(executor).process.pid)) == waiting)

    asyncio.run(go())


def test_it_is_replaced_after_a_number_of_workers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fork_server, "REPLACED_AFTER", 4)

    async def go() -> None:
        async with started(tmp_path) as executor:
            before = server_of(executor).process
            for _ in range(3):
                _, watched = submit(executor, tmp_path)
                assert (await watched.ended()).exit_code == 0
            await until(lambda: server_of(executor).process is not before)
            _, watched = submit(executor, tmp_path)
            assert (await watched.ended()).exit_code == 0
            for worker in list(executor._warm.values()):
                worker.process.kill()
            await asyncio.wait_for(asyncio.shield(before.exit), SOON_S)

    asyncio.run(go())


def test_where_nothing_can_be_forked_workers_are_started_as_programs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    needs("bubblewrap")
    monkeypatch.setattr("primray_service.sandbox.bubblewrap.park", lambda *_: ["/bin/false"])

    async def go() -> None:
        async with started(tmp_path) as executor:
            assert executor.health()["fork_server"].startswith("off: a forked worker cannot enter the sandbox")
            assert executor.health()["ok"]
            _, watched = submit(executor, tmp_path)
            assert (await watched.ended()).exit_code == 0

    asyncio.run(go())


def test_a_sandbox_that_leaks_is_not_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A forked worker without Landlock and seccomp, though they are announced."""

    def without(*arguments: Any) -> dict[str, Any]:
        request = worker_fork(*arguments)
        request["plan"]["layers"] = ["rlimits"]
        return request

    monkeypatch.setattr(fork_server, "worker_fork", without)

    async def go() -> None:
        async with started(tmp_path, needs(*LANDLOCK)) as executor:
            assert "a forked worker can" in executor.health()["fork_server"]

    asyncio.run(go())


def test_what_is_imported_before_the_fork_starts_no_thread_and_is_all(tmp_path: Path) -> None:
    """Otherwise each worker would import the rest again."""
    (tmp_path / "room.usda").write_text(ROOM)
    program = """
import json, os, sys
from pathlib import Path
from primray_service.worker.fork_server import preload
preload(Path("warm.usda"))
threads, before = len(os.listdir("/proc/self/task")), set(sys.modules)
from primray.render import render
from primray.settings import RenderSettings
image = render("room.usda", RenderSettings(resolution=(16, 16), spp=2))
for name in ("room.exr", "room.png"):
    image.save(name)
print(json.dumps([threads, sorted(set(sys.modules) - before)]))
"""
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    found = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", program], cwd=tmp_path, env=environment, capture_output=True, check=True
    )
    assert json.loads(found.stdout.splitlines()[0]) == [1, []]


SERVER = """
import asyncio, sys
from pathlib import Path
from tests.service.executor.test_fork_server import server_of, started, submit
async def go():
    folder = Path(sys.argv[1])
    async with started(folder) as executor:
        run, watched = submit(executor, folder, spp=2**20)
        await watched.until("progress")
        print(run.pid, server_of(executor).process.pid, flush=True)
        await asyncio.sleep(60)
asyncio.run(go())
"""


def test_a_server_that_is_killed_takes_all_along(tmp_path: Path) -> None:
    server = subprocess.Popen([sys.executable, "-c", SERVER, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    assert server.stdout is not None
    worker, forks = (int(word) for word in server.stdout.readline().split())
    pids = [worker, forks, parent_of(worker)]
    os.kill(worker, signal.SIGSTOP)  # so it does not end by itself
    server.kill()
    server.wait()
    end = time.monotonic() + 20
    while any(is_alive(pid) for pid in pids):
        assert time.monotonic() < end, [pid for pid in pids if is_alive(pid)]
        time.sleep(0.02)
