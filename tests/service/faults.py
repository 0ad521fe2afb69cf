"""Faults on purpose: jobs of all kinds over HTTP while the server, its workers and its database connections are killed.

    python -m tests.service.faults --kills 100 --database sqlite      (or postgresql)

First each job runs on a server that nobody disturbs. Then the same jobs run again and again until so many kills have been
made; every accepted one must be there, once, ended, and with the undisturbed picture's bits.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import json
import math
import os
import random
import signal
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx2

from primray_service.auth import LOCAL_TENANT
from primray_service.files import DataDirectory
from primray_service.jobs import TERMINAL, FrameState, JobState, Scene
from primray_service.store import open_store
from primray_service.store.base import JobFilter, Store

from . import serving
from .dispatcher.rig import put_scene
from .forked import ROOT
from .postgres import Server as PostgresServer
from .postgres import private_server
from .serving import RunningServer, start

SCENES = {name: ROOT / f"scenes/features/{name}/scene.usda" for name in ("glass", "time-code", "emission")}
LIMITS = {"checkpoint_every_s": 0.4, "free_disk_bytes": 0}
OUTPUTS_A_FRAME = 3
ANSWER_S = 600.0  # a machine that others use too takes its time to start a server


@dataclass(frozen=True)
class Spec:
    """A job, and the stop rules with which it is continued once it has ended."""

    name: str
    scene: str
    settings: dict[str, Any]
    then: dict[str, Any] | None = None
    parallel: int | None = None


def specs(weight: float) -> list[Spec]:
    """One of each kind; `weight` is how long they take, about seconds of one core."""
    n = max(16, int(64 * weight) // 8 * 8)
    return [
        Spec("samples", "glass", {"resolution": [96, 72], "seed": 1, "stop": {"max_samples": n}}),
        Spec("error", "glass", {"resolution": [64, 48], "seed": 2, "stop": {"target_error": 0.02 / weight}}),
        Spec("frames", "time-code", {"resolution": [96, 72], "frames": "1:3", "stop": {"max_samples": 2 * n}}),
        Spec(
            "continued",
            "emission",
            {"resolution": [96, 72], "seed": 3, "stop": {"max_samples": n}},
            then={"max_samples": 2 * n},
        ),
    ]


@dataclass(frozen=True)
class Database:
    """`kill_connections` is None where there are none."""

    url: str | None
    kill_connections: Callable[[], int] | None


@dataclass(frozen=True)
class Disturbance:
    """`act` says whether there was something to kill; `weight`: how often it is chosen, against the others."""

    name: str
    weight: int
    act: Callable[[Service, random.Random], bool]


def disturbances(database: Database) -> list[Disturbance]:
    """Of a server that renders itself."""
    found = [Disturbance("server", 2, lambda service, _: service.kill()), Disturbance("worker", 4, Service.kill_worker)]
    return found + lost_connections(database)


def lost_connections(database: Database) -> list[Disturbance]:
    kill = database.kill_connections
    return [] if kill is None else [Disturbance("connection", 3, lambda _, __: kill() > 0)]


@contextlib.contextmanager
def database(kind: str, server: PostgresServer | None = None) -> Iterator[Callable[[], Database]]:
    """Makes fresh ones."""
    if kind == "sqlite":
        yield lambda: Database(None, None)
        return
    with contextlib.ExitStack() as stack:
        running = server or stack.enter_context(private_server())

        def make() -> Database:
            name = running.new_database()
            return Database(running.url_of(name), lambda: running.kill_connections(name))

        yield make


class Service:
    """The server of a data directory, started again when it was killed. Requests are repeated until they are answered."""

    def __init__(self, folder: Path, database: Database, settings: Mapping[str, Any] | None = None) -> None:
        self.data = DataDirectory(folder / "data")
        self.data.create()
        self._settings: dict[str, Any] = {"slots": 1, "allow_unsandboxed": True, "limits": LIMITS, "log_json": False}
        self._settings.update(settings or {})
        if database.url is not None:
            self._settings["database"] = database.url
        self.url = database.url or f"sqlite:///{self.data.root / 'primray.sqlite'}"
        serving.START_S = 180.0
        self.server: RunningServer = start(self.data.root, **self._settings)

    def kill(self) -> bool:
        self.server.process.kill()
        self.server.process.wait()
        self.server = start(self.data.root, **self._settings)
        return True

    def kill_worker(self, chance: random.Random) -> bool:
        workers = descendants(self.server.process.pid)
        if workers:
            with contextlib.suppress(ProcessLookupError):
                os.kill(chance.choice(workers), signal.SIGKILL)
                return True
        return False

    def ask(self, method: str, path: str, **options: Any) -> httpx2.Response:
        """Whatever happens to the server meanwhile."""
        until = time.monotonic() + ANSWER_S
        while time.monotonic() < until:
            try:
                with httpx2.Client(base_url=self.server.url, timeout=10, trust_env=False, verify=False) as client:
                    answer = client.request(method, path, **options)
                if answer.status_code < 500:
                    return answer
            except httpx2.TransportError:
                pass
            time.sleep(0.2)
        raise AssertionError(f"{method} {path} was never answered; the server's log:\n{self.server.log.read_text()[-1500:]}")

    def stop(self) -> None:
        self.server.stop()


def descendants(pid: int) -> list[int]:
    """Workers below a process, the innermost of each wrapping."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError, ProcessLookupError):
            fields = stat.read_text().rsplit(")", 1)[1].split()
            found.append((int(stat.parent.name), int(fields[1])))
    children: dict[int, list[int]] = {}
    for child, parent in found:
        children.setdefault(parent, []).append(child)
    below, todo = [], [pid]
    while todo:
        of = children.get(todo.pop(), [])
        below += of
        todo += of
    return [child for child in below if b"primray_service.worker" in _command(child)]


