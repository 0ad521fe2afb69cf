"""/metrics for Prometheus; http/guard.py measures every request for it."""

from __future__ import annotations

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response

from ..http.callers import Serving, caller_of_request
from ..http.described import answer
from ..http.routing import Router
from ..monitoring import RequestMetrics, exposition
from ..problems import Problem

router = Router(tag="health")

MEDIA_TYPE = "text/plain; version=0.0.4; charset=utf-8"


@router.get("/metrics", answer(content={"text/plain": {"type": "string"}}), problems=("unauthenticated", "forbidden"))
async def metrics(request: Request, service: Serving) -> Response:
    """Return metrics for Prometheus. If keys are required, this needs an admin's: the numbers are of all tenants."""
    if service.config.metrics_key and service.config.needs_keys:
        caller = await caller_of_request(request)
        if not caller.allows("admin"):
            raise Problem("forbidden", "This requires a key with the scope 'admin'.", scope="admin")
    requests: RequestMetrics = request.app.state.request_metrics
    text = await run_in_threadpool(exposition, requests, service)
    return Response(text, headers={"cache-control": "no-store"}, media_type=MEDIA_TYPE)
