"""Conversion of exceptions from routes to problem documents: the only place where they become answers."""

from __future__ import annotations

import time

import structlog
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from ..objects import ObjectStoreFailed
from ..problems import Problem
from ..quotas import exceeded
from ..store.base import QuotaExceeded, Unavailable
from .answers import problem_answer
from .callers import caller_of_request, service_of
from .guard import request_id_of

log = structlog.get_logger("primray.http")


def add_handlers(app: Starlette) -> None:
    app.add_exception_handler(Problem, _of_problem)
    app.add_exception_handler(QuotaExceeded, _of_quota)
    app.add_exception_handler(Unavailable, _of_unavailable)
    app.add_exception_handler(ObjectStoreFailed, _of_object_store)
    app.add_exception_handler(HTTPException, _of_http)


async def _of_problem(request: Request, problem: Exception) -> Response:
    assert isinstance(problem, Problem)
    if problem.slug == "unauthenticated" and _is_opened_by_a_person(request):
        answer: Response = request.app.state.login_page(problem)
        return answer
    return problem_answer(problem, request_id_of(request))


def _is_opened_by_a_person(request: Request) -> bool:
    """Return whether a browser opens the address as a page: requests by scripts or for images have another mode."""
    is_page = "text/html" in request.headers.get("accept", "")
    return request.method == "GET" and is_page and request.headers.get("sec-fetch-mode", "navigate") == "navigate"


async def _of_quota(request: Request, error: Exception) -> Response:
    service, caller = service_of(request), await caller_of_request(request)
    usage = await run_in_threadpool(service.store.usage, caller.tenant, time.time())
    quotas = await run_in_threadpool(service.quotas_of, caller)
    return problem_answer(exceeded(str(error.args[0]), quotas, usage), request_id_of(request))


async def _of_unavailable(request: Request, error: Exception) -> Response:
    problem = Problem("unavailable", "The database does not answer.", headers={"retry-after": "5"})
    return problem_answer(problem, request_id_of(request))


async def _of_object_store(request: Request, error: Exception) -> Response:
    log.warning("the object store failed", exc_info=error)
    problem = Problem("unavailable", "The object store does not answer.", headers={"retry-after": "5"})
    return problem_answer(problem, request_id_of(request))


async def _of_http(request: Request, error: Exception) -> Response:
    """Return the answer to the framework's own errors: unknown path or method, a body that it refuses."""
    assert isinstance(error, HTTPException)
    headers = {name.lower(): value for name, value in (error.headers or {}).items()}
    if error.status_code == 404:
        problem = Problem("not-found", "There is nothing at this path.", headers=headers)
    elif error.status_code == 405:
        allowed = ", ".join(_methods_at(request))
        problem = Problem("method-not-allowed", f"Methods allowed here: {allowed}.", headers={"allow": allowed})
    elif error.status_code == 413:
        problem = Problem("request-too-large", "The body is larger than is allowed.", headers=headers)
    elif error.status_code >= 500:
        problem = Problem("internal", "The server failed.", headers=headers)
    else:
        problem = Problem("invalid-request", str(error.detail), status=error.status_code, headers=headers)
    return problem_answer(problem, request_id_of(request))


def _methods_at(request: Request) -> list[str]:
    """Return the methods of all routes that match the path; the framework names those of the first only."""
    routes = [route for route in request.app.routes if isinstance(route, Route)]
    return sorted({method for route in routes if route.path_regex.match(request.url.path) for method in route.methods or ()})