def _command(pid: int) -> bytes:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""


@dataclass
class Submitted:
    """An accepted job."""

    spec: Spec
    id: str
    key: str


def put_scenes(store: Store, data: DataDirectory) -> dict[str, Scene]:
    """As if they had been checked; what is disturbed here is rendering."""
    return {name: put_scene(store, data, path.read_bytes(), LOCAL_TENANT, ready=True) for name, path in SCENES.items()}


def submit(service: Service, spec: Spec, scene: Scene, key: str) -> Submitted:
    """Once, however often it takes."""
    body: dict[str, Any] = {"scene": {"id": scene.id}, "settings": spec.settings}
    if spec.parallel is not None:
        body["parallel"] = spec.parallel
    answer = service.ask("POST", "/v1/jobs", json=body, headers={"Idempotency-Key": key})
    assert answer.status_code in (200, 202), answer.text
    return Submitted(spec, answer.json()["id"], key)


def follow(service: Service, job: Submitted, timeout_s: float) -> dict[str, Any]:
    """Until its end, with what is done after its first one."""
    until = time.monotonic() + timeout_s
    continued = job.spec.then is None
    while time.monotonic() < until:
        document: dict[str, Any] = service.ask("GET", f"/v1/jobs/{job.id}").json()
        if JobState(document["state"]) in TERMINAL:
            if continued or document["attempt"] == 2 or document["state"] != "succeeded":
                return document
            answer = service.ask("POST", f"/v1/jobs/{job.id}/continue", json={"stop": job.spec.then})
            # 409: an earlier try was heard, though its answer was lost.
            assert answer.status_code in (200, 202, 409), answer.text
            continued = True
        time.sleep(0.1)
    raise AssertionError(f"{job.spec.name} {job.id} has not ended: {document}")


@dataclass
class Made:
    """What a job made, as the database and the disk have it."""

    pixels: dict[int, str]
    samples: int
    files: dict[str, str]  # the pictures' digests; the report tells times too


