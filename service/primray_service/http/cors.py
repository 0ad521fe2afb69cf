"""CORS for pages of other origins that the configuration allows (by Starlette's middleware).

Their requests carry a key in the Authorization header. Cookies are excluded: the page's session is for this server's own pages.
"""

from __future__ import annotations

from fastapi import FastAPI
from starlette.middleware.cors import CORSMiddleware

from ..config import ServeConfig

METHODS = ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE")
SENT = (
    "authorization",
    "content-type",
    "idempotency-key",
    "if-match",
    "if-none-match",
    "if-range",
    "last-event-id",
    "prefer",
    "range",
    "repr-digest",
    "traceparent",
    "tracestate",
    "x-request-id",
)
READ = (
    "accept-ranges",
    "content-disposition",
    "content-range",
    "etag",
    "idempotency-replayed",
    "link",
    "location",
    "preference-applied",
    "preview-view",
    "ratelimit",
    "ratelimit-policy",
    "repr-digest",
    "retry-after",
    "x-request-id",
)
KNOWN_FOR_S = 600  # time for which a browser caches the permission


def allow_origins(app: FastAPI, config: ServeConfig) -> None:
    """Add the middleware if origins are allowed; otherwise the server answers as if there were no CORS."""
    if config.allowed_origins:
        app.add_middleware(
            CORSMiddleware,
            allow_origins=config.allowed_origins,
            allow_methods=METHODS,
            allow_headers=SENT,
            expose_headers=READ,
            allow_credentials=False,
            max_age=KNOWN_FOR_S,
        )
