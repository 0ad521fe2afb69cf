"""Callers as parameters of routes: `caller: Reader` (any key with that scope), `Submitter`, `Admin`; their request rates; and
the log of what administrators do."""

from __future__ import annotations

import time
from typing import Annotated

import structlog
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import MutableHeaders
from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from ..auth import LOCAL, Caller, Keys, Sessions, caller_of, sha256_of, unauthenticated
from ..problems import Problem
from ..quotas import RequestRates
from ..service import Service
from .parameters import Provided

COOKIE = "primray_session"


def service_of(request: Request) -> Service:
    service: Service = request.app.state.service
    return service


async def caller_of_request(request: Request) -> Caller:
    """Return the caller, determined once per request; raises Problem("unauthenticated") unless a valid key or session was sent,
    or none is needed."""
    known: Caller | None = request.scope.get("primray.caller")
    if known is None:
        known = request.scope["primray.caller"] = await _caller_of(request)
    return known


async def _caller_of(request: Request) -> Caller:
    sha256 = await _key_sha256(request)
    if sha256 is None:
        if service_of(request).config.needs_keys:
            raise unauthenticated("Send a key: Authorization: Bearer <key>.")
        return LOCAL
    keys: Keys = request.app.state.keys
    key, known = keys.remembered(sha256)
    if not known:
        key = await run_in_threadpool(keys.key, sha256)
    return caller_of(key, time.time())


async def _key_sha256(request: Request) -> str | None:
    """Return the hash of the key that was sent, or else of the session's key."""
    header = request.headers.get("authorization")
    if header is not None:
        scheme, _, key = header.partition(" ")
        if scheme.lower() != "bearer" or not key.strip():
            raise unauthenticated("The Authorization header is not of the form: Bearer <key>.")
        return sha256_of(key.strip())
    cookie = request.cookies.get(COOKIE)
    if cookie is None:
        return None
    sessions: Sessions = request.app.state.sessions
    if sessions.is_known(cookie):
        sha256 = sessions.key_sha256(cookie, time.time())
    else:
        sha256 = await run_in_threadpool(sessions.key_sha256, cookie, time.time())
    if sha256 is None and service_of(request).config.needs_keys:
        raise unauthenticated("The session has ended; log in with the key again.")
    return sha256


def needs(scope: str) -> Provided:
    """Mark a parameter that is the caller, whose key must have this scope."""

    async def with_scope(request: Request) -> Caller:
        caller = await caller_of_request(request)
        if not caller.allows(scope):
            raise Problem("forbidden", f"This requires a key with the scope {scope!r}.", scope=scope)
        return caller

    return Provided(with_scope)


Serving = Annotated[Service, Provided(service_of)]
Reader = Annotated[Caller, needs("read")]
Submitter = Annotated[Caller, needs("submit")]
Admin = Annotated[Caller, needs("admin")]


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


audit_log = structlog.get_logger()


def audit(caller: Caller, action: str, tenant: str, **about: object) -> None:
    """Log an action. `tenant` is the one concerned; `by` is the id of the administrator's key, or "local" if none is needed."""
    key = caller.key
    by = {"by": "local", "by_name": "", "by_tenant": caller.tenant}
    if key is not None:
        by = {"by": key.id, "by_name": key.name, "by_tenant": key.tenant}
    audit_log.info("audit", action=action, of_tenant=tenant, **by, **about)
