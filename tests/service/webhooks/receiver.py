"""A real receiver of webhooks on the loopback, which keeps what came and answers as it is told; and a store of deliveries."""

from __future__ import annotations

import asyncio
import ssl
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from primray_service.store.base import Lost, WebhookDelivery


@dataclass
class Received:
    path: str
    headers: dict[str, str]
    body: bytes


Answer = tuple[int, dict[str, str], bytes]


@dataclass
class Receiver:
    """`answers`: one a request, the last again and again; a function may hang or raise."""

    answers: list[Callable[[], Answer]] = field(default_factory=lambda: [lambda: (204, {}, b"")])
    received: list[Received] = field(default_factory=list)
    connections: int = 0
    port: int = 0
    scheme: str = "http"
    lock: threading.Lock = field(default_factory=threading.Lock)

    def url(self, host: str = "127.0.0.1", path: str = "/hook") -> str:
        return f"{self.scheme}://{host}:{self.port}{path}"

    def answer(self) -> Answer:
        with self.lock:
            chosen = self.answers.pop(0) if len(self.answers) > 1 else self.answers[0]
        return chosen()


def answering(status: int, headers: dict[str, str] | None = None, body: bytes = b"") -> Callable[[], Answer]:
    return lambda: (status, headers or {}, body)


@contextmanager
def receiving(*answers: Callable[[], Answer], tls: ssl.SSLContext | None = None) -> Iterator[Receiver]:
    receiver = Receiver(list(answers)) if answers else Receiver()

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def setup(self) -> None:
            receiver.connections += 1
            super().setup()

        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["Content-Length"]))
            with receiver.lock:
                receiver.received.append(Received(self.path, dict(self.headers), body))
            status, headers, content = receiver.answer()
            self.send_response(status)
            for name, value in headers.items():
                self.send_header(name, value)
            self.send_header("Content-Length", str(len(content)))
            self.end_headers()
            self.wfile.write(content)

        def log_message(self, *_: object) -> None:
            pass

    class Quiet(ThreadingHTTPServer):
        daemon_threads = True

        def handle_error(self, request: object, client_address: object) -> None:
            pass

    server = Quiet(("127.0.0.1", 0), Handler)
    if tls is not None:
        server.socket = tls.wrap_socket(server.socket, server_side=True)
        receiver.scheme = "https"
    receiver.port = server.server_address[1]
    thread = threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True)
    thread.start()
    try:
        yield receiver
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


class Deliveries:
    """The store's two methods for webhooks, over a dictionary."""

    def __init__(self, *deliveries: WebhookDelivery) -> None:
        self.rows = {delivery.id: delivery for delivery in deliveries}
        self.fence = 1
        self.lock = threading.Lock()

    def due_webhooks(self, fence: int, now: float, limit: int) -> Sequence[WebhookDelivery]:
        if fence != self.fence:
            raise Lost
        with self.lock:
            due = [row for row in self.rows.values() if row.state == "due" and row.next_at <= now]
        return sorted(due, key=lambda row: row.next_at)[:limit]

    def webhook_tried(self, fence: int, delivery_id: str, *, state: str, next_at: float, error: str) -> None:
        if fence != self.fence:
            raise Lost
        with self.lock:
            row = self.rows[delivery_id]
            self.rows[delivery_id] = replace(row, tries=row.tries + 1, state=state, next_at=next_at, last_error=error)


async def until(condition: Callable[[], bool], timeout_s: float = 60.0) -> None:
    async with asyncio.timeout(timeout_s):
        while not condition():
            await asyncio.sleep(0.005)
