"""The sender against a real receiver: signatures, failures and retries, redirects, hangs, names that change their meaning."""

from __future__ import annotations

import asyncio
import json
import shutil
import socket
import ssl
import subprocess
import threading
import time
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any, cast

import pytest

from primray_service.config import ServeConfig
from primray_service.store.base import Store, WebhookDelivery
from primray_service.webhooks import WebhookSender
from primray_service.webhooks import sender as sender_module
from primray_service.webhooks.signing import new_secret

from .receiver import Deliveries, answering, receiving, until
from .verifying import verified

SECRET = new_secret()
LOOPBACK = ServeConfig(Path("data"), webhook_http=True, webhook_networks=("127.0.0.0/8",))
PAYLOAD = {"type": "job.completed", "timestamp": "2026-01-01T00:00:00Z", "data": {"id": "job_1", "name": "Straße"}}


def delivery(url: str, id: str = "wh_1", tries: int = 0) -> WebhookDelivery:
    return WebhookDelivery(id, "job_1", url, SECRET, "completed", PAYLOAD, tries, 0.0)


@asynccontextmanager
async def sending(deliveries: Deliveries, config: ServeConfig = LOOPBACK, **options: Any) -> AsyncIterator[WebhookSender]:
    sender = WebhookSender(cast(Store, deliveries), config, **options)
    task = asyncio.create_task(sender.run(lambda: 1))
    try:
        yield sender
    finally:
        await sender.stop()
        await asyncio.wait_for(task, 10)


def send_one(url: str, config: ServeConfig = LOOPBACK, tries: int = 0, **options: Any) -> WebhookDelivery:
    """The delivery's row after one try."""
    rows = Deliveries(delivery(url, tries=tries))

    async def run() -> None:
        async with sending(rows, config, **options):
            await until(lambda: rows.rows["wh_1"].tries > tries)

    asyncio.run(run())
    return rows.rows["wh_1"]


def test_what_arrives_is_signed_and_whole() -> None:
    with receiving() as receiver:
        row = send_one(receiver.url(path="/hook?a=%20b&c"))
    assert (row.state, row.tries, row.last_error) == ("delivered", 1, "")
    (request,) = receiver.received
    assert request.path == "/hook?a=%20b&c"
    assert verified(request.headers, request.body, SECRET, time.time()) == PAYLOAD
    assert request.headers["webhook-id"] == "wh_1"
    assert request.headers["Host"] == f"127.0.0.1:{receiver.port}"
    assert request.headers["Content-Type"] == "application/json"
    assert request.headers["User-Agent"].startswith("primray/")
    assert request.body == json.dumps(PAYLOAD, separators=(",", ":"), ensure_ascii=False).encode()


def test_it_is_tried_again_with_a_new_time_and_the_same_id_until_it_arrives() -> None:
    with receiving(answering(500), answering(302, {"Location": "/"}), answering(204)) as receiver:
        rows = Deliveries(delivery(receiver.url()))
        times = iter([1000.0 + 0.4 * step for step in range(100_000)])

        async def run() -> None:
            async with sending(rows, delays_s=(0.01,) * 7, clock=lambda: next(times)) as sender:
                while rows.rows["wh_1"].state == "due":
                    sender.wake()
                    await asyncio.sleep(0.01)

        asyncio.run(run())
    row = rows.rows["wh_1"]
    assert (row.state, row.tries, len(receiver.received)) == ("delivered", 3, 3)
    assert {request.headers["webhook-id"] for request in receiver.received} == {"wh_1"}
    stamps = [int(request.headers["webhook-timestamp"]) for request in receiver.received]
    assert stamps == sorted(set(stamps))
    for request, stamp in zip(receiver.received, stamps, strict=True):
        verified(request.headers, request.body, SECRET, stamp)


def test_delays_grow_over_a_day_with_jitter_and_end() -> None:
    with receiving(answering(503)) as receiver:
        waits = []
        for tries in range(8):
            row = send_one(receiver.url(), tries=tries, clock=lambda: 5000.0)
            waits.append(row.next_at - 5000.0)
            assert row.state == ("due" if tries < 7 else "failed")
            assert row.last_error == "the receiver answered 503"
    assert waits[:-1] == sorted(waits[:-1])
    assert 5 <= waits[0] <= 6
    assert 24 * 3600 <= sum(waits[:-1]) <= 2 * 24 * 3600
    jitters = {wait / delay for wait, delay in zip(waits, sender_module.DELAYS_S, strict=False)}
    assert all(1 <= jitter <= 1.2 for jitter in jitters)
    assert len(jitters) == 7


@pytest.mark.parametrize(
    ("header", "least", "most"), [("3600", 3600, 3600), ("99999999", 86400, 86400), ("soon", 5, 6), ("²", 5, 6)]
)
def test_a_receiver_may_ask_for_patience(header: str, least: float, most: float) -> None:
    with receiving(answering(429, {"Retry-After": header.encode().decode("latin-1")})) as receiver:
        row = send_one(receiver.url(), clock=lambda: 5000.0)
    assert least <= row.next_at - 5000.0 <= most


