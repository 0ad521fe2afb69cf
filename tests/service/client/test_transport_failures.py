"""The client where a server or the way to it fails: what is tried again, what is not, and that nothing is done twice."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import pytest

from primray_service.client import (
    Client,
    DigestMismatch,
    Event,
    Job,
    Output,
    ProblemError,
    ServerUnreachable,
    TimedOut,
    UnexpectedAnswer,
)
from primray_service.client import client as client_module

from .scripted import BROKEN, Answer, Request, Scripted, as_json, problem, serving

JOB = {"id": "job_1", "state": "queued", "created_at": "2026-01-01T00:00:00.000Z", "scene": {"id": "sha256:" + "0" * 64}}
DONE = {**JOB, "state": "succeeded"}


class Sleeps(list[float]):
    def __call__(self, seconds: float) -> None:
        self.append(seconds)


@pytest.fixture
def sleeps() -> Sleeps:
    return Sleeps()


def client_of(server: Scripted, sleeps: Sleeps, **options: Any) -> Client:
    return Client(server.url, sleep=sleeps, **options)


def test_a_refusal_is_waited_out_as_long_as_the_server_asks(sleeps: Sleeps) -> None:
    with serving([problem("too-many-requests", 429, Retry_After="7"), problem("unavailable", 503), as_json(DONE)]) as server:
        assert client_of(server, sleeps).job("job_1").state == "succeeded"
    assert sleeps[0] == 7
    assert 0.25 <= sleeps[1] <= 0.5
    assert len(server.requests) == 3


def test_a_wait_that_is_too_long_is_the_callers_to_decide(sleeps: Sleeps) -> None:
    with serving([problem("quota-exceeded", 429, Retry_After="7200")]) as server, pytest.raises(ProblemError) as caught:
        client_of(server, sleeps).job("job_1")
    assert (caught.value.slug, caught.value.retry_after_s, sleeps) == ("quota-exceeded", 7200, [])


def test_a_problem_that_is_not_retryable_is_raised_at_once(sleeps: Sleeps) -> None:
    full = {"type": "/problems/quota-exceeded", "status": 429, "detail": "full", "retryable": False}
    waits: list[float] = []
    with serving([problem("unavailable", 503), as_json(full, 429)]) as server, pytest.raises(ProblemError) as caught:
        client_of(server, sleeps, on_wait=lambda problem, wait_s: waits.append(wait_s)).job("job_1")
    assert (caught.value.slug, len(server.requests), len(sleeps)) == ("quota-exceeded", 2, 1)
    assert waits == sleeps, "the one that is waited for is reported"


def test_tries_end(sleeps: Sleeps) -> None:
    with serving(lambda request: problem("unavailable", 503)) as server, pytest.raises(ProblemError):
        client_of(server, sleeps, retries=3).job("job_1")
    assert len(server.requests) == 4
    assert sleeps == sorted(sleeps)


def test_a_submit_whose_answer_was_lost_is_the_same_job(sleeps: Sleeps) -> None:
    with serving([BROKEN, BROKEN, as_json(JOB, 202)]) as server:
        assert client_of(server, sleeps).submit("sha256:" + "0" * 64, labels={"shot": "010"}).id == "job_1"
    keys = {request.headers["Idempotency-Key"] for request in server.requests}
    assert len(server.requests) == 3
    assert len(keys) == 1
    assert len({request.body for request in server.requests}) == 1


def test_two_submits_are_two_jobs(sleeps: Sleeps) -> None:
    with serving([as_json(JOB, 202)] * 2) as server:
        for _ in range(2):
            client_of(server, sleeps).submit("sha256:" + "0" * 64)
    assert len({request.headers["Idempotency-Key"] for request in server.requests}) == 2


def test_what_the_server_would_do_twice_is_not_repeated(sleeps: Sleeps) -> None:
    with serving([BROKEN]) as server, pytest.raises(ServerUnreachable):
        client_of(server, sleeps).continue_("job_1", {"target_error": 0.001})
    assert len(server.requests) == 1
    with serving([problem("unavailable", 503), as_json(JOB, 202)]) as server:  # refused: it was not carried out
        assert client_of(server, sleeps).continue_("job_1", {"target_error": 0.001}).state == "queued"


def test_a_deletion_whose_answer_was_lost_is_done(sleeps: Sleeps) -> None:
    with serving([BROKEN, problem("not-found", 404)]) as server:
        client_of(server, sleeps).delete("job_1")
    with serving([problem("not-found", 404)]) as server, pytest.raises(ProblemError):
        client_of(server, sleeps).delete("job_1")


def test_nobody_there(sleeps: Sleeps) -> None:
    with serving([]) as server:
        pass
    with pytest.raises(ServerUnreachable, match=r"no answer from http://127\.0\.0\.1:\d+"):
        client_of(server, sleeps, retries=2).job("job_1")
    assert len(sleeps) == 2


@pytest.mark.parametrize(
    "answer",
    [
        Answer(200, b"<html>a router's page</html>", {"Content-Type": "text/html"}),
        Answer(404, b"not here", {"Content-Type": "text/plain"}),
        Answer(302, b"", {"Location": "http://169.254.169.254/"}),
        as_json({"id": 5, "state": "queued"}),
        as_json([1, 2]),
        as_json({**JOB, "created_at": "yesterday"}),
        as_json({**JOB, "progress": {"fraction": "half"}}),
    ],
)
def test_another_server_is_recognised(answer: Answer, sleeps: Sleeps) -> None:
    with serving([answer]) as server, pytest.raises(UnexpectedAnswer):
        client_of(server, sleeps).job("job_1")
    assert len(server.requests) == 1


def test_a_problem_is_told_whole(sleeps: Sleeps) -> None:
    with serving([problem("unauthenticated", 401)]) as server, pytest.raises(ProblemError) as caught:
        client_of(server, sleeps, key="pk_1").job("job_1")
    assert (caught.value.status, caught.value.slug, caught.value.detail) == (401, "unauthenticated", "about unauthenticated")
    assert server.requests[0].headers["Authorization"] == "Bearer pk_1"


def test_ids_do_not_lead_elsewhere(sleeps: Sleeps) -> None:
    with serving(lambda request: problem("not-found", 404)) as server:
        for id in ("../keys", "a?b=c", "a/cancel"):
            with pytest.raises(ProblemError):
                client_of(server, sleeps).job(id)
    assert server.asked == ["GET /v1/jobs/..%2Fkeys", "GET /v1/jobs/a%3Fb%3Dc", "GET /v1/jobs/a%2Fcancel"]


def test_an_upload_that_the_server_has_is_not_sent(tmp_path: Path, sleeps: Sleeps) -> None:
    file = tmp_path / "shot.usda"
    file.write_bytes(b"#usda 1.0\n")
    scene_id = f"sha256:{hashlib.sha256(file.read_bytes()).hexdigest()}"
    with serving([as_json({}), as_json({"id": scene_id, "state": "ready"})]) as server:
        assert client_of(server, sleeps).upload(file).state == "ready"
    assert server.asked == [f"HEAD /v1/scenes/{scene_id}", f"GET /v1/scenes/{scene_id}"]


def test_an_upload_that_broke_off_is_sent_again(tmp_path: Path, sleeps: Sleeps) -> None:
    file = tmp_path / "shot.usda"
    file.write_bytes(b"#usda 1.0\n" * 100_000)
    shown: list[tuple[int, int]] = []
    with serving([problem("not-found", 404), BROKEN, as_json({"id": "sha256:1", "state": "checking"}, 201)]) as server:
        client_of(server, sleeps).upload(file, show=lambda done, of: shown.append((done, of)))
    _, first, second = server.requests
    assert first.body == second.body == file.read_bytes()
    assert second.path == "/v1/scenes?name=shot.usda"
    assert second.headers["Repr-Digest"].startswith("sha-256=:")
    assert second.headers["Content-Length"] == "1000000"
    assert shown[-1] == (1_000_000, 1_000_000)


def test_waiting_polls_long_and_sees_each_state_once(sleeps: Sleeps) -> None:
    running = {**JOB, "state": "running", "progress": {"fraction": 0.5, "eta_ci95": [3, 4], "new": 1}}
    script = [as_json(JOB, ETag='"1"'), Answer(304), as_json(running, ETag='"2"'), as_json(DONE, ETag='"3"')]
    seen: list[Job] = []
    with serving(script) as server:
        job = client_of(server, sleeps).wait("job_1", on_change=seen.append)
    assert job.state == "succeeded"
    assert [each.state for each in seen] == ["queued", "running"]
    assert seen[1].progress.eta_ci95 == (3.0, 4.0)
    assert [request.headers.get("If-None-Match") for request in server.requests] == [None, '"1"', '"1"', '"2"']
    assert server.requests[0].headers["Prefer"] == "wait=30"


def test_waiting_ends_when_it_should(sleeps: Sleeps) -> None:
    with serving(lambda request: as_json(JOB)) as server, pytest.raises(TimedOut):
        client_of(server, sleeps).wait("job_1", timeout_s=0.05)


def stream(*events: tuple[int, str, Any], cut: bool = False, before: str = "") -> Answer:
    text = before + "".join(f"id: {id}\nevent: {type}\ndata: {json.dumps(data)}\n\n" for id, type, data in events)
    body = text.encode()
    return Answer(200, body[:-9] if cut else body, {"Content-Type": "text/event-stream", "Connection": "close"})


def test_events_go_on_where_they_broke_off(sleeps: Sleeps) -> None:
    """In the middle of an event, too; comments and events without a number are none."""
    events: list[tuple[int, str, Any]] = [
        (3, "state", {"state": "running"}),
        (7, "progress", {"fraction": 0.5}),
        (9, "end", {"state": "succeeded"}),
    ]
    streams = [stream(*events[:2], cut=True, before="retry: 100\n: hello\n\n"), BROKEN, stream(*events[1:])]

    def script(request: Request) -> Answer:
        return streams.pop(0) if request.path.endswith("/events") else as_json(DONE if not streams else JOB)

    with serving(script) as server:
        seen = list(client_of(server, sleeps).watch("job_1"))
    assert seen == [Event(*event) for event in events]
    asked = [request for request in server.requests if request.path.endswith("/events")]
    assert [request.headers.get("Last-Event-ID") for request in asked] == [None, "3", "3"]
    assert sleeps[0] == 0.1


def test_an_earlier_attempts_end_is_not_the_last(sleeps: Sleeps) -> None:
    events = [(1, "end", {"attempt": 1}), (2, "state", {"state": "queued"}), (3, "end", {"attempt": 2})]

    def script(request: Request) -> Answer:
        return stream(*events) if request.path.endswith("/events") else as_json({**DONE, "attempt": 2})

    with serving(script) as server:
        assert [event.id for event in client_of(server, sleeps).watch("job_1")] == [1, 2, 3]


def test_a_job_of_which_nothing_more_will_be_heard(sleeps: Sleeps) -> None:
    with serving([Answer(204)]) as server:
        assert list(client_of(server, sleeps).watch("job_1", after=9)) == []
    assert server.requests[0].headers["Last-Event-ID"] == "9"


def test_a_stream_that_is_never_there_is_given_up(sleeps: Sleeps) -> None:
    with serving(lambda request: problem("unavailable", 503)) as server, pytest.raises(ProblemError):
        list(client_of(server, sleeps, retries=2).watch("job_1"))
    with serving(lambda request: problem("not-found", 404)) as server, pytest.raises(ProblemError):
        list(client_of(server, sleeps).watch("job_1"))
    assert len(server.requests) == 1


def test_lines_of_json_end_at_line_feeds_only(sleeps: Sleeps) -> None:
    text = 'id: 1\r\nevent: warning\r\ndata: {"detail": "a\u2028b\x85c"}\r\n\r\n'
    with serving(
        [Answer(200, text.encode(), {"Content-Type": "text/event-stream", "Connection": "close"}), as_json(DONE), Answer(204)]
    ) as server:
        (event,) = client_of(server, sleeps).watch("job_1")
    assert event.data == {"detail": "a\u2028b\x85c"}


PICTURE = bytes(range(256)) * 4000
PICTURE_OUTPUT = Output("beauty.0001.exr", len(PICTURE), hashlib.sha256(PICTURE).hexdigest(), "image/x-exr", 0)


def ranged(request: Request, content: bytes = PICTURE, cut: int | None = None) -> Answer:
    """As a server with ranges answers; so many bytes of it arrive."""
    asked = request.headers.get("Range")
    if asked is None:
        return Answer(200, content, {"ETag": f'"{PICTURE_OUTPUT.sha256}"'}, cut)
    first = int(asked.removeprefix("bytes=").removesuffix("-"))
    return Answer(206, content[first:], {"Content-Range": f"bytes {first}-{len(content) - 1}/{len(content)}"}, cut)


def test_a_download_goes_on_where_it_broke_off(tmp_path: Path, sleeps: Sleeps) -> None:
    cuts = iter([300_000, 400_000, None])
    with serving(lambda request: ranged(request, cut=next(cuts))) as server:
        file = client_of(server, sleeps).download("job_1", PICTURE_OUTPUT, tmp_path)
    assert file == tmp_path / "beauty.0001.exr"
    assert file.read_bytes() == PICTURE
    ranges = [request.headers.get("Range") for request in server.requests]
    assert ranges[0] is None
    assert len(ranges) == 3
    assert all(text is not None and text > "bytes=0-" for text in ranges[1:])
    assert server.requests[1].headers["If-Range"] == f'"{PICTURE_OUTPUT.sha256}"'
    assert [path.name for path in tmp_path.iterdir()] == ["beauty.0001.exr"]


def test_what_an_earlier_command_left_is_gone_on_with(tmp_path: Path, sleeps: Sleeps) -> None:
    with serving(lambda request: ranged(request, cut=500_000)) as server, pytest.raises(ServerUnreachable):
        client_of(server, sleeps, retries=0).download("job_1", PICTURE_OUTPUT, tmp_path)
    with serving(ranged) as server:
        file = client_of(server, sleeps).download("job_1", PICTURE_OUTPUT, tmp_path)
    assert file.read_bytes() == PICTURE
    assert "Range" in server.requests[0].headers


def test_what_is_there_already_is_not_asked_for(tmp_path: Path, sleeps: Sleeps) -> None:
    (tmp_path / "beauty.0001.exr").write_bytes(PICTURE)
    with serving([]) as server:
        client_of(server, sleeps).download("job_1", PICTURE_OUTPUT, tmp_path)
    assert server.requests == []


def test_another_file_is_not_replaced_unless_asked_for(tmp_path: Path, sleeps: Sleeps) -> None:
    file = tmp_path / "beauty.0001.exr"
    file.write_bytes(b"mine")
    with serving(ranged) as server:
        with pytest.raises(FileExistsError):
            client_of(server, sleeps).download("job_1", PICTURE_OUTPUT, tmp_path)
        assert server.requests == []
        assert file.read_bytes() == b"mine"
        client_of(server, sleeps).download("job_1", PICTURE_OUTPUT, tmp_path, overwrite=True)
    assert file.read_bytes() == PICTURE


def test_a_download_is_written_through_a_link(tmp_path: Path, sleeps: Sleeps) -> None:
    kept, file = tmp_path / "kept" / "real.exr", tmp_path / "beauty.0001.exr"
    file.symlink_to(kept)
    with serving(ranged) as server:
        client_of(server, sleeps).download("job_1", PICTURE_OUTPUT, tmp_path)
    assert file.is_symlink()
    assert kept.read_bytes() == PICTURE


def test_damaged_bytes_are_found_and_fetched_anew(tmp_path: Path, sleeps: Sleeps) -> None:
    part = tmp_path / f"beauty.0001.exr.{PICTURE_OUTPUT.sha256[:16]}.part"
    part.write_bytes(b"\0" * 1000)
    with serving(ranged) as server:
        file = client_of(server, sleeps).download("job_1", PICTURE_OUTPUT, tmp_path)
    assert file.read_bytes() == PICTURE
    assert len(server.requests) == 2


def test_other_bytes_than_said_are_an_error_and_no_file(tmp_path: Path, sleeps: Sleeps) -> None:
    other = PICTURE[:-1] + b"?"
    with serving(lambda request: ranged(request, other)) as server, pytest.raises(DigestMismatch):
        client_of(server, sleeps).download("job_1", PICTURE_OUTPUT, tmp_path)
    with serving(lambda request: ranged(request, PICTURE + b"more")) as server, pytest.raises(DigestMismatch):
        client_of(server, sleeps).download("job_1", PICTURE_OUTPUT, tmp_path)
    assert not (tmp_path / "beauty.0001.exr").exists()
    assert server.requests


@pytest.mark.parametrize("name", ["../evil", "/etc/evil", "a/../../evil", "", "a\\..\\b", "a\0b"])
def test_no_name_leads_out_of_the_folder(tmp_path: Path, sleeps: Sleeps, name: str) -> None:
    with serving([]) as server, pytest.raises(UnexpectedAnswer):
        client_of(server, sleeps).download("job_1", Output(name, 1, "0" * 64), tmp_path / "in")
    assert server.requests == []


def test_pages_are_followed(sleeps: Sleeps) -> None:
    pages = [as_json({"items": [JOB], "next_cursor": "c&1"}), as_json({"items": [DONE], "next_cursor": None})]
    with serving(pages) as server:
        jobs = list(client_of(server, sleeps).jobs(state="queued", labels={"shot": "010"}))
    assert [job.state for job in jobs] == ["queued", "succeeded"]
    assert "label=shot%3A010" in server.requests[0].path
    assert "cursor=c%261" in server.requests[1].path


def test_the_environment_says_where_and_who(monkeypatch: pytest.MonkeyPatch, sleeps: Sleeps) -> None:
    with serving([as_json(DONE)]) as server:
        monkeypatch.setenv("PRIMRAY_SERVER", server.url)
        monkeypatch.setenv("PRIMRAY_API_KEY", "pk_2")
        monkeypatch.setenv("http_proxy", "http://127.0.0.1:9")
        with Client() as client:
            client.job("job_1")
    assert server.requests[0].headers["Authorization"] == "Bearer pk_2"
    assert client_module.DEFAULT_SERVER == "http://127.0.0.1:8700"


@pytest.mark.parametrize("server", ["localhost:8700", "ftp://x", "http://"])
def test_an_address_that_is_none(server: str) -> None:
    with pytest.raises(ValueError, match="not a server's address"):
        Client(server)
