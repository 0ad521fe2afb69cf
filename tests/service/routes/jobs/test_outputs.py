"""Files over HTTP: whole, in ranges, conditionally, by HEAD; lists; logs; what is not a job's file is not there."""

from __future__ import annotations

import base64
import email
import hashlib
import os
from typing import Any

import pytest
from tests.service.routes.jobs.finished import finished_job, queued_job
from tests.service.serving import RunningServer

EXR = b"v/1\x01" + os.urandom(300_000)
PNG = b"\x89PNG" + os.urandom(1000)
SHA256 = hashlib.sha256(EXR).hexdigest()
ETAG = f'"{SHA256}"'


@pytest.fixture(scope="module")
def server(start_server: Any) -> RunningServer:
    return start_server(dispatch=False, warm=False)


@pytest.fixture(scope="module")
def client(server: RunningServer) -> Any:
    return server.client()


@pytest.fixture(scope="module")
def job(server: RunningServer) -> str:
    return finished_job(server, {"beauty.exr": EXR, "beauty.png": PNG, "report.json": b"{}"})


@pytest.fixture(scope="module")
def path(job: str) -> str:
    return f"/v1/jobs/{job}/outputs/beauty.exr"


def slug(response: Any) -> tuple[int, str]:
    return response.status_code, response.json()["type"].removeprefix("/problems/")


def test_outputs_are_listed_with_their_digests(job: str, client: Any) -> None:
    items = {item["name"]: item for item in client.get(f"/v1/jobs/{job}/outputs").json()["items"]}
    assert set(items) == {"beauty.exr", "beauty.png", "report.json"}
    exr = items["beauty.exr"]
    assert (exr["bytes"], exr["sha256"], exr["media_type"], exr["frame"]) == (len(EXR), SHA256, "image/x-exr", 0)
    whole = client.get(exr["urls"]["immutable"])
    assert whole.content == EXR
    assert "immutable" in whole.headers["cache-control"]
    other = exr["urls"]["self"] + "?sha256=" + "0" * 64
    assert slug(client.get(other)) == (404, "not-found")


def test_a_whole_file_says_what_it_is(path: str, client: Any) -> None:
    response = client.get(path)
    assert response.content == EXR
    assert response.headers["etag"] == ETAG
    assert response.headers["content-type"] == "image/x-exr"
    assert response.headers["accept-ranges"] == "bytes"
    assert response.headers["content-disposition"] == 'attachment; filename="beauty.exr"'
    assert response.headers["cache-control"] == "private, no-cache"  # its frame may be rendered again
    assert response.headers["x-content-type-options"] == "nosniff"
    assert "sandbox" in response.headers["content-security-policy"]
    assert response.headers["repr-digest"] == f"sha-256=:{base64.b64encode(bytes.fromhex(SHA256)).decode()}:"


def test_head_tells_the_same_without_the_bytes(path: str, client: Any) -> None:
    got, asked = client.get(path), client.head(path, headers={"range": "bytes=0-9"})
    assert asked.status_code == 200
    assert asked.content == b""
    assert asked.headers["content-length"] == str(len(EXR))
    for name in ("etag", "content-type", "accept-ranges", "repr-digest", "content-disposition"):
        assert asked.headers[name] == got.headers[name]


@pytest.mark.parametrize(
    ("header", "begin", "end"),
    [
        ("bytes=0-0", 0, 1),
        ("bytes=100-199", 100, 200),
        ("bytes=299000-", 299_000, len(EXR)),
        ("bytes=-500", len(EXR) - 500, len(EXR)),
        ("bytes=0-99999999999", 0, len(EXR)),
        ("bytes=-99999999999", 0, len(EXR)),
        ("Bytes = 5-9", 5, 10),
        ("bytes=0-99, 100-199", 0, 200),
        ("bytes=50-99,0-60", 0, 100),
        ("bytes=10-19,900000-", 10, 20),
    ],
)
def test_one_range(header: str, begin: int, end: int, path: str, client: Any) -> None:
    response = client.get(path, headers={"range": header})
    assert response.status_code == 206
    assert response.content == EXR[begin:end]
    assert response.headers["content-range"] == f"bytes {begin}-{end - 1}/{len(EXR)}"
    assert response.headers["content-length"] == str(end - begin)


@pytest.mark.parametrize(
    "header",
    ["bytes=", "bytes", "bytes=-", "bytes=a-b", "bytes=9-5", "lines=0-1", "bytes=0-1,x", "bytes=" + "0-1," * 100, "bytes=--1"],
)
def test_a_range_that_is_none_is_ignored(header: str, path: str, client: Any) -> None:
    response = client.get(path, headers={"range": header})
    assert (response.status_code, response.content) == (200, EXR)