def test_a_receiver_that_is_gone_is_not_called_again() -> None:
    with receiving(answering(410)) as receiver:
        row = send_one(receiver.url())
    assert (row.state, row.last_error) == ("failed", "the receiver answered 410 Gone")


def test_redirects_are_not_followed() -> None:
    with receiving() as other, receiving(answering(307, {"Location": other.url()})) as receiver:
        row = send_one(receiver.url())
    assert row.state == "due"
    assert row.last_error == "the receiver answered 307; redirects are not followed"
    assert other.received == []


def test_a_receiver_that_hangs_is_left() -> None:
    released = threading.Event()

    def hang() -> tuple[int, dict[str, str], bytes]:
        released.wait(20)
        return 204, {}, b""

    with receiving(hang) as receiver:
        begun = time.monotonic()
        row = send_one(receiver.url(), timeout_s=0.3)
        released.set()
    assert time.monotonic() - begun < 15  # of the 20 that it would take
    assert (row.state, row.last_error) == ("due", "no answer within 0.3 s")


def test_one_that_hangs_does_not_keep_others_waiting() -> None:
    released = threading.Event()

    def hang() -> tuple[int, dict[str, str], bytes]:
        released.wait(90)
        return 204, {}, b""

    with receiving(hang) as stuck, receiving() as quick:
        rows = Deliveries(*(delivery(stuck.url(), f"stuck{n}") for n in range(60)), delivery(quick.url(), "quick"))

        async def run() -> None:
            async with sending(rows, timeout_s=90.0):
                await until(lambda: rows.rows["quick"].state == "delivered")
                assert len(stuck.received) <= sender_module.AT_A_TIME_TO_A_HOST
                released.set()

        asyncio.run(run())
    assert stuck.received


def test_only_a_little_of_an_answer_is_read() -> None:
    """A receiver that sends without end: 2xx counts, and the connection is closed."""
    sent = 0
    closed = threading.Event()

    def serve(listener: socket.socket) -> None:
        nonlocal sent
        connection, _ = listener.accept()
        connection.recv(65536)
        connection.sendall(b"HTTP/1.1 200 OK\r\nContent-Type: text/plain\r\n\r\n")
        try:
            while sent < 2**30:
                sent += connection.send(b"x" * 65536)
        except OSError:
            closed.set()
        connection.close()

    with socket.create_server(("127.0.0.1", 0)) as listener:
        thread = threading.Thread(target=serve, args=(listener,), daemon=True)
        thread.start()
        row = send_one(f"http://127.0.0.1:{listener.getsockname()[1]}/")
        thread.join(10)
    assert row.state == "delivered"
    assert closed.is_set()
    assert sent < 64 * 2**20


@pytest.mark.parametrize(
    "answer", [b"", b"SSH-2.0-OpenSSH\r\n", b"HTTP/1.1 999999 x\r\n\r\n", b"HTTP/1.1 200 OK\r\nA: " + b"x" * 300_000]
)
def test_what_is_not_http_is_a_failure_like_others(answer: bytes) -> None:
    def serve(listener: socket.socket) -> None:
        connection, _ = listener.accept()
        connection.recv(65536)
        connection.sendall(answer)
        connection.close()

    with socket.create_server(("127.0.0.1", 0)) as listener:
        threading.Thread(target=serve, args=(listener,), daemon=True).start()
        row = send_one(f"http://127.0.0.1:{listener.getsockname()[1]}/", timeout_s=5.0)
    assert row.state == "due"
    assert row.last_error


def test_nobody_listens() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    row = send_one(f"http://127.0.0.1:{port}/")
    assert row.state == "due"
    assert "ConnectError" in row.last_error


class Rebinding:
    """A name that is public when it is submitted and the loopback ever after; each look is counted."""

    def __init__(self, *answers: Sequence[str]) -> None:
        self.answers = list(answers)
        self.asked = 0

    def __call__(self, host: str, port: int) -> Sequence[str]:
        self.asked += 1
        return self.answers.pop(0) if len(self.answers) > 1 else self.answers[0]


def test_a_name_that_turned_private_is_refused_at_connect() -> None:
    closed = ServeConfig(Path("data"), webhook_http=True)
    with receiving() as receiver:
        row = send_one(receiver.url("rebinding.example"), closed, resolve=Rebinding(["127.0.0.1"]))
    assert receiver.connections == 0
    assert row.state == "failed"
    assert "public internet" in row.last_error
    assert "127.0.0.1" not in row.last_error


