"""Liveness and readiness of the server, for supervisors, without a key; and /metrics for Prometheus.

http/guard.py measures every request for the metrics.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable

import structlog
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response

from ..api import views
from ..http.answers import json_answer
from ..http.callers import Serving, caller_of_request
from ..http.described import answer
from ..http.routing import Router
from ..jobs import Json
from ..monitoring import RequestMetrics, exposition
from ..problems import Problem
from ..service import Service

log = structlog.get_logger("primray.health")
router = Router(resource="health", tag="health")

CHECK_TIMEOUT_S = 5.0


@router.get("/healthz", answer(views.Health))
async def alive() -> Response:
    """Return 200 while the process answers; nothing else is checked."""
    return json_answer({"status": "ok"}, headers={"cache-control": "no-store"})


@router.get(
    "/readyz",
    answer(views.Readiness, description="Everything works."),
    answer(views.Readiness, 503, "Something does not work, or the server is stopping."),
)
async def ready(service: Serving) -> Response:
    """Return the state of database, disk, executor and sandbox, with the reason if one is not in order (503); and which of the
    servers on the database dispatches."""
    names: dict[str, Callable[[Service], Awaitable[Json]]] = {
        "database": _database,
        "disk": _disk,
        "executor": _executor,
        "sandbox": _sandbox,
        "dispatcher": _dispatcher,
    }
    found = await asyncio.gather(*(_checked(check, service) for check in names.values()))
    checks = dict(zip(names, found, strict=True))
    is_ready = all(check["ok"] for check in checks.values()) and not service.changes.closing
    found_now = {"status": "ready" if is_ready else "stopping" if service.changes.closing else "not ready", "checks": checks}
    return json_answer(found_now, 200 if is_ready else 503, {"cache-control": "no-store"})


async def _checked(check: Callable[[Service], Awaitable[Json]], service: Service) -> Json:
    """Return a check's result; never raises. Only the error's type is reported: its text may contain hosts and users of a
    database."""
    began = time.perf_counter()
    try:
        async with asyncio.timeout(CHECK_TIMEOUT_S):
            found = await check(service)
    except TimeoutError:
        found = {"ok": False, "detail": f"no answer within {CHECK_TIMEOUT_S:g} s"}
    except Exception as error:
        log.warning("not ready", check=check.__name__.strip("_"), exc_info=error)
        found = {"ok": False, "detail": f"it fails with {type(error).__name__}; see the server's log"}
    return {**found, "seconds": round(time.perf_counter() - began, 4)}


async def _database(service: Service) -> Json:
    await run_in_threadpool(service.store.check)
    return {"ok": True, "detail": service.config.database_url.partition(":")[0].partition("+")[0]}


async def _disk(service: Service) -> Json:
    free = await run_in_threadpool(service.data.free_bytes)
    least = service.limits.free_disk_bytes
    if service.data.objects is not None:
        await run_in_threadpool(service.data.objects.check)
    return {"ok": free >= least, "detail": f"{free} bytes are free; {least} are kept free", "free_bytes": free}


async def _executor(service: Service) -> Json:
    if not service.config.dispatch:
        return {"ok": True, "detail": "this server does not render; others do"}
    health = service.executor.health()
    return {"ok": bool(health["ok"]), "detail": str(health.get("why", "ready")), **_rest(health)}


def _rest(health: Json) -> Json:
    return {name: value for name, value in health.items() if name not in ("ok", "why", "detail", "sandbox")}


async def _sandbox(service: Service) -> Json:
    """Return the results of the sandbox's self-test at the server's start."""
    found = service.self_test
    if found is None:
        return {"ok": True, "detail": "this server runs no workers", "layers": {}, "attempts": {}}
    is_waived = not found.ok and service.config.allow_unsandboxed
    detail = (
        "holds" if found.ok else f"{found.problem or 'does not hold'}{'; waived by --allow-unsandboxed' if is_waived else ''}"
    )
    return {"ok": found.ok or is_waived, "detail": detail, "layers": found.layers, "attempts": found.attempts}


LEADS = {
    "here": "this server dispatches",
    "elsewhere": "another server dispatches",
    "nowhere": "no server dispatches now; a server that may dispatch takes over within seconds",
}


async def _dispatcher(service: Service) -> Json:
    """Return which server dispatches. No dispatcher is no reason to use another server: reading works, and submitted jobs
    wait."""
    where = (await run_in_threadpool(service.who_leads.now)).where
    return {"ok": True, "detail": LEADS[where], "leads": where}


metrics_router = Router(resource="metrics", tag="health")

MEDIA_TYPE = "text/plain; version=0.0.4; charset=utf-8"


@metrics_router.get("/metrics", answer(content={"text/plain": {"type": "string"}}), problems=("unauthenticated", "forbidden"))
async def metrics(request: Request, service: Serving) -> Response:
    """Return metrics for Prometheus. If keys are required, this needs an admin's: the numbers are of all tenants."""
    if service.config.metrics_key and service.config.needs_keys:
        caller = await caller_of_request(request)
        if not caller.allows("admin"):
            raise Problem("forbidden", "This requires a key with the scope 'admin'.", scope="admin")
    requests: RequestMetrics = request.app.state.request_metrics
    text = await run_in_threadpool(exposition, requests, service)
    return Response(text, headers={"cache-control": "no-store"}, media_type=MEDIA_TYPE)
