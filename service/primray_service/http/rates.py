"""Request rates of keys: a dependency of all of /v1 that takes a token, and headers with the remaining allowance."""

from __future__ import annotations

import structlog
from fastapi import Request
from fastapi.concurrency import run_in_threadpool
from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from ..access.quotas import RequestRates
from ..problems import Problem
from .callers import caller_of_request, service_of

HEADERS = "primray.rate_headers"


async def spend_request(request: Request) -> None:
    """Take a token; raises Problem("too-many-requests") if the key's bucket is empty. Callers without a key (on loopback) have
    no bucket."""
    try:
        caller = await caller_of_request(request)
    except Problem:
        return  # the route reports it, if it needs a key at all
    structlog.contextvars.bind_contextvars(**_whose(request, caller.tenant))
    if caller.key is None:
        return
    rates: RequestRates = request.app.state.rates
    service = service_of(request)
    if service.tenant_quotas.is_known(caller.tenant):
        quotas = service.quotas_of(caller)
    else:
        quotas = await run_in_threadpool(service.quotas_of, caller)
    allowance = rates.take(caller.key.id, quotas)
    if allowance is None:
        return
    if not allowance.is_allowed:
        raise allowance.problem()
    request.scope[HEADERS] = allowance.headers()


def _whose(request: Request, tenant: str) -> dict[str, str]:
    """Return the fields that every log line about this request has."""
    found = {"tenant": tenant}
    if "job_id" in request.path_params:
        found["job_id"] = request.path_params["job_id"][:64]
    return found


class RateHeaders:
    """Adds the allowance found by `spend_request` to the answer."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start" and HEADERS in scope:
                MutableHeaders(scope=message).update(scope[HEADERS])
            await send(message)

        await self._app(scope, receive, send_with_headers if scope["type"] == "http" else send)