def test_the_connection_goes_to_the_address_that_was_checked() -> None:
    """The name is looked up once a try: what it means a moment later, when a library would look again, is not asked."""
    rebinding = Rebinding(["127.0.0.1"], ["10.255.255.1"])
    with receiving() as receiver:
        row = send_one(receiver.url("rebinding.example"), resolve=rebinding)
    assert row.state == "delivered"
    assert rebinding.asked == 1
    assert receiver.received[0].headers["Host"] == f"rebinding.example:{receiver.port}"


def test_the_next_address_is_tried_where_one_does_not_answer() -> None:
    with receiving() as receiver:  # nobody listens on 127.0.0.2
        row = send_one(receiver.url("two.example"), resolve=Rebinding(["127.0.0.2", "127.0.0.1"]))
    assert row.state == "delivered"


def test_environment_proxies_have_no_say(monkeypatch: pytest.MonkeyPatch) -> None:
    with receiving() as proxy, receiving() as receiver:
        for name in ("HTTP_PROXY", "http_proxy", "ALL_PROXY", "all_proxy"):
            monkeypatch.setenv(name, proxy.url(path=""))
        row = send_one(receiver.url("named.example"), resolve=Rebinding(["127.0.0.1"]))
    assert row.state == "delivered"
    assert proxy.connections == 0


@pytest.fixture(scope="module")
def certificate(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A key and a certificate for hooks.example, which is its own authority."""
    if shutil.which("openssl") is None:
        pytest.skip("skipped: no openssl")
    folder = tmp_path_factory.mktemp("tls")
    command = "openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 2 -subj /CN=hooks.example"
    command += " -addext subjectAltName=DNS:hooks.example -keyout key.pem -out certificate.pem"
    subprocess.run(command.split(), cwd=folder, check=True, capture_output=True)
    return folder


def test_tls_is_checked_against_the_name_and_not_the_address(certificate: Path) -> None:
    seen: list[str | None] = []
    server = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    server.load_cert_chain(certificate / "certificate.pem", certificate / "key.pem")
    server.sni_callback = lambda socket, name, context: seen.append(name)
    trusting = ssl.create_default_context(cafile=certificate / "certificate.pem")
    resolve = Rebinding(["127.0.0.1"])
    with receiving(tls=server) as receiver:
        row = send_one(receiver.url("hooks.example"), resolve=resolve, tls=trusting)
        assert row.state == "delivered"
        assert seen == ["hooks.example"]
        row = send_one(receiver.url("other.example"), resolve=resolve, tls=trusting)
        assert row.state == "due"
        assert "certificate" in row.last_error.lower()
        row = send_one(receiver.url("hooks.example"), resolve=resolve)  # an authority that the system does not know
        assert row.state == "due"
        assert "certificate" in row.last_error.lower()
    assert len(receiver.received) == 1


def test_nothing_is_sent_without_the_lease_and_nothing_twice_with_it() -> None:
    with receiving() as receiver:
        rows = Deliveries(*(delivery(receiver.url(), f"wh_{n}") for n in range(40)))
        held: list[int | None] = [None]

        async def run() -> None:
            sender = WebhookSender(cast(Store, rows), LOOPBACK)
            task = asyncio.create_task(sender.run(lambda: held[0]))
            await asyncio.sleep(0.2)
            assert receiver.received == []
            held[0] = 0  # another's by now: the store says so
            sender.wake()
            await asyncio.sleep(0.2)
            assert receiver.received == []
            held[0] = 1
            sender.wake()
            await until(lambda: all(row.state == "delivered" for row in rows.rows.values()))
            await sender.stop()
            await asyncio.wait_for(task, 5)

        asyncio.run(run())
    assert sorted(request.headers["webhook-id"] for request in receiver.received) == sorted(rows.rows)


def test_a_store_that_fails_for_a_while_is_asked_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sender_module, "LOOK_EVERY_S", 0.02)
    with receiving() as receiver:
        rows = Deliveries(delivery(receiver.url()))
        right, failures = rows.due_webhooks, iter([ConnectionError("gone")] * 3)

        def due(fence: int, now: float, limit: int) -> Sequence[WebhookDelivery]:
            for failure in failures:
                raise failure
            return right(fence, now, limit)

        monkeypatch.setattr(rows, "due_webhooks", due)

        async def run() -> None:
            async with sending(rows):
                await until(lambda: rows.rows["wh_1"].state == "delivered")

        asyncio.run(run())


def test_stopping_does_not_wait_for_a_receiver_that_hangs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sender_module, "STOP_GRACE_S", 0.1)
    released = threading.Event()
    hang: Callable[[], Any] = lambda: (released.wait(20), answering(204)())[1]  # noqa: E731
    with receiving(hang) as receiver:
        rows = Deliveries(delivery(receiver.url()))

        async def run() -> float:
            async with sending(rows):
                await until(lambda: bool(receiver.received))
                begun = time.monotonic()
            return time.monotonic() - begun

        assert asyncio.run(run()) < 2
        released.set()
    assert rows.rows["wh_1"].tries == 0  # as if it had not been tried: the next holder of the lease sends it
