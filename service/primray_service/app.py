"""The HTTP application: its routers, and the middleware around them, in order.

It starts and stops nothing: server.py does, and passes in the running parts.
"""

from __future__ import annotations

from fastapi import APIRouter, Depends, FastAPI
from fastapi.routing import APIRoute

from primray import __version__

from .access.auth import Keys, Sessions, session_secret
from .access.quotas import RequestRates
from .http.callers import RateHeaders, spend_request
from .http.failures import MethodsByPath, add_handlers
from .http.guard import OriginGuard, RequestGuard, allow_origins
from .http.measured import Measured
from .routes import account, documents, health, keys, metrics, packages, page, scenes, sessions
from .routes.admin import jobs as admin_jobs
from .routes.admin import tenants as admin_tenants
from .routes.admin import workers as admin_workers
from .routes.jobs import convergence, events, frames, interventions, jobs, logs, outputs, previews, submissions
from .service import Service
from .telemetry.metrics import RequestMetrics
from .telemetry.tracing import instrument

# All routers, in the document's order. The first one with a matching path answers.
ROUTERS: tuple[APIRouter, ...] = (
    scenes.router,
    packages.router,
    submissions.router,
    jobs.router,
    interventions.router,
    events.router,
    frames.router,
    convergence.router,
    previews.router,
    outputs.router,
    logs.router,
    keys.router,
    admin_jobs.router,
    admin_tenants.router,
    admin_workers.router,
    sessions.router,
    account.router,
    health.router,
    metrics.router,
    documents.router,
    page.router,
)


def create_app(service: Service) -> FastAPI:
    app = create_routes()
    app.state.service = service
    app.state.keys = Keys(service.store.key_by_sha256)
    app.state.sessions = Sessions(shared_secret(service), service.store)
    app.state.rates = RequestRates()
    app.state.request_metrics = RequestMetrics()
    app.state.methods = MethodsByPath(ROUTERS)
    app.state.login_page = page.login_page
    add_handlers(app)
    # The middleware that is added last runs first: Measured, RequestGuard, CORS, OriginGuard, RateHeaders, then the routers.
    app.add_middleware(RateHeaders)
    app.add_middleware(OriginGuard, config=service.config)
    allow_origins(app, service.config)
    app.add_middleware(RequestGuard)
    app.add_middleware(Measured, metrics=app.state.request_metrics)
    instrument(app)
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


def create_routes() -> FastAPI:
    """Return an application with the operations alone: enough for the OpenAPI document."""
    app = FastAPI(
        title="primray",
        version=__version__,
        openapi_url=None,
        docs_url=None,
        redoc_url=None,
        generate_unique_id_function=_operation_id,
    )
    app.router.redirect_slashes = False
    for router in ROUTERS:
        _answer_head(router)
        limited = [Depends(spend_request)] if router.prefix.startswith("/v1") else []
        app.include_router(router, dependencies=limited)
    return app


def _operation_id(route: APIRoute) -> str:
    """Return the operation id, resource and action: jobs_show, admin_jobs_show."""
    module = route.endpoint.__module__.rpartition("primray_service.routes.")[2]
    resource = module.removeprefix("jobs.").replace(".", "_")
    return f"{resource}_{route.name}"


def _answer_head(router: APIRouter) -> None:
    """Answer HEAD wherever GET is answered; the server leaves the body out."""
    for route in router.routes:
        if isinstance(route, APIRoute) and route.methods is not None and "GET" in route.methods:
            route.methods.add("HEAD")
