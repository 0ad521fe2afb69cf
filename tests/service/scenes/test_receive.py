"""Uploads over HTTP: raw and as a form, limits, digests, the same bytes twice, broken connections, a server that is killed."""

from __future__ import annotations

import base64
import fcntl
import hashlib
import os
import signal
import threading
import time
from pathlib import Path
from typing import Any

import pytest
from tests.service.conftest import make_key
from tests.service.scenes.raw_http import answer, connect, head, is_closed
from tests.service.scenes.zips import LAYER, Entry, zip_of
from tests.service.serving import RunningServer, start

from primray.file_formats import advice_for

LIMIT = 2**20


@pytest.fixture(scope="module")
def server(start_server: Any) -> RunningServer:
    return start_server(limits={"upload_bytes": LIMIT, "upload_idle_s": 1.0}, dispatch=False, warm=False)


@pytest.fixture(scope="module")
def client(server: RunningServer) -> Any:
    return server.client()


def layer(size: int = 0) -> bytes:
    """A layer that nobody has sent yet."""
    unique = LAYER + f"# {os.urandom(8).hex()}\n".encode()
    return unique + b"#" * max(0, size - len(unique))


def left_over(server: RunningServer) -> list[str]:
    """What is in incoming/ once threads have had their turn."""
    until = time.monotonic() + 5
    while (found := os.listdir(server.data / "incoming")) and time.monotonic() < until:
        time.sleep(0.02)
    return found


def slug(response: Any) -> tuple[int, str]:
    return response.status_code, response.json()["type"].removeprefix("/problems/")


def test_a_raw_body_is_stored_under_its_digest(client: Any, server: RunningServer) -> None:
    body = layer()
    digest = hashlib.sha256(body).hexdigest()
    missing = client.head(f"/v1/scenes/sha256:{digest}")
    assert missing.status_code == 404
    response = client.post("/v1/scenes", content=body)
    assert response.status_code == 201
    scene = response.json()
    assert scene["id"] == f"sha256:{digest}"
    assert response.headers["location"] == f"/v1/scenes/sha256:{digest}"
    assert (scene["state"], scene["kind"], scene["bytes"]) == ("checking", "usda", len(body))
    assert (server.data / "scenes" / digest / "upload").read_bytes() == body
    assert client.head(response.headers["location"]).status_code == 200
    assert client.get(response.headers["location"]).json() == scene
    assert scene["id"] in [item["id"] for item in client.get("/v1/scenes").json()["items"]]
    assert left_over(server) == []


def test_the_same_bytes_again_are_the_same_scene(client: Any) -> None:
    body = layer()
    first = client.post("/v1/scenes", content=body, params={"name": "a.usda"})
    second = client.post("/v1/scenes", files={"file": ("b.usda", body)})
    assert (first.status_code, second.status_code) == (201, 200)
    assert first.json() == second.json()