@pytest.mark.parametrize("header", ["bytes=400000-", "bytes=400000-400001,500000-", "bytes=-0"])
def test_a_range_outside_of_the_file_is_a_416_that_tells_its_size(header: str, path: str, client: Any) -> None:
    response = client.get(path, headers={"range": header})
    assert slug(response) == (416, "range-not-satisfiable")
    assert response.headers["content-range"] == f"bytes */{len(EXR)}"


def test_several_ranges_are_parts(path: str, client: Any) -> None:
    response = client.get(path, headers={"range": "bytes=200000-200099,0-9,-50"})
    assert response.status_code == 206
    kind = response.headers["content-type"]
    assert kind.startswith("multipart/byteranges; boundary=")
    assert int(response.headers["content-length"]) == len(response.content)
    message = email.message_from_bytes(f"Content-Type: {kind}\r\n\r\n".encode() + response.content)
    parts: Any = message.get_payload()
    ranges = [(0, 10), (200_000, 200_100), (len(EXR) - 50, len(EXR))]
    assert [part["content-range"] for part in parts] == [f"bytes {a}-{b - 1}/{len(EXR)}" for a, b in ranges]
    boundary = f"--{kind.partition('boundary=')[2]}".encode()
    bodies = [piece.partition(b"\r\n\r\n")[2][:-2] for piece in response.content.split(boundary)[1:-1]]
    assert bodies == [EXR[a:b] for a, b in ranges]


def test_conditions(path: str, client: Any) -> None:
    for tag in (ETAG, f"W/{ETAG}", f'"x", {ETAG}', "*"):
        unchanged = client.get(path, headers={"if-none-match": tag})
        assert (unchanged.status_code, unchanged.content, unchanged.headers["etag"]) == (304, b"", ETAG)
    assert client.get(path, headers={"if-none-match": '"x"'}).status_code == 200
    assert slug(client.get(path, headers={"if-match": '"x"'})) == (412, "precondition-failed")
    some = {"range": "bytes=0-9"}
    assert client.get(path, headers={**some, "if-range": ETAG}).status_code == 206
    for tag in ('"x"', f"W/{ETAG}", "Sun, 22 Nov 2026 00:00:00 GMT"):
        assert client.get(path, headers={**some, "if-range": tag}).status_code == 200
    assert client.get(path, headers={**some, "if-none-match": ETAG}).status_code == 304


@pytest.mark.parametrize(
    "name",
    ["nothing.exr", "..%2F..%2F..%2Fprimray.sqlite", "%2Fetc%2Fpasswd", "%2e%2e", "%2e", "%00", "beauty.exr%00", "BEAUTY.EXR"],
)
def test_what_is_not_an_output_is_not_there(name: str, job: str, client: Any) -> None:
    assert client.get(f"/v1/jobs/{job}/outputs/{name}").status_code == 404
    assert slug(client.get("/v1/jobs/job_x/outputs/beauty.exr")) == (404, "not-found")


def test_a_file_of_another_size_than_its_row_is_never_sent(server: RunningServer, client: Any) -> None:
    job = finished_job(server, {"beauty.exr": EXR})
    (server.data / "jobs" / job / "outputs/beauty.exr").write_bytes(EXR[:100])
    assert slug(client.get(f"/v1/jobs/{job}/outputs/beauty.exr")) == (503, "unavailable")
    (server.data / "jobs" / job / "outputs/beauty.exr").unlink()
    assert slug(client.get(f"/v1/jobs/{job}/outputs/beauty.exr")) == (404, "not-found")
    (server.data / "elsewhere").write_bytes(EXR)
    os.symlink(server.data / "elsewhere", server.data / "jobs" / job / "outputs/beauty.exr")
    assert slug(client.get(f"/v1/jobs/{job}/outputs/beauty.exr")) == (404, "not-found")


def test_a_log_is_text_and_can_be_read_on(server: RunningServer, client: Any) -> None:
    job = queued_job(server, frames="1:3")
    path = f"/v1/jobs/{job}/log"
    empty = client.get(path)
    assert (empty.status_code, empty.text, empty.headers["content-type"]) == (200, "", "text/plain; charset=utf-8")
    folder = server.data / "jobs" / job / "frames" / "0"
    folder.mkdir(parents=True)
    (folder / "log.txt").write_text("<script>alert(1)</script>\n")
    first = client.get(path)
    assert first.text == "<script>alert(1)</script>\n"
    assert first.headers["content-type"] == "text/plain; charset=utf-8"
    assert first.headers["x-content-type-options"] == "nosniff"
    assert client.get(path, headers={"if-none-match": first.headers["etag"]}).status_code == 304
    with (folder / "log.txt").open("a") as log:
        log.write("more\n")
    assert client.get(path, headers={"range": f"bytes={len(first.content)}-"}).text == "more\n"
    assert client.get(path, headers={"if-none-match": first.headers["etag"]}).status_code == 200
    assert client.get(path, params={"frame": 2}).text == ""
    assert slug(client.get(path, params={"frame": 3})) == (404, "not-found")
    assert slug(client.get(path, params={"frame": -1})) == (422, "invalid-request")
