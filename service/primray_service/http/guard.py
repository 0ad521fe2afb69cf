"""Middleware around every request, outermost first: an id, security headers, the log line, and an answer to unhandled
exceptions; the checks of its origin; and its duration and size for /metrics. Plain ASGI, so that streams pass unchanged.

A page of another site can reach a server on loopback through its visitor's browser: by a host name that it points there (DNS
rebinding: detected by the Host header), or by posting a form (detected by the Origin header).
"""

from __future__ import annotations

import ipaddress
import re
import socket
import time
from collections.abc import Mapping
from urllib.parse import urlsplit

import structlog
from starlette.applications import Starlette
from starlette.datastructures import Headers, MutableHeaders
from starlette.middleware.cors import CORSMiddleware
from starlette.requests import Request
from starlette.routing import BaseRoute
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from ..config import ServeConfig
from ..ids import ulid
from ..monitoring import RequestMetrics
from ..problems import Problem
from .answers import problem_answer

log = structlog.get_logger("primray.http")

SAFE_HEADERS: Mapping[str, str] = {
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "x-frame-options": "DENY",
    "cross-origin-resource-policy": "same-origin",
    "content-security-policy": "default-src 'none'; frame-ancestors 'none'",
}
SAFE_METHODS = frozenset({"GET", "HEAD", "OPTIONS"})
_REQUEST_ID = re.compile(r"[A-Za-z0-9._:/+=-]{1,128}")


def request_id_of(request: Request) -> str:
    found: str = request.scope.get("primray.request_id", "")
    return found


class RequestGuard:
    """Adds a request id and security headers to every answer; turns exceptions into problems, without tracebacks."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        sent = Headers(scope=scope).get("x-request-id", "")
        request_id = sent if _REQUEST_ID.fullmatch(sent) else ulid(time.time())
        scope["primray.request_id"] = request_id
        status = 0

        async def send_with_headers(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                headers = MutableHeaders(scope=message)
                headers["x-request-id"] = request_id
                for name, value in SAFE_HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        began = time.perf_counter()
        with structlog.contextvars.bound_contextvars(request_id=request_id):
            try:
                await self._app(scope, receive, send_with_headers)
            except Exception:
                log.exception("request failed", method=scope["method"], path=scope["path"])
                if status:
                    raise  # the answer has begun: the connection is closed, so that the client does not take it for complete
                problem = Problem("internal", "The server failed; see its log for this request id.")
                await problem_answer(problem, request_id)(scope, receive, send_with_headers)
            log.info(
                "request",
                method=scope["method"],
                path=scope["path"],
                status=status,
                seconds=round(time.perf_counter() - began, 6),
            )


class OriginGuard:
    """Accepts only hosts that are this server, and changes only from its own pages and from allowed origins."""

    def __init__(self, app: ASGIApp, config: ServeConfig) -> None:
        self._app = app
        self._hosts = hosts_of(config)
        self._origins = frozenset(config.allowed_origins)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http":
            try:
                check_origin(Headers(scope=scope), scope["method"], self._hosts, self._origins)
                check_text(scope["path"], scope["query_string"])
            except Problem as problem:
                await problem_answer(problem, scope["primray.request_id"])(scope, receive, send)
                return
        await self._app(scope, receive, send)


def hosts_of(config: ServeConfig) -> frozenset[str]:
    """Return the names that this server answers for, beside all numeric addresses; "*" for any."""
    own = {"localhost", config.host, *config.allowed_hosts}
    if not config.on_loopback:
        own |= {socket.gethostname(), socket.getfqdn()}
    return frozenset(name.lower().rstrip(".") for name in own)


def check_origin(headers: Headers, method: str, hosts: frozenset[str], origins: frozenset[str] = frozenset()) -> None:
    """Raise Problem unless Host is one of ours and, for methods that change something, Origin is that host or one of
    `origins`."""
    host = headers.get("host", "")
    name = _name_of(host)
    if "*" not in hosts and name not in hosts and not _is_address(name):
        raise Problem(
            "host-not-allowed",
            f"Start the server with --allow-host {name[:200] or 'NAME'} to reach it by this name.",
            host=host[:200],
        )
    if method in SAFE_METHODS:
        return
    origin = headers.get("origin")
    if origin in origins:
        return
    if origin is not None and _authority(urlsplit_or_none(origin)) != _with_port(host, origin):
        raise Problem("cross-origin", "Changes are accepted only from this server's own pages.", origin=origin[:200])
    if origin is None and headers.get("sec-fetch-site", "none") not in ("same-origin", "none"):
        raise Problem("cross-origin", "Changes are accepted only from this server's own pages.")


def check_text(path: str, query: bytes) -> None:
    """Raise Problem for NUL, which no name of ours contains and PostgreSQL cannot store."""
    if "\0" in path:
        raise Problem("not-found", "There is nothing at this path.")
    if b"%00" in query:
        raise Problem("invalid-request", "The query contains NUL.", member="query")


def urlsplit_or_none(url: str) -> tuple[str, str]:
    """Return scheme and authority; empty for what is no URL (including "null")."""
    try:
        parts = urlsplit(url)
    except ValueError:
        return "", ""
    return parts.scheme, parts.netloc.lower()


def _authority(origin: tuple[str, str]) -> str:
    scheme, authority = origin
    return _with_port(authority, f"{scheme}://")


def _with_port(host: str, origin: str) -> str:
    """Return host:port with the port that the origin's scheme implies."""
    default = {"http": ":80", "https": ":443"}.get(origin.partition(":")[0], "")
    host = host.lower()
    has_port = host.rpartition(":")[1] and not host.endswith("]")
    return host if has_port else host + default