@pytest.mark.parametrize("chunked", [False, True])
def test_a_body_over_the_limit_is_refused_and_the_connection_closed(chunked: bool, server: RunningServer) -> None:
    """Whatever Content-Length says, and without one; the answer arrives although the client goes on sending."""
    with connect(server.url) as connection:
        length = "Transfer-Encoding: chunked" if chunked else f"Content-Length: {8 * LIMIT}"
        connection.sendall(head("/v1/scenes", length))

        def send() -> None:
            piece = b"#usda 1.0\n" + b"#" * 65526
            try:
                for _ in range(8 * LIMIT // len(piece)):
                    connection.sendall(b"%x\r\n%s\r\n" % (len(piece), piece) if chunked else piece)
            except OSError:
                pass

        sending = threading.Thread(target=send)
        sending.start()
        status, headers, problem = answer(connection)
        assert (status, problem["type"], problem["limit"]) == (413, "/problems/upload-too-large", LIMIT)
        assert headers["connection"] == "close"
        assert is_closed(connection)
        sending.join()
    assert left_over(server) == []


def test_a_client_that_waits_for_100_continue_sends_nothing_in_vain(server: RunningServer) -> None:
    with connect(server.url) as connection:
        connection.sendall(head("/v1/scenes", f"Content-Length: {LIMIT + 1}", "Expect: 100-continue"))
        status, _, problem = answer(connection)
        assert (status, problem["type"]) == (413, "/problems/upload-too-large")
    body = layer()
    with connect(server.url) as connection:
        connection.sendall(head("/v1/scenes", f"Content-Length: {len(body)}", "Expect: 100-continue"))
        assert b"100" in connection.recv(100)
        connection.sendall(body)
        assert answer(connection)[0] == 201


@pytest.mark.parametrize("size", [LIMIT, LIMIT - 1])
def test_a_body_at_the_limit_is_taken(size: int, client: Any) -> None:
    assert client.post("/v1/scenes", content=layer(size)).status_code == 201


def test_a_form_over_the_limit_is_refused(client: Any, server: RunningServer) -> None:
    assert slug(client.post("/v1/scenes", files={"file": ("a.usda", layer(LIMIT + 1))})) == (413, "upload-too-large")
    # What is in no part counts as well, and is sent without saying how much it is.
    part = b'--B\r\nContent-Disposition: form-data; name="file"; filename="a.usda"\r\n\r\n' + layer() + b"\r\n--B--\r\n"
    pieces = iter([part, *[b"#" * 2**16] * (2 * LIMIT // 2**16)])
    response = client.post("/v1/scenes", content=pieces, headers={"content-type": "multipart/form-data; boundary=B"})
    assert slug(response) == (413, "upload-too-large")
    assert left_over(server) == []


@pytest.mark.parametrize("body", [b"", b"#" * 500])
def test_a_body_that_ends_early_leaves_nothing(body: bytes, server: RunningServer) -> None:
    with connect(server.url) as connection:
        connection.sendall(head("/v1/scenes", "Content-Length: 1000") + body + b"#usda 1.0\n")
        until = time.monotonic() + 5
        while not os.listdir(server.data / "incoming") and time.monotonic() < until:
            time.sleep(0.005)
        assert os.listdir(server.data / "incoming"), "it is being received"
        connection.close()
    assert left_over(server) == []


def test_a_client_that_stalls_is_let_go(server: RunningServer) -> None:
    with connect(server.url) as connection:
        connection.sendall(head("/v1/scenes", "Content-Length: 1000") + b"#usda 1.0\n")
        status, _, problem = answer(connection)
        assert (status, problem["type"]) == (400, "/problems/upload-incomplete")
        assert is_closed(connection)
    assert left_over(server) == []


def test_an_empty_body_says_what_to_send(client: Any) -> None:
    for response in (client.post("/v1/scenes"), client.post("/v1/scenes", content=b"")):
        assert slug(response) == (400, "upload-incomplete")
        assert "file" in response.json()["detail"]


@pytest.mark.parametrize(
    ("body", "says"),
    [
        (b"hello world", "68 65 6c"),
        (b"\x89PNG\r\n\x1a\n", "PNG"),
        (b"\xef\xbb\xbf#usda 1.0\n", "byte order mark"),
        (b"#usd", "#usda"),
        (b"P", "50"),
    ],
)
def test_what_is_not_usd_is_refused_at_once(body: bytes, says: str, client: Any, server: RunningServer) -> None:
    response = client.post("/v1/scenes", content=body)
    assert slug(response) == (422, "not-usd")
    assert says in response.json()["detail"]
    assert left_over(server) == []


def test_other_formats_are_refused_in_the_command_line_s_words(client: Any, server: RunningServer) -> None:
    """A file by its bytes or its name, and a package by what it holds."""
    disposition = {"content-disposition": 'attachment; filename="car.obj"'}
    package = zip_of(Entry("models/car.fbx", b"Kaydara FBX Binary"), Entry("readme.txt", b"text"))
    for body, headers, name, before in (
        (b"glTF\x02\0\0\0", {}, "model", ""),
        (b"v 0 0 0\n", disposition, "car.obj", ""),
        (package, {}, "car.fbx", "None of the package's 2 files is a usd, usda, usdc or usdz layer. models/car.fbx: "),
    ):
        response = client.post("/v1/scenes", content=body, headers=headers)
        assert (*slug(response), response.json()["code"]) == (422, "not-usd", "stage-format")
        assert response.json()["detail"] == f"{before}{advice_for(name, b'' if before else body)}"
    assert left_over(server) == []


@pytest.mark.parametrize("name", ["content-digest", "repr-digest"])
@pytest.mark.parametrize("algorithm", ["sha-256", "sha-512"])
def test_digests_are_checked(name: str, algorithm: str, client: Any, server: RunningServer) -> None:
    body = layer()
    computed = hashlib.new(algorithm.replace("-", ""), body).digest()
    right, wrong = (base64.b64encode(digest).decode() for digest in (computed, bytes(len(computed))))
    refused = client.post("/v1/scenes", content=body, headers={name: f"{algorithm}=:{wrong}:"})
    assert slug(refused) == (422, "digest-mismatch")
    assert right in refused.json()["computed"]
    assert left_over(server) == []
    both = f"md5=:AAAA:, {algorithm}=:{right}:;a=1"
    assert client.post("/v1/scenes", content=body, headers={name: both}).status_code == 201


@pytest.mark.parametrize("value", ["sha-256=:abc:", "sha-256=abc", "nonsense", "sha-256=:" + "A" * 43 + "!:"])
def test_a_malformed_digest_is_told(value: str, client: Any) -> None:
    assert slug(client.post("/v1/scenes", content=layer(), headers={"repr-digest": value})) == (422, "invalid-request")


@pytest.mark.parametrize(
    ("headers", "query", "name"),
    [
        ({"content-disposition": 'attachment; filename="shot 010.usda"'}, None, "shot 010.usda"),
        ({"content-disposition": "attachment; filename*=UTF-8''sh%C3%B6t.usda"}, None, "shöt.usda"),
        ({"content-disposition": 'attachment; filename="../../etc/passwd"'}, None, "passwd"),
        ({"content-disposition": 'attachment; filename="C:\\\\x\\\\y.usda"'}, None, "y.usda"),
        ({"content-disposition": "attachment; filename=\"a\"; filename*=UTF-8''b"}, None, "b"),
        ({"content-disposition": "attachment"}, None, ""),
        ({}, "q\u202eadsu.exe\n", "qadsu.exe"),
        ({}, "<img src=x onerror=alert(1)>.usda", "<img src=x onerror=alert(1)>.usda"),
        ({}, "..", ""),
        ({}, "x" * 400, "x" * 255),
    ],
)
def test_names_are_cleaned_and_only_shown(headers: dict[str, str], query: str | None, name: str, client: Any) -> None:
    params = {} if query is None else {"name": query}
    assert client.post("/v1/scenes", content=layer(), headers=headers, params=params).json()["name"] == name


def test_a_form_needs_a_file_and_nothing_else(client: Any, server: RunningServer) -> None:
    form = {"content-type": "multipart/form-data; boundary=B"}
    part = b'--B\r\nContent-Disposition: form-data; name="%s"; filename="a.usda"\r\n\r\n%s\r\n'
    whole = part % (b"file", layer())
    cases = {
        b"--B--\r\n": (422, "invalid-request"),
        part % (b"other", b"x") + b"--B--\r\n": (422, "invalid-request"),
        whole + part % (b"file", b"#usda 1.0") + b"--B--\r\n": (422, "invalid-request"),
        part % (b"file", b"") + b"--B--\r\n": (400, "upload-incomplete"),
        whole: (400, "upload-incomplete"),
        whole[:-20]: (400, "upload-incomplete"),
        b"nonsense": (422, "invalid-request"),
        b"": (400, "upload-incomplete"),
        b"--B\r\nContent-Disposition: form-data\r\n\r\nx\r\n--B--\r\n": (422, "invalid-request"),
        b"--B\r\n" + b"X-Header: y\r\n" * 100 + b"\r\nx\r\n--B--\r\n": (422, "invalid-request"),
    }
    for body, expected in cases.items():
        assert slug(client.post("/v1/scenes", content=body, headers=form)) == expected, body[:80]
    no_boundary = client.post("/v1/scenes", content=whole, headers={"content-type": "multipart/form-data"})
    assert slug(no_boundary) == (422, "invalid-request")
    assert left_over(server) == []


def test_an_encoded_body_is_refused(client: Any) -> None:
    assert slug(client.post("/v1/scenes", content=layer(), headers={"content-encoding": "gzip"})) == (
        415,
        "unsupported-media-type",
    )


@pytest.mark.parametrize("media_type", ["", "text/plain", "application/x-www-form-urlencoded", "model/vnd.usda", "image/png"])
def test_the_bytes_say_what_it_is_not_the_media_type(media_type: str, client: Any) -> None:
    headers = {"content-type": media_type} if media_type else {}
    assert client.post("/v1/scenes", content=layer(), headers=headers).json()["kind"] == "usda"


def test_deleting_a_scene_removes_its_bytes(client: Any, server: RunningServer) -> None:
    response = client.post("/v1/scenes", content=layer())
    path = response.headers["location"]
    folder = server.data / "scenes" / response.json()["id"][7:]
    assert client.delete(path).status_code == 204
    assert not folder.exists()
    assert slug(client.delete(path)) == (404, "not-found")
    assert slug(client.get("/v1/scenes/sha256:xyz")) == (404, "not-found")
    assert slug(client.get("/v1/scenes/..%2F..%2Fetc")) == (404, "not-found")
    assert left_over(server) == []


def test_scenes_are_listed_in_pages(client: Any) -> None:
    made = [client.post("/v1/scenes", content=layer()).json()["id"] for _ in range(5)]
    seen: list[str] = []
    path: str | None = "/v1/scenes?limit=2"
    while path and not set(made) <= set(seen):
        page = client.get(path)
        items = [item["id"] for item in page.json()["items"]]
        assert len(items) <= 2
        seen += items
        path = page.links["next"]["url"] if "next" in page.links else None
    assert [found for found in seen if found in made] == made[::-1]
    assert len(set(seen)) == len(seen)
    assert slug(client.get("/v1/scenes?cursor=nonsense")) == (422, "invalid-request")


def test_many_uploads_of_the_same_bytes_at_once_make_one(server: RunningServer) -> None:
    body = zip_of(Entry("shot.usda", layer()), *(Entry(f"{i}.png", os.urandom(100)) for i in range(50)))
    found: list[tuple[int, str]] = []

    def upload() -> None:
        response = server.client().post("/v1/scenes", content=body)
        found.append((response.status_code, response.json()["id"]))

    threads = [threading.Thread(target=upload) for _ in range(12)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(status for status, _ in found) == [200] * 11 + [201]
    assert len({scene for _, scene in found}) == 1
    assert left_over(server) == []


@pytest.mark.parametrize("verb", ["post", "delete"])
def test_keeping_and_removing_wait_for_whoever_else_does(verb: str, server: RunningServer) -> None:
    """Another server over the same data directory may be about to take away the bytes that this one relies on."""
    client, body, done = server.client(), layer(), threading.Event()
    if verb == "delete":
        client.post("/v1/scenes", content=body)
    path = f"/v1/scenes/sha256:{hashlib.sha256(body).hexdigest()}"

    def work() -> None:
        response = client.post("/v1/scenes", content=body) if verb == "post" else client.delete(path)
        assert response.status_code in (201, 204)
        done.set()

    lock = os.open(server.data / "scenes.lock", os.O_RDWR)
    fcntl.flock(lock, fcntl.LOCK_EX)
    working = threading.Thread(target=work)
    working.start()
    assert not done.wait(0.7)
    os.close(lock)
    assert done.wait(10)
    working.join()


def test_uploads_and_deletions_of_the_same_bytes_never_leave_a_scene_without_bytes(server: RunningServer) -> None:
    body = layer()
    folder = server.data / "scenes" / hashlib.sha256(body).hexdigest()
    path = f"/v1/scenes/sha256:{folder.name}"
    until = time.monotonic() + 1.5
    wrong: list[str] = []

    def upload() -> None:
        client = server.client()
        while time.monotonic() < until:
            if client.post("/v1/scenes", content=body).status_code not in (200, 201):
                wrong.append("upload")

    def delete() -> None:
        client = server.client()
        while time.monotonic() < until:
            if client.delete(path).status_code not in (204, 404):
                wrong.append("delete")

    threads = [threading.Thread(target=work) for work in (upload, upload, delete)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    client = server.client()
    assert wrong == []
    exists = client.get(path).status_code == 200
    assert folder.exists() == exists
    client.post("/v1/scenes", content=body)
    assert (folder / "upload").read_bytes() == body


def test_the_disk_is_never_filled(start_server: Any) -> None:
    server = start_server(limits={"free_disk_bytes": 2**60}, dispatch=False, warm=False)
    with connect(server.url) as connection:
        body = layer()
        connection.sendall(head("/v1/scenes", f"Content-Length: {len(body)}") + body)
        status, _, problem = answer(connection)
    assert (status, problem["type"], problem["retryable"]) == (507, "/problems/storage-full", True)
    assert left_over(server) == []


def test_a_tenant_keeps_within_its_stored_bytes(start_server: Any) -> None:
    from primray_service.limits import Quotas

    server = start_server(require_keys=True, dispatch=False, warm=False)
    url = f"sqlite:///{server.data / 'primray.sqlite'}"
    client = server.client(make_key(url, "studio", "submit", "read", quotas=Quotas(stored_bytes=5000)))
    first = client.post("/v1/scenes", content=layer(3000))
    assert first.status_code == 201
    for kept in ({}, {"transfer-encoding": "chunked"}):
        body = layer(3000)
        refused = client.post("/v1/scenes", content=iter([body]) if kept else body)
        assert slug(refused) == (429, "quota-exceeded")
        assert (refused.json()["quota"], refused.json()["limit"], refused.json()["used"]) == ("stored_bytes", 5000, 3000)
        assert (refused.json()["retryable"], "retry-after" in refused.headers) == (False, False), "waiting frees nothing"
        assert refused.json()["detail"].endswith("3,000 are in use. Delete scenes or jobs that are no longer needed.") or (
            ", and 3,000 are in use; this request needs " in refused.json()["detail"]
        )
        assert not (server.data / "scenes" / hashlib.sha256(body).hexdigest()).exists()
    assert client.get("/v1/usage").json()["stored_bytes"] == {"used": 3000, "limit": 5000}
    assert client.delete(first.headers["location"]).status_code == 204
    assert client.post("/v1/scenes", content=layer(3000)).status_code == 201
    other = server.client(make_key(url, "other", "submit", "read"))
    assert slug(other.get(first.headers["location"])) == (404, "not-found")
    assert other.get("/v1/scenes").json()["items"] == []


def test_two_tenants_share_bytes_and_neither_can_remove_the_others(start_server: Any) -> None:
    server = start_server(require_keys=True, dispatch=False, warm=False)
    url = f"sqlite:///{server.data / 'primray.sqlite'}"
    one, two = (server.client(make_key(url, tenant, "submit", "read")) for tenant in ("one", "two"))
    body = layer()
    path = one.post("/v1/scenes", content=body).headers["location"]
    assert two.head(path).status_code == 404
    assert two.post("/v1/scenes", content=body).status_code == 201
    assert one.delete(path).status_code == 204
    assert one.get(path).status_code == 404
    assert two.get(path).status_code == 200
    folder = server.data / "scenes" / hashlib.sha256(body).hexdigest()
    assert (folder / "upload").read_bytes() == body
    assert two.delete(path).status_code == 204
    assert not folder.exists()


def test_a_killed_server_leaves_nothing_after_its_next_start(tmp_path: Path) -> None:
    data = tmp_path / "data"
    server = start(data, dispatch=False, warm=False)
    kept = server.client().post("/v1/scenes", content=layer()).json()["id"]
    connection = connect(server.url)
    connection.sendall(head("/v1/scenes", "Content-Length: 3000000") + b"#usda 1.0\n" + b"#" * 2_000_000)
    until = time.monotonic() + 5
    while not os.listdir(data / "incoming") and time.monotonic() < until:
        time.sleep(0.01)
    server.stop(signal.SIGKILL)
    connection.close()
    orphan = data / "scenes" / ("0" * 64)
    orphan.mkdir()
    (orphan / "upload").write_bytes(b"renamed, and then the server died before the row was written")
    assert os.listdir(data / "incoming")
    server = start(data, dispatch=False, warm=False)
    try:
        assert os.listdir(data / "incoming") == []
        assert [folder.name for folder in (data / "scenes").iterdir()] == [kept[7:]]
        assert server.client().get(f"/v1/scenes/{kept}").status_code == 200
    finally:
        server.stop()
