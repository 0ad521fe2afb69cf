"""API keys, for the server's operator, and sessions of browsers.

An admin's key creates and revokes keys of any tenant. A session is a cookie that a key is exchanged for, and which is sent
where no header can be.
"""

from __future__ import annotations

import time
from dataclasses import asdict, fields
from typing import Annotated, Literal

from pydantic import Field
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response

from ..api import views
from ..api.job_json import time_text
from ..api.models import Sent, SessionRequest
from ..auth import SESSION_S, TENANT_NAME, Keys, caller_of, issue_key, sha256_of
from ..http.answers import json_answer
from ..http.bodies import json_body
from ..http.callers import COOKIE, Admin, Serving, audit
from ..http.described import answer, leading_to
from ..http.routing import Router
from ..jobs import Json
from ..limits import Quotas
from ..problems import Problem
from ..store.base import ApiKey

router = Router("/v1/keys", resource="keys", tag="keys")

MOST_EXPIRY_S = 100 * 365 * 86_400.0


class QuotaRequest(Sent):
    """Quotas of a key: omitted members are this server's defaults; null: no limit."""

    requests_per_s: float | None = Field(None, gt=0, le=1e6)
    burst: int = Field(1, ge=1, le=10**6)
    queued_jobs: int | None = Field(None, ge=0, le=10**9)
    running_jobs: int | None = Field(None, ge=0, le=10**6)
    stored_bytes: int | None = Field(None, ge=0, le=2**60)
    cpu_s_per_day: float | None = Field(None, ge=0, le=1e12)


class KeyRequest(Sent):
    tenant: str = Field(
        pattern=f"^{TENANT_NAME.pattern}$", description="Tenant whose jobs and scenes the key is for; naming one creates it."
    )
    scopes: list[Literal["submit", "read", "admin"]] = Field(default=["submit", "read"], min_length=1, max_length=3)
    name: str = Field("", max_length=200, description="Display name.")
    quotas: QuotaRequest | None = Field(None, description="Quotas; those of a tenant's newest valid key apply to the tenant.")
    expires_in_s: float | None = Field(None, gt=0, le=MOST_EXPIRY_S)


@router.post(
    "",
    answer(
        views.NewKey,
        201,
        "The key, shown once.",
        headers=("Location",),
        links=leading_to("key_id", "keys_show", "keys_revoke"),
    ),
    problems=(),
)
def create_key(
    request: Request,
    caller: Admin,
    service: Serving,
    asked: Annotated[KeyRequest, json_body(KeyRequest, {"tenant": "lighting", "scopes": ["submit", "read"], "name": "farm"})],
) -> Response:
    """Create a key. Its text is in this answer only."""
    now = time.time()
    changes = {} if asked.quotas is None else asked.quotas.model_dump(exclude_unset=True)
    quotas = Quotas(**{**asdict(service.quotas), **changes})
    expires_at = None if asked.expires_in_s is None else now + asked.expires_in_s
    row, text = issue_key(service.store, asked.tenant, asked.scopes, now, name=asked.name, quotas=quotas, expires_at=expires_at)
    audit(caller, "create-key", row.tenant, key_id=row.id, scopes=sorted(row.scopes))
    return json_answer({**key_json(row), "key": text}, 201, {"location": f"/v1/keys/{row.id}", "cache-control": "no-store"})


@router.get("", answer(views.KeyList), problems=("invalid-request",))
def list_keys(
    caller: Admin,
    service: Serving,
    tenant: Annotated[str | None, Field(max_length=64, description="Only keys of this tenant.")] = None,
) -> Response:
    """List all keys, without their text; revoked and expired ones, too."""
    return json_answer({"items": [key_json(row) for row in service.store.keys(tenant)]})


@router.get("/{key_id}", answer(views.Key), problems=("not-found",))
def show(key_id: str, caller: Admin, service: Serving) -> Response:
    """Return one key, without its text."""
    return json_answer(key_json(_found(service, key_id)))


@router.delete("/{key_id}", answer(None, 204, "The key is revoked."), problems=("not-found",))
def revoke(key_id: str, request: Request, caller: Admin, service: Serving) -> Response:
    """Revoke a key: it is refused from now on (by other servers on the same database within seconds). Its jobs and scenes
    stay."""
    row = _found(service, key_id)
    service.store.revoke_key(key_id, time.time())
    audit(caller, "revoke-key", row.tenant, key_id=key_id)
    keys: Keys = request.app.state.keys
    keys.forget()
    return Response(status_code=204)


def _found(service: Serving, key_id: str) -> ApiKey:
    row = next((row for row in service.store.keys(None) if row.id == key_id), None)
    if row is None:
        raise Problem("not-found", "There is no such key.")
    return row


def key_json(row: ApiKey) -> Json:
    return {
        "id": row.id,
        "object": "key",
        "tenant": row.tenant,
        "name": row.name,
        "prefix": row.prefix,
        "scopes": sorted(row.scopes),
        "quotas": {field.name: getattr(row.quotas, field.name) for field in fields(row.quotas)},
        "created_at": time_text(row.created_at),
        "expires_at": time_text(row.expires_at),
        "revoked_at": time_text(row.revoked_at),
    }


sessions_router = Router("/v1/session", resource="sessions", tag="keys")


@sessions_router.post(
    "", answer(views.Session, 201, "The cookie is set.", headers=("Set-Cookie",)), problems=("unauthenticated",)
)
async def begin(
    request: Request, asked: Annotated[SessionRequest, json_body(SessionRequest, {"key": "primray_..."})]
) -> Response:
    """Log a browser in: the cookie is HttpOnly, for this site only, and valid for 12 hours."""
    now = time.time()
    sha256 = sha256_of(asked.key.strip())
    caller = caller_of(await run_in_threadpool(request.app.state.keys.key, sha256), now)
    shown = {
        "tenant": caller.tenant,
        "scopes": sorted(caller.scopes),
        "expires_at": time_text(now + SESSION_S),
    }
    response = json_answer(shown, 201)
    response.set_cookie(
        COOKIE,
        request.app.state.sessions.begin(sha256, now),
        max_age=int(SESSION_S),
        path="/",
        secure=request.url.scheme == "https",
        httponly=True,
        samesite="strict",
    )
    return response


@sessions_router.delete("", answer(None, 204, "The session has ended.", headers=("Set-Cookie",)))
async def end(request: Request) -> Response:
    """Log out."""
    await run_in_threadpool(request.app.state.sessions.end, request.cookies.get(COOKIE, ""), time.time())
    response = Response(status_code=204)
    response.delete_cookie(COOKIE, path="/", httponly=True, samesite="strict")
    return response
