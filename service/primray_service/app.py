"""The HTTP application: its operations, and the middleware around them, in order.

It starts and stops nothing: server.py does, and passes in the running parts.
"""

from __future__ import annotations

from starlette.applications import Starlette

from .auth import Keys, Sessions, session_secret
from .http.callers import RateHeaders
from .http.failures import add_handlers
from .http.guard import Measured, OriginGuard, RequestGuard, allow_origins
from .http.routing import Operation, Router, path_of
from .monitoring import RequestMetrics, instrument
from .quotas import RequestRates
from .routes import account, admin_jobs, admin_tenants, documents, health, keys, packages, page, scenes
from .routes.jobs import events, frames, interventions, jobs, outputs, previews, submissions
from .service import Service

# All routers, in the document's order. The first one with a matching path answers.
ROUTERS: tuple[Router, ...] = (
    scenes.router,
    packages.router,
    submissions.router,
    jobs.router,
    interventions.router,
    events.router,
    frames.router,
    frames.convergence_router,
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
