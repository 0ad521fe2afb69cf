"""The API's own documents: openapi.json, a page that shows it, and a page for each kind of problem."""

from __future__ import annotations

import hashlib

from starlette.requests import Request
from starlette.responses import Response

from ..api.reference import operations_page, problem_page, problems_page
from ..http.answers import json_bytes, none_match, not_modified
from ..http.openapi import openapi
from ..http.routing import Router
from ..problems import KINDS, Problem

router = Router(resource="documents")

# Nothing external is loaded. The forms of /docs send requests to this server only; blob: is for pictures in its answers.
CSP = "default-src 'none'; style-src 'self'; img-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
CSP_OF_DOCS = CSP.replace("img-src 'self'", "img-src 'self' blob:; script-src 'self'; connect-src 'self'")


@router.get("/openapi.json")
async def document(request: Request) -> Response:
    """Return the OpenAPI document of this server."""
    body, etag = _document(request)
    if not none_match(request, etag):
        return not_modified(etag)
    return Response(body, headers={"etag": etag, "cache-control": "no-cache"}, media_type="application/json")


def _document(request: Request) -> tuple[bytes, str]:
    """Return the document and its ETag; made once."""
    state = request.app.state
    if not hasattr(state, "openapi"):
        body = json_bytes(openapi(request.app.routes))
        state.openapi = (body, f'"{hashlib.sha256(body).hexdigest()[:32]}"')
    made: tuple[bytes, str] = state.openapi
    return made


@router.get("/docs")
async def docs(request: Request) -> Response:
    """Return the OpenAPI document as a page to read and try."""
    return _html(operations_page(openapi(request.app.routes)), CSP_OF_DOCS)


@router.get("/problems")
async def problems() -> Response:
    """List every kind of problem."""
    return _html(problems_page())


@router.get("/problems/{slug}")
async def problem(slug: str) -> Response:
    """Return the page of a problem's `type`."""
    if slug not in KINDS:
        raise Problem("not-found", "There is no such kind of problem.")
    return _html(problem_page(slug))


def _html(text: str, policy: str = CSP) -> Response:
    return Response(text, headers={"content-security-policy": policy, "cache-control": "no-cache"}, media_type="text/html")
