"""The running server: how it starts and stops, and connections that are slow, silent, many or malformed."""

from __future__ import annotations

import json
import signal
import socket
import threading
import time

import httpx2
import pytest
from tests.service.api_calls import problem, stored, submit, wait_until
from tests.service.conftest import StartServer
from tests.service.serving import RunningServer


@pytest.fixture(scope="module")
def server(start_server: StartServer) -> RunningServer:
    return start_server(dispatch=False, warm=False)


def connect(server: RunningServer) -> socket.socket:
    port = int(server.url.rpartition(":")[2])
    return socket.create_connection(("127.0.0.1", port), timeout=30)


def everything(connection: socket.socket) -> bytes:
    """What comes until the other end closes."""
    found = b""
    while part := connection.recv(65536):
        found += part
    return found


def answers(found: bytes) -> list[tuple[int, bytes]]:
    """Status and body of each answer in a connection's bytes."""
    all_of_them = []
    while found:
        head, _, found = found.partition(b"\r\n\r\n")
        length = int(head.lower().partition(b"content-length: ")[2].split()[0])
        all_of_them.append((int(head.split()[1]), found[:length]))
        found = found[length:]
    return all_of_them


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_it_stops_soon_whatever_is_open(start_server, number):
    server = start_server(dispatch=False, warm=False)
    client = server.client()
    here = f"/v1/jobs/{submit(client, stored(client))['id']}"
    heard: list[str] = []

    def listen(path: str, **headers: str) -> None:
        with (
            httpx2.Client(timeout=60, trust_env=False) as mine,
            mine.stream("GET", server.url + path, headers=headers) as stream,
        ):
            heard.append(stream.headers["content-type"])
            heard.append("".join(stream.iter_lines())[:20])

    streams = [
        threading.Thread(daemon=True, target=listen, args=(f"{here}/events",), kwargs={"accept": "text/event-stream"})
        for _ in "abc"
    ]
    poll = threading.Thread(daemon=True, target=listen, args=(here,), kwargs={"prefer": "wait=50"})
    for thread in (*streams, poll):
        thread.start()
    wait_until(lambda: len(heard) >= 3)
    idle = connect(server)
    time.sleep(0.3)
    began = time.monotonic()
    assert server.stop(number) == 0
    assert time.monotonic() - began < 30  # of the 50 that the poll may wait
    for thread in (*streams, poll):
        thread.join(5)
        assert not thread.is_alive()
    assert len(heard) == 8  # the poll was answered, the streams came to an end
    assert idle.recv(10) == b""
    assert server.failures() == []


def test_what_was_accepted_is_there_after_a_restart(start_server, tmp_path):
    server = start_server(tmp_path / "data", dispatch=False, warm=False)
    client = server.client()
    job = submit(client, stored(client))
    server.stop()
    again = start_server(tmp_path / "data", dispatch=False, warm=False).client()
    assert again.get(f"/v1/jobs/{job['id']}").json() == job


def test_a_port_that_is_taken_is_a_sentence(server, start_server):
    with pytest.raises(AssertionError, match=r"Cannot listen on 127\.0\.0\.1 port"):
        start_server(port=int(server.url.rpartition(":")[2]), dispatch=False)


@pytest.mark.parametrize(
    "request_bytes",
    [
        b"nonsense\r\n\r\n",
        b"GET / HTTP/1.1\r\nhost: localhost\r\nx: " + b"y" * 200_000 + b"\r\n\r\n",
        b"GET / HTTP/1.1\r\nhost: localhost\r\nbad header\r\n\r\n",
        b"POST /v1/jobs HTTP/1.1\r\nhost: localhost\r\ncontent-length: -1\r\n\r\n",
        b"POST /v1/jobs HTTP/1.1\r\nhost: localhost\r\ncontent-length: 1\r\ntransfer-encoding: chunked, chunked\r\n\r\n",
    ],
)
def test_what_is_no_request_is_answered_and_closed(server, request_bytes):
    with connect(server) as connection:
        connection.sendall(request_bytes[:40_000])
        ((status, body),) = answers(everything(connection))
    assert status in (400, 501)
    assert json.loads(body)["type"] == "/problems/invalid-request"


def test_requests_in_one_go_are_answered_in_order(server):
    paths = ["/v1/jobs?limit=3", "/nothing", "/healthz", "/v1/jobs/job_00000000000000000000000000"]
    with connect(server) as connection:
        for path in paths[:-1]:
            connection.sendall(f"GET {path} HTTP/1.1\r\nhost: localhost\r\n\r\n".encode())
        connection.sendall(f"GET {paths[-1]} HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n".encode())
        found = answers(everything(connection))
    assert [status for status, _ in found] == [200, 404, 200, 404]
    assert b"items" in found[0][1]


def test_a_body_that_stays_away_keeps_nobody_else_waiting(server):
    with connect(server) as slow:
        slow.sendall(
            b"POST /v1/jobs HTTP/1.1\r\nhost: localhost\r\ncontent-type: application/json\r\ncontent-length: 9\r\n\r\n{"
        )
        assert server.client().get("/v1/jobs").status_code == 200
    client = server.client()
    assert client.get("/v1/jobs").status_code == 200  # the half request is gone, and nothing came of it


def test_a_thousand_idle_connections(server):
    connections = [connect(server) for _ in range(1000)]
    try:
        client = server.client()
        began = time.perf_counter()
        for _ in range(20):
            assert client.get("/healthz").status_code == 200
        assert time.perf_counter() - began < 30
        connections[500].sendall(b"GET /healthz HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n")
        assert answers(everything(connections[500]))[0][0] == 200
    finally:
        for connection in connections:
            connection.close()


def test_a_client_that_does_not_read_costs_nobody_else_anything(server):
    """Its answers stay in its own connection's buffers."""
    with connect(server) as deaf:
        deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        for _ in range(50):
            deaf.sendall(b"GET /openapi.json HTTP/1.1\r\nhost: localhost\r\n\r\n")
        client = server.client()
        for _ in range(10):
            assert client.get("/healthz").status_code == 200


def test_a_request_after_the_end_of_the_one_before_it_on_one_connection(server):
    client = server.client()
    problem(client.post("/v1/jobs", content=b"x" * 1000, headers={"content-type": "text/plain"}), 415, "unsupported-media-type")
    assert client.get("/healthz").status_code == 200
