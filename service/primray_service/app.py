"""The HTTP application: which routers there are, and what surrounds them, in order.

It starts and stops nothing: server.py does, and hands over the running parts.
"""

from __future__ import annotations

from fastapi import APIRouter, FastAPI
from fastapi.routing import APIRoute

from primray import __version__

from .auth import Keys, Sessions, session_secret
from .routes import convergence, documents, events, frames, jobs, sessions, submissions
from .routes.failures import add_handlers
from .routes.guard import OriginGuard, RequestGuard
from .service import Service

# Every router there is, in the order of the document. A path is looked for from the first to the last.
ROUTERS: tuple[APIRouter, ...] = (
    submissions.router,
    jobs.router,
    events.router,
    frames.router,
    convergence.router,
    sessions.router,
    documents.router,
)


def create_app(service: Service) -> FastAPI:
    app = FastAPI(
        title="primray",
        version=__version__,
        openapi_url=None,
        docs_url=None,
        redoc_url=None,
        generate_unique_id_function=_operation_id,
    )
    app.router.redirect_slashes = False
    app.state.service = service
    app.state.keys = Keys(service.store.key_by_sha256)
    app.state.sessions = Sessions(session_secret(service.data.root / "session.secret"))
    for router in ROUTERS:
        _answer_head(router)
        app.include_router(router)
    add_handlers(app)
    # The last that is added comes first: RequestGuard, OriginGuard, then the routers.
    app.add_middleware(OriginGuard, config=service.config)
    app.add_middleware(RequestGuard)
    return app


def _operation_id(route: APIRoute) -> str:
    """jobs_show: the resource and what is done."""
    return f"{route.endpoint.__module__.rpartition('.')[2]}_{route.name}"


def _answer_head(router: APIRouter) -> None:
    """HEAD wherever GET is; the server leaves the body out."""
    for route in router.routes:
        if isinstance(route, APIRoute) and route.methods is not None and "GET" in route.methods:
            route.methods.add("HEAD")