def _name_of(host: str) -> str:
    """Return the host without its port, in lower case."""
    if host.startswith("["):
        return host[1:].partition("]")[0]
    return host.partition(":")[0].lower().rstrip(".")


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


METHODS = ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE")
SENT = (
    "authorization",
    "content-type",
    "idempotency-key",
    "if-match",
    "if-none-match",
    "if-range",
    "last-event-id",
    "prefer",
    "range",
    "repr-digest",
    "traceparent",
    "tracestate",
    "x-request-id",
)
READ = (
    "accept-ranges",
    "content-disposition",
    "content-range",
    "etag",
    "idempotency-replayed",
    "link",
    "location",
    "preference-applied",
    "preview-view",
    "ratelimit",
    "ratelimit-policy",
    "repr-digest",
    "retry-after",
    "x-request-id",
)
KNOWN_FOR_S = 600  # time for which a browser caches the permission


def allow_origins(app: Starlette, config: ServeConfig) -> None:
    """Add the middleware if origins are allowed; otherwise the server answers as if there were no CORS."""
    if config.allowed_origins:
        app.add_middleware(
            CORSMiddleware,
            allow_origins=config.allowed_origins,
            allow_methods=METHODS,
            allow_headers=SENT,
            expose_headers=READ,
            allow_credentials=False,
            max_age=KNOWN_FOR_S,
        )


NO_ROUTE = "none"


class Measured:
    """Counts and times requests; the route is known only once the router has found it."""

    def __init__(self, app: ASGIApp, metrics: RequestMetrics) -> None:
        self._app = app
        self._metrics = metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        metrics, began, status, progress = self._metrics, time.perf_counter(), 0, None

        async def counted_send(message: Message) -> None:
            nonlocal status, progress
            if message["type"] == "http.response.start":
                status = message["status"]
                progress = metrics.in_progress.labels(_method(scope), template_of(scope))
                progress.inc()
            elif message["type"] == "http.response.body":
                metrics.sent_bytes.inc(len(message.get("body", b"")))
            await send(message)

        async def counted_receive() -> Message:
            message = await receive()
            if message["type"] == "http.request":
                metrics.uploaded_bytes.inc(len(message.get("body", b"")))
            return message

        try:
            await self._app(scope, counted_receive, counted_send)
        finally:
            if progress is not None:
                progress.dec()
            labels = (_method(scope), template_of(scope), str(status or 500))
            metrics.seconds.labels(*labels).observe(time.perf_counter() - began)


def template_of(scope: Scope) -> str:
    """Return the route's path with its parameters' names: /v1/jobs/{job_id}."""
    route: BaseRoute | None = scope.get("route")
    return getattr(route, "path", NO_ROUTE)


def _method(scope: Scope) -> str:
    known = ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS")
    return scope["method"] if scope["method"] in known else "other"