def made(store: Store, data: DataDirectory, job_id: str) -> Made:
    """Checks on the way that all of it is there, once."""
    job = store.job(job_id)
    assert job is not None, f"{job_id} is lost"
    assert job.state is JobState.SUCCEEDED, f"{job_id} is {job.state}: {job.error}"
    frames = store.frames(job_id)
    assert all(frame.state is FrameState.SUCCEEDED for frame in frames)
    assert job.result is not None
    rows = store.outputs(job_id)
    assert len(rows) == OUTPUTS_A_FRAME * len(frames), f"{job_id} has {len(rows)} outputs"
    on_disk = {path.name for path in data.outputs(job_id).iterdir()}
    assert on_disk == {row.name for row in rows}, f"{job_id}: {on_disk}"
    for row in rows:
        digest = hashlib.sha256((data.outputs(job_id) / row.name).read_bytes()).hexdigest()
        assert digest == row.sha256, f"{job_id}: {row.name} is not what its row says"
    for frame in frames:
        kept = {path.name for path in data.frame(job_id, frame.number).glob("[co]*")}
        assert kept == {Path(frame.checkpoint_file).name}, f"{job_id}: {kept}"
    events = store.events(job_id, 0, 100_000)
    ends = [event for event in events if event.type == "end"]
    assert len(ends) == job.attempt, f"{job_id} ended {len(ends)} times in {job.attempt} attempts"
    succeeded = Counter(
        (event.data["attempt"], event.data["frame"])
        for event in events
        if event.type == "frame" and event.data["state"] == "succeeded"
    )
    assert set(succeeded.values()) == {1}, f"{job_id}: {succeeded}"
    assert len(succeeded) == job.attempt * len(frames)
    return Made(
        {frame.number: str((frame.result or {})["pixels_sha256"]) for frame in frames},
        int(job.result["samples"]),
        {row.name: row.sha256 for row in rows if not row.name.endswith(".json")},
    )


@dataclass
class Findings:
    jobs: int = 0
    kills: Counter[str] = field(default_factory=Counter)
    attempts: Counter[str] = field(default_factory=Counter)  # runs of frames that were queued again
    wrong: list[str] = field(default_factory=list)
    seconds: float = 0.0

    def as_json(self) -> dict[str, Any]:
        return {"jobs": self.jobs, "kills": dict(self.kills), "wrong": self.wrong, "seconds": round(self.seconds, 1)}


class Moments:
    """When to kill: at any time, but for every other kill not before something was merged since the last. On a machine that is
    so slow that nothing is merged between kills, a study would never end and find nothing."""

    def __init__(self, store: Store, chance: random.Random, every_s: float) -> None:
        self._store = store
        self._chance = chance
        self._every_s = every_s

    def wait(self) -> None:
        if self._chance.random() < 0.5:
            before, until = self._merged(), time.monotonic() + 60
            while self._merged() == before and time.monotonic() < until:
                time.sleep(0.05)
        time.sleep(self._chance.expovariate(1 / self._every_s))

    def _merged(self) -> int:
        """A number that grows with every checkpoint and every job."""
        jobs = self._store.jobs(LOCAL_TENANT, JobFilter(), 200, None).items
        live = [job for job in jobs if job.state not in TERMINAL]
        checkpoints = sum(frame.checkpoint for job in live for frame in self._store.frames(job.id))
        return 1_000_000 * (len(jobs) - len(live)) + checkpoints


def undisturbed(folder: Path, new_database: Callable[[], Database], jobs: Sequence[Spec]) -> dict[str, Made]:
    service = Service(folder, new_database())
    store = open_store(service.url)
    try:
        scenes = put_scenes(store, service.data)
        running = [submit(service, spec, scenes[spec.scene], spec.name) for spec in jobs]
        for job in running:
            follow(service, job, 1800)
        return {job.spec.name: made(store, service.data, job.id) for job in running}
    finally:
        store.close()
        service.stop()


