"""Callers as dependencies of routes: `caller: Reader` (any key with that scope), `Submitter`, `Admin`."""

from __future__ import annotations

import time
from collections.abc import Callable, Coroutine
from typing import Annotated, Any

from fastapi import Depends, Request
from fastapi.concurrency import run_in_threadpool

from ..access.auth import LOCAL, Caller, Keys, Sessions, caller_of, sha256_of, unauthenticated
from ..problems import Problem
from ..service import Service

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


def needs(scope: str) -> Callable[[Request], Coroutine[Any, Any, Caller]]:
    """Return a dependency that provides the caller if the key has this scope."""

    async def with_scope(request: Request) -> Caller:
        caller = await caller_of_request(request)
        if not caller.allows(scope):
            raise Problem("forbidden", f"This requires a key with the scope {scope!r}.", scope=scope)
        return caller

    return with_scope


Serving = Annotated[Service, Depends(service_of)]
Reader = Annotated[Caller, Depends(needs("read"))]
Submitter = Annotated[Caller, Depends(needs("submit"))]
Admin = Annotated[Caller, Depends(needs("admin"))]
