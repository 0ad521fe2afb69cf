"""The API's own documents: openapi.json, a page that shows it, and a page for each kind of problem."""

from __future__ import annotations

import hashlib

from fastapi import APIRouter, Request, Response

from ..api.operations_page import operations_page
from ..api.pages import problem_page, problems_page
from ..http.answers import json_bytes, none_match, not_modified
from ..http.openapi import openapi
from ..problems import KINDS, Problem

router = APIRouter(include_in_schema=False)

# Nothing from elsewhere. What the forms of /docs send goes to this server alone; blob: is for pictures that it answered.
CSP = "default-src 'none'; style-src 'self'; img-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
CSP_OF_DOCS = CSP.replace("img-src 'self'", "img-src 'self' blob:; script-src 'self'; connect-src 'self'")


@router.get("/openapi.json")
async def document(request: Request) -> Response:
    """The OpenAPI document of this server."""
    body, etag = _document(request)
    if not none_match(request, etag):
        return not_modified(etag)
    return Response(body, headers={"etag": etag, "cache-control": "no-cache"}, media_type="application/json")


def _document(request: Request) -> tuple[bytes, str]:
    """Made once."""
    state = request.app.state
    if not hasattr(state, "openapi"):
        body = json_bytes(openapi(request.app))
        state.openapi = (body, f'"{hashlib.sha256(body).hexdigest()[:32]}"')
    made: tuple[bytes, str] = state.openapi
    return made


@router.get("/docs")
async def docs(request: Request) -> Response:
    """The OpenAPI document, to be read and tried by people."""
    return _html(operations_page(openapi(request.app)), CSP_OF_DOCS)


@router.get("/problems")
async def problems() -> Response:
    """Every kind of problem."""
    return _html(problems_page())


@router.get("/problems/{slug}")
async def problem(slug: str) -> Response:
    """What a problem's `type` leads to."""
    if slug not in KINDS:
        raise Problem("not-found", "There is no such kind of problem.")
    return _html(problem_page(slug))


def _html(text: str, policy: str = CSP) -> Response:
    return Response(text, headers={"content-security-policy": policy, "cache-control": "no-cache"}, media_type="text/html")
