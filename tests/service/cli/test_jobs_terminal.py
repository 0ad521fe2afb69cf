"""What the commands show on a terminal, and how Ctrl-C ends them."""

from __future__ import annotations

import json
import os
import pty
import re
import select
import signal
import subprocess
import sys
import threading
import time

import pytest
from tests.service.client.scripted import Answer, Request, as_json, serving

JOB = {"id": "job_1", "state": "running", "created_at": "2026-01-01T00:00:00Z", "scene": {"id": "sha256:0"}}
PROGRESS = {
    "fraction": 0.42,
    "phase": "sampling",
    "error": {"metric": "relmse", "estimate": 0.021, "target": 0.01, "kind": "estimated"},
    "frames": {"total": 3, "succeeded": 1, "queued": 1, "running": 1, "failed": 0, "canceled": 0},
    "eta_s": 75.0,
}


NONE_YET = as_json({"items": [], "next_after": 0, "ended": False})


def event(number: int, type: str, data: object) -> str:
    return f"id: {number}\nevent: {type}\ndata: {json.dumps(data)}\n\n"


def start(*arguments: str, stderr: int, **environment: str) -> subprocess.Popen[bytes]:
    clean = {name: value for name, value in os.environ.items() if not name.startswith("PRIMRAY_")}
    command = [sys.executable, "-c", "import primray.cli; primray.cli.main()", *arguments]
    return subprocess.Popen(
        command, env=clean | {"TERM": "xterm", "COLUMNS": "120"} | environment, stdout=subprocess.PIPE, stderr=stderr
    )


def read_until(handle: int, text: str, timeout_s: float = 60.0) -> str:
    seen, until = b"", time.monotonic() + timeout_s
    while text not in plain(seen) and time.monotonic() < until:
        if select.select([handle], [], [], 0.1)[0]:
            try:
                seen += os.read(handle, 65536)
            except OSError:  # the terminal's other end is closed
                break
    assert text in plain(seen), plain(seen)
    return plain(seen)


def plain(shown: bytes) -> str:
    return re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", shown.decode("utf-8", "replace"))


def test_a_bar_on_a_terminal() -> None:
    streamed = (
        event(1, "state", {"state": "running"})
        + event(2, "progress", PROGRESS)
        + event(3, "end", {"state": "succeeded", "attempt": 1})
    )

    def script(request: Request) -> Answer:
        if "json" in request.headers["Accept"] and request.path.endswith("/events"):
            return NONE_YET
        if request.path.endswith("/events"):
            return Answer(200, streamed.encode(), {"Content-Type": "text/event-stream", "Connection": "close"})
        return as_json({**JOB, "state": "succeeded", "progress": PROGRESS})

    ours, theirs = pty.openpty()
    with serving(script) as server:
        process = start("watch", "job_1", stderr=theirs, PRIMRAY_SERVER=server.url)
        os.close(theirs)
        shown = read_until(ours, "job_1 succeeded")
        assert process.wait(20) == 0
        assert process.stdout is not None
        assert process.stdout.read() == b""
        process.stdout.close()
    os.close(ours)
    assert "42%" in shown
    assert "1/3 frames  relmse 0.021, target 0.01" in shown


def test_the_last_line_counts_the_frames_of_the_job_that_ended() -> None:
    streamed = event(1, "progress", PROGRESS) + event(2, "end", {"state": "succeeded", "attempt": 1})
    all_done = PROGRESS | {"fraction": 1.0, "frames": {"total": 3, "succeeded": 3}}

    def script(request: Request) -> Answer:
        if "json" in request.headers["Accept"] and request.path.endswith("/events"):
            return NONE_YET
        if request.path.endswith("/events"):
            return Answer(200, streamed.encode(), {"Content-Type": "text/event-stream", "Connection": "close"})
        state = "running" if len(server.requests) < 3 else "succeeded"
        return as_json({**JOB, "state": state, "progress": PROGRESS if state == "running" else all_done})

    with serving(script) as server:
        process = start("watch", "job_1", stderr=subprocess.PIPE, PRIMRAY_SERVER=server.url)
        _, shown = process.communicate(timeout=60)
    lines = [line for line in shown.decode().splitlines() if "succeeded" in line]
    assert lines[0].startswith("job_1 succeeded: 3/3 frames")


def test_what_is_over_is_not_shown_as_if_it_were_now() -> None:
    """Two pages of events are over when the watching begins: only the job's state now, and what follows, is shown."""
    after: list[str | None] = []
    warning = {"code": "c", "detail": "d", "severity": "warning"}

    def script(request: Request) -> Answer:
        if "/events" in request.path and "json" in request.headers["Accept"]:
            page = {"": [1, 2], "?after=2": [3], "?after=3": []}[request.path.partition("/events")[2]]
            items = [{"id": number, "type": "state", "data": {"state": "queued"}} for number in page]
            return as_json({"items": items, "next_after": page[-1] if page else 3, "ended": False})
        if "/events" in request.path:
            after.append(request.headers.get("Last-Event-ID"))
            streamed = event(4, "end", {"state": "succeeded", "attempt": 1})
            return Answer(200, streamed.encode(), {"Content-Type": "text/event-stream", "Connection": "close"})
        state = "succeeded" if after else "running"
        return as_json({**JOB, "state": state, "progress": PROGRESS, "warnings": [warning]})

    with serving(script) as server:
        process = start("watch", "job_1", stderr=subprocess.PIPE, PRIMRAY_SERVER=server.url)
        _, shown = process.communicate(timeout=60)
    assert after == ["3"]
    lines = [line for line in shown.decode().splitlines() if line.startswith(("job_1", "warning"))]
    assert [line.split(":")[0] for line in lines] == ["warning", "job_1 running", "job_1 succeeded", "job_1 succeeded"]


@pytest.mark.parametrize("as_json_lines", [False, True])
def test_ctrl_c_ends_the_watching_and_not_the_job(as_json_lines: bool) -> None:
    released = threading.Event()

    def script(request: Request) -> Answer:
        if "json" in request.headers["Accept"] and request.path.endswith("/events"):
            return NONE_YET
        if request.path.endswith("/events") and "Last-Event-ID" in request.headers:
            released.wait(20)
        if request.path.endswith("/events"):
            text = event(1, "state", {"state": "running"})
            return Answer(200, text.encode(), {"Content-Type": "text/event-stream", "Connection": "close"})
        return as_json(JOB)

    with serving(script) as server:
        process = start("watch", "job_1", *["--json"] * as_json_lines, stderr=subprocess.PIPE, PRIMRAY_SERVER=server.url)
        until = time.monotonic() + 20
        while not any("Last-Event-ID" in request.headers for request in server.requests) and time.monotonic() < until:
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=20)
        released.set()
    assert process.returncode == 130
    assert b"the job continues: `primray watch job_1`" in err
    assert b"Traceback" not in err
    assert all(method == "GET" for method in (request.method for request in server.requests))
    if as_json_lines:
        assert json.loads(out.splitlines()[-1])["exit_code"] == 130
