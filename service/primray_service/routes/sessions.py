"""Sessions of browsers: a key is exchanged for a cookie, which is sent where no header can be."""

from __future__ import annotations

import time
from typing import Annotated

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response

from ..api import views
from ..api.job_json import time_text
from ..api.models import SessionRequest
from ..auth import SESSION_S, caller_of, sha256_of
from ..http.answers import json_answer
from ..http.bodies import json_body
from ..http.callers import COOKIE
from ..http.described import answer
from ..http.routing import Router

router = Router("/v1/session", tag="keys")


@router.post("", answer(views.Session, 201, "The cookie is set.", headers=("Set-Cookie",)), problems=("unauthenticated",))
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


@router.delete("", answer(None, 204, "The session has ended.", headers=("Set-Cookie",)))
async def end(request: Request) -> Response:
    """Log out."""
    await run_in_threadpool(request.app.state.sessions.end, request.cookies.get(COOKIE, ""), time.time())
    response = Response(status_code=204)
    response.delete_cookie(COOKIE, path="/", httponly=True, samesite="strict")
    return response
