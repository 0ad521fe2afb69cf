"""Duration and size of requests, for /metrics."""

from __future__ import annotations

import time

from starlette.routing import BaseRoute
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from ..telemetry.metrics import RequestMetrics

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
