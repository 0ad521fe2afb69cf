"""A server on the loopback that answers by a script: for what a real one does only when it fails."""

from __future__ import annotations

import json
import socket
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any


@dataclass(frozen=True)
class Request:
    method: str
    path: str
    headers: Mapping[str, str]
    body: bytes


@dataclass(frozen=True)
class Answer:
    """`cut`: so many bytes of the body are sent, then the connection is reset; -1: before anything at all."""

    status: int = 200
    body: bytes = b""
    headers: Mapping[str, str] = field(default_factory=dict)
    cut: int | None = None


def as_json(document: Any, status: int = 200, **headers: str) -> Answer:
    named = {name.replace("_", "-"): value for name, value in headers.items()}
    return Answer(status, json.dumps(document).encode(), {"Content-Type": "application/json", **named})


def problem(slug: str, status: int, **headers: str) -> Answer:
    return as_json({"type": f"/problems/{slug}", "title": "t", "status": status, "detail": f"about {slug}"}, status, **headers)


BROKEN = Answer(cut=-1)


@dataclass
class Scripted:
    script: Callable[[Request], Answer]
    requests: list[Request] = field(default_factory=list)
    url: str = ""

    @property
    def asked(self) -> list[str]:
        return [f"{request.method} {request.path}" for request in self.requests]


@contextmanager
def serving(script: Callable[[Request], Answer] | list[Answer]) -> Iterator[Scripted]:
    """A function of the request, or answers in order."""
    if isinstance(script, list):
        answers = iter(script)
        server = Scripted(lambda request: next(answers))
    else:
        server = Scripted(script)

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def handle_any(self) -> None:
            body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
            request = Request(self.command, self.path, dict(self.headers), body)
            server.requests.append(request)
            answer = server.script(request)
            if answer.cut == -1:
                self.reset()
                return
            self.send_response(answer.status)
            for name, value in answer.headers.items():
                self.send_header(name, value)
            if "Content-Length" not in answer.headers and "Connection" not in answer.headers:
                self.send_header("Content-Length", str(len(answer.body)))
            self.end_headers()
            if self.command != "HEAD":
                self.wfile.write(answer.body[: answer.cut])
            if answer.cut is not None:
                self.wfile.flush()
                self.reset()
            self.close_connection = answer.headers.get("Connection") == "close" or self.close_connection

        do_GET = do_HEAD = do_POST = do_PATCH = do_DELETE = handle_any

        def reset(self) -> None:
            """Without an answer, as by a process that is killed; after a part of one, what was sent still arrives."""
            if server.requests and not self.wfile.closed:
                self.close_connection = True
                self.connection.shutdown(socket.SHUT_WR)

        def log_message(self, *_: object) -> None:
            pass

    class Quiet(ThreadingHTTPServer):
        daemon_threads = True

        def handle_error(self, request: object, client_address: object) -> None:
            pass

    httpd = Quiet(("127.0.0.1", 0), Handler)
    server.url = f"http://127.0.0.1:{httpd.server_address[1]}"
    thread = threading.Thread(target=httpd.serve_forever, args=(0.02,), daemon=True)
    thread.start()
    try:
        yield server
    finally:
        httpd.shutdown()
        httpd.server_close()
        thread.join()