def disturbed(
    folder: Path,
    database: Database,
    jobs: Sequence[Spec],
    expected: dict[str, Made],
    *,
    kills: int,
    seed: int,
    every_s: float,
    most_s: float = math.inf,
    at_a_time: int = 4,
    kinds: Sequence[Disturbance] | None = None,
    settings: Mapping[str, Any] | None = None,
) -> Findings:
    """Jobs are submitted as long as there are kills to be made."""
    chance, found, began = random.Random(seed), Findings(), time.monotonic()
    service = Service(folder, database, settings)
    store = open_store(service.url)
    scenes = put_scenes(store, service.data)
    accepted: list[Submitted] = []
    ended, failures, over = set[str](), list[BaseException](), threading.Event()

    def client(number: int) -> None:
        turn = number
        try:
            while not over.is_set() or turn == number:
                spec = jobs[turn % len(jobs)]
                job = submit(service, spec, scenes[spec.scene], f"{number}-{turn}")
                accepted.append(job)
                follow(service, job, 1800)
                ended.add(job.id)
                turn += at_a_time + 1
        except BaseException as error:
            failures.append(error)
            raise

    kinds = disturbances(database) if kinds is None else kinds
    clients = [threading.Thread(target=client, args=(number,), daemon=True) for number in range(at_a_time)]
    for thread in clients:
        thread.start()
    moments = Moments(store, chance, every_s)
    while sum(found.kills.values()) < kills and not failures and time.monotonic() - began < most_s:
        moments.wait()
        [what] = chance.choices(kinds, [kind.weight for kind in kinds])
        if not what.act(service, chance):
            continue
        found.kills[what.name] += 1
        print(f"{time.monotonic() - began:6.0f} s: {what.name}, {len(ended)} jobs have ended", file=sys.stderr, flush=True)
    over.set()
    for thread in clients:
        thread.join()
    if failures:
        raise failures[0]
    found.jobs = len(accepted)
    found.wrong += differences(store, service.data, accepted, expected)
    service.stop()
    store.close()
    found.wrong += [f"process {pid} is left" for pid in left_over(service.data.root)]
    found.seconds = time.monotonic() - began
    return found


def differences(store: Store, data: DataDirectory, accepted: list[Submitted], expected: dict[str, Made]) -> list[str]:
    wrong = []
    ids = [job.id for job in accepted]
    if len(set(ids)) != len(ids):
        wrong.append("two submissions were answered with one job")
    there = sum(store.counts().values())
    if there != len(ids):
        wrong.append(f"{len(ids)} jobs were accepted, {there} are there")
    for job in accepted:
        try:
            found = made(store, data, job.id)
        except AssertionError as error:
            wrong.append(f"{job.spec.name}: {error}")
            continue
        wrong += [
            f"{job.spec.name} {job.id}: other {name}"
            for name in ("pixels", "samples")
            if getattr(found, name) != getattr(expected[job.spec.name], name)
        ]
    return wrong


def left_over(root: Path) -> list[int]:
    """Workers of a data directory that outlived their servers; they are given a moment."""
    found: list[int] = []
    for _ in range(50):
        found = [
            int(path.parent.name)
            for path in Path("/proc").glob("[0-9]*/cmdline")
            if b"primray_service.worker" in _command(int(path.parent.name))
            and str(root).encode() in _command(int(path.parent.name))
        ]
        if not found:
            break
        time.sleep(0.1)
    return found


def study(
    kind: str,
    *,
    kills: int,
    seed: int,
    weight: float,
    every_s: float,
    most_s: float = math.inf,
    server: PostgresServer | None = None,
) -> Findings:
    jobs = specs(weight)
    with tempfile.TemporaryDirectory(prefix="primray-faults-") as folder, database(kind, server) as new_database:
        expected = undisturbed(Path(folder) / "undisturbed", new_database, jobs)
        return disturbed(
            Path(folder) / "disturbed", new_database(), jobs, expected, kills=kills, seed=seed, every_s=every_s, most_s=most_s
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--database", choices=["sqlite", "postgresql"], default="sqlite")
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--weight", type=float, default=4.0, help="how long jobs take")
    parser.add_argument("--every", type=float, default=1.5, help="mean seconds between kills")
    parser.add_argument("--most-seconds", type=float, default=math.inf, help="no kills later than this")
    asked = parser.parse_args()
    found = study(
        asked.database,
        kills=asked.kills,
        seed=asked.seed,
        weight=asked.weight,
        every_s=asked.every,
        most_s=asked.most_seconds,
    )
    print(json.dumps({"database": asked.database, "seed": asked.seed} | found.as_json(), indent=1))
    sys.exit(bool(found.wrong))


if __name__ == "__main__":
    main()
