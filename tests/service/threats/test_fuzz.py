"""Damaged files, sent to a real server and rendered where they can be: it goes on answering, every one comes to a known end,
nothing of the files outside is told, nothing is left running or lying about."""

from __future__ import annotations

import os
import threading
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from queue import Empty, Queue
from typing import Any

import pytest
from tests.service.serving import RunningServer
from tests.service.threats.fates import Canary, workers_of
from tests.service.threats.fuzz_corpus import Input, corpus

from primray_service.problems import KINDS

MiB = 2**20
LIMITS = {"check_cpu_s": 10.0, "load_cpu_s": 10.0, "memory_bytes": 1024 * MiB}
JOB = {"resolution": [24, 16], "stop": {"max_samples": 1}}
SENDERS = 4
END_S = 120.0


@dataclass
class Sent:
    ends: Counter[str] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)
    slowest_health_s: float = 0.0


def send_all(server: RunningServer, inputs: list[Input], canary: Canary) -> Sent:
    sent, waiting = Sent(), Queue[Input]()
    for each in inputs:
        waiting.put(each)

    def work() -> None:
        client = server.client()
        while True:
            try:
                each = waiting.get_nowait()
            except Empty:
                return
            try:
                end = end_of(client, each, canary)
            except Exception as error:
                end = f"error {type(error).__name__}: {error}"
            kind, _, slug = end.partition(" ")
            known = {"ready", "succeeded"} if not slug else {"refused", "rejected", "failed"}
            if kind not in known or (slug and (slug not in KINDS or slug in ("internal", "unavailable", "render-failed"))):
                sent.wrong.append(f"{each.name}: {end}")
            sent.ends[end] += 1

    threads = [threading.Thread(target=work) for _ in range(SENDERS)]
    for thread in threads:
        thread.start()
    client = server.client()
    while any(thread.is_alive() for thread in threads):
        began = time.perf_counter()
        assert client.get("/healthz").status_code == 200
        sent.slowest_health_s = max(sent.slowest_health_s, time.perf_counter() - began)
        time.sleep(0.1)
    return sent


def end_of(client: Any, each: Input, canary: Canary) -> str:
    said = []

    def heard(answer: Any) -> Any:
        said.append(answer.text)
        return answer.json()

    def slug(problem: dict[str, Any]) -> str:
        return str(problem["type"]).removeprefix("/problems/")

    scene = heard(client.post("/v1/scenes", content=each.data, params={"name": each.name}))
    if "type" in scene:
        end = f"refused {slug(scene)}"
    else:
        until = time.monotonic() + END_S
        while scene["state"] == "checking" and time.monotonic() < until:
            time.sleep(0.1)
            scene = heard(client.get(f"/v1/scenes/{scene['id']}"))
        end = scene["state"] if scene["state"] != "rejected" else f"rejected {slug(scene['problem'])}"
        if scene["state"] == "ready":
            end = job_end(client, scene, heard, slug)
    assert not any(canary.word in text for text in said)
    return end


def job_end(client: Any, scene: dict[str, Any], heard: Any, slug: Any) -> str:
    reference = {"id": scene["id"]} | ({"entry": scene["entries"][0]} if len(scene.get("entries", [])) > 1 else {})
    job = heard(client.post("/v1/jobs", json={"scene": reference, "settings": JOB}))
    if "type" in job:
        return f"refused {slug(job)}"
    until = time.monotonic() + END_S
    while job["state"] in ("queued", "preparing", "running") and time.monotonic() < until:
        job = heard(client.get(f"/v1/jobs/{job['id']}", headers={"prefer": "wait=10"}))
    heard_log = client.get(f"/v1/jobs/{job['id']}/log").text
    assert "Traceback (most recent" not in heard_log, heard_log[-2000:]
    return str(job["state"]) if job["state"] != "failed" else f"failed {slug(job['error'])}"


def hold(start_server: Any, tmp_path: Path, count: int, seed: int) -> Sent:
    server = start_server(limits=LIMITS)
    canary = Canary(tmp_path / f"canary-{seed}", server)
    before = len(os.listdir(f"/proc/{server.process.pid}/fd"))
    began = time.monotonic()
    sent = send_all(server, list(corpus(count, seed)), canary)
    print(f"{count} inputs in {time.monotonic() - began:.0f} s, slowest /healthz {1000 * sent.slowest_health_s:.0f} ms")
    for end, times in sent.ends.most_common():
        print(f"  {times:5d}  {end}")
    assert sent.wrong == [], sent.wrong[:20]
    assert server.process.poll() is None
    assert server.failures() == []
    assert os.listdir(server.data / "incoming") == []
    until = time.monotonic() + 20
    while (count_of_workers(server) > 3 or len(os.listdir(server.data / "slots")) > 5) and time.monotonic() < until:
        time.sleep(0.2)
    assert count_of_workers(server) <= 3, workers_of(server)
    assert len(os.listdir(server.data / "slots")) <= 5
    assert len(os.listdir(f"/proc/{server.process.pid}/fd")) < before + 40
    return sent


def count_of_workers(server: RunningServer) -> int:
    """By their interpreters: each may have a bubblewrap or two around it. Forked ones have a keeper each, and a fork server."""
    found = [command for command in workers_of(server) if "primray_service.worker" in command and "bwrap" not in command]
    forked = sum("fork_server" in command for command in found)
    return len(found) - forked + forked // 2


def test_twenty_damaged_files(start_server: Any, tmp_path: Path) -> None:
    sent = hold(start_server, tmp_path, 20, seed=1)
    assert len(sent.ends) > 2, "the damage is of many kinds"


@pytest.mark.long
def test_two_thousand_damaged_files(start_server: Any, tmp_path: Path) -> None:
    hold(start_server, tmp_path, int(os.environ.get("PRIMRAY_FUZZ", "2000")), seed=int(os.environ.get("PRIMRAY_SEED", "2")))


# What earlier runs found: (seed, number). An EXR whose channel has no name that is text; crates with names that are none,
# and with a prim that is not there.
FOUND = ((11, 131), (12, 7), (12, 163))


def test_what_was_found_before(start_server: Any, tmp_path: Path) -> None:
    server = start_server(limits=LIMITS)
    inputs = [next(each for each in corpus(number + 1, seed) if each.number == number) for seed, number in FOUND]
    sent = send_all(server, inputs, Canary(tmp_path / "canary-found", server))
    assert sent.wrong == []


def test_the_corpus_is_the_same_for_the_same_seed() -> None:
    first, again, other = (list(corpus(24, seed)) for seed in (1, 1, 2))
    assert first == again
    assert first != other
    assert len({each.data for each in first}) >= 22
