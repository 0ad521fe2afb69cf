"""The HTTP application: its operations, the middleware around them, in order, and the answers to exceptions.

It starts and stops nothing: server.py does, and passes in the running parts. Exceptions from routes become problem documents
here and nowhere else.
"""

from __future__ import annotations

import time

import structlog
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from .auth import Keys, Sessions, session_secret
from .http.answers import problem_answer
from .http.callers import RateHeaders, caller_of_request, service_of
from .http.guard import Measured, OriginGuard, RequestGuard, allow_origins, request_id_of
from .http.routing import Operation, Router, path_of
from .monitoring import RequestMetrics, instrument
from .objects import ObjectStoreFailed
from .problems import Problem
from .quotas import RequestRates, exceeded
from .routes import account, admin_jobs, admin_tenants, documents, health, keys, packages, page, scenes
from .routes.jobs import events, explanations, frames, jobs, outputs, previews, submissions
from .service import Service
from .store.base import QuotaExceeded, Unavailable

# All routers, in the document's order. The first one with a matching path answers.
ROUTERS: tuple[Router, ...] = (
    scenes.router,
    packages.router,
    submissions.router,
    jobs.router,
    jobs.interventions_router,
    events.router,
    frames.router,
    frames.convergence_router,
    explanations.router,
    previews.router,
    outputs.router,
    frames.log_router,
    keys.router,
    admin_jobs.router,
    admin_tenants.router,
    admin_jobs.workers_router,
    keys.sessions_router,
    account.router,
    health.router,
    health.metrics_router,
    documents.router,
    page.router,
)


def operations() -> list[Operation]:
    return [operation for router in ROUTERS for operation in router.operations]


def create_app(service: Service) -> Starlette:
    app = Starlette(routes=operations())
    app.router.redirect_slashes = False
    app.state.service = service
    app.state.keys = Keys(service.store.key_by_sha256)
    app.state.sessions = Sessions(shared_secret(service), service.store)
    app.state.rates = RequestRates()
    app.state.request_metrics = RequestMetrics()
    app.state.login_page = page.login_page
    add_handlers(app)
    # The middleware that is added last runs first: Measured, RequestGuard, CORS, OriginGuard, RateHeaders, then the routes.
    app.add_middleware(RateHeaders)
    app.add_middleware(OriginGuard, config=service.config)
    allow_origins(app, service.config)
    app.add_middleware(RequestGuard)
    app.add_middleware(Measured, metrics=app.state.request_metrics)
    instrument(app, lambda scope: path_of(app.routes, scope))
    return app


def shared_secret(service: Service) -> bytes:
    """Return the secret that is shared by all servers on the same data."""
    path = service.data.root / "session.secret"
    if service.data.objects is None:
        return session_secret(path)
    with service.store.exclusive("session secret"):
        service.data.bring_newest(path)
        secret = session_secret(path)
        service.data.share(path)
    return secret


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
