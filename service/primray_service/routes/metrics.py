"""/metrics, and what measures every request for it."""

from __future__ import annotations

import time

from fastapi import APIRouter, Request, Response
from fastapi.concurrency import run_in_threadpool
from starlette.routing import BaseRoute
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from ..metrics import RequestMetrics, exposition
from ..problems import Problem
from .access import Serving, caller_of_request
from .described import answer, described

router = APIRouter(tags=["health"])

MEDIA_TYPE = "text/plain; version=0.0.4; charset=utf-8"
NO_ROUTE = "none"


@router.get(
    "/metrics", **described(answer(content={"text/plain": {"type": "string"}}), problems=("unauthenticated", "forbidden"))
)
async def metrics(request: Request, service: Serving) -> Response:
    """For Prometheus. Where keys are needed, an admin's: the numbers are of all tenants."""
    if service.config.metrics_key and service.config.needs_keys:
        caller = await caller_of_request(request)
        if not caller.allows("admin"):
            raise Problem("forbidden", "This needs a key with the scope 'admin'.", scope="admin")
    requests: RequestMetrics = request.app.state.request_metrics
    text = await run_in_threadpool(exposition, requests, service)
    return Response(text, headers={"cache-control": "no-store"}, media_type=MEDIA_TYPE)


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
    """The route's path with its parameters' names: /v1/jobs/{job_id}."""
    route: BaseRoute | None = scope.get("route")
    return getattr(route, "path", NO_ROUTE)


def _method(scope: Scope) -> str:
    known = ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS")
    return scope["method"] if scope["method"] in known else "other"
