"""Problem documents (RFC 9457): the table of all kinds, and the exception that carries one.

`type` is "/problems/<slug>", stable, and the path of its documentation on the same server.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Kind:
    status: int
    title: str
    retryable: bool = False


KINDS: Mapping[str, Kind] = {
    # Requests
    "invalid-request": Kind(422, "The request is not valid"),
    "invalid-json": Kind(400, "The body is not JSON"),
    "not-found": Kind(404, "There is nothing here"),
    "method-not-allowed": Kind(405, "This cannot be done here"),
    "not-acceptable": Kind(406, "None of the accepted media types is offered"),
    "unsupported-media-type": Kind(415, "The body's media type is not supported"),
    "range-not-satisfiable": Kind(416, "The range is outside the file"),
    "precondition-failed": Kind(412, "The resource has changed since it was read"),
    "conflict": Kind(409, "The resource's state does not allow this"),
    "idempotency-key-reused": Kind(422, "This Idempotency-Key was used with another request"),
    "scene-in-use": Kind(409, "Jobs use this scene"),
    "digest-mismatch": Kind(422, "The body does not have the digest that was sent with it"),
    "upload-too-large": Kind(413, "The body is larger than is allowed"),
    "request-too-large": Kind(413, "The request's JSON is larger than is allowed"),
    "upload-incomplete": Kind(400, "The body ended before it was complete"),
    "limit-exceeded": Kind(422, "The request exceeds a limit"),
    "unsupported-setting": Kind(422, "This setting is not supported"),
    "parallel-denoise": Kind(422, "A parallel job cannot stop at its denoised picture's error"),
    "parallel-adaptive": Kind(422, "A parallel job cannot be sampled adaptively"),
    "view-unavailable": Kind(422, "There is no such view of this picture"),
    "webhook-address": Kind(422, "The webhook's address may not be called"),
    "host-not-allowed": Kind(421, "This server does not answer for that host"),
    "cross-origin": Kind(403, "The request comes from another site"),
    # Callers
    "unauthenticated": Kind(401, "A valid API key is needed"),
    "forbidden": Kind(403, "The key's scopes do not allow this"),
    "too-many-requests": Kind(429, "Too many requests", retryable=True),
    "quota-exceeded": Kind(429, "A quota is exhausted", retryable=True),
    # Packages
    "not-usd": Kind(422, "The file is not USD"),
    "ambiguous-entry": Kind(422, "The package has several root layers; name one"),
    "entry-missing": Kind(422, "The package has no such layer"),
    "package-unsafe": Kind(422, "The package has a member that is not allowed"),
    "package-too-large": Kind(422, "The package unpacks to more than is allowed"),
    # Scenes
    "asset-path-outside-job": Kind(422, "The scene refers to a file outside the upload"),
    "asset-missing": Kind(422, "A file that the scene needs was not uploaded"),
    "layer-unreadable": Kind(422, "A layer cannot be read"),
    "scene-rejected": Kind(422, "The scene cannot be rendered"),
    "scene-too-large": Kind(422, "The scene exceeds a limit"),
    "settings-rejected": Kind(422, "The scene does not allow these settings"),
    "strict-warnings": Kind(422, "The scene has warnings, and strict or fail_on refuses them"),
    # Renders
    "time-limit": Kind(422, "The render took longer than is allowed"),
    "memory-limit": Kind(422, "The render needs more memory than is allowed"),
    "storage-limit": Kind(422, "The render wrote more than is allowed"),
    "renderer-crashed": Kind(500, "The render process crashed"),
    "render-failed": Kind(500, "The render process failed"),
    "checkpoint-unusable": Kind(500, "The render cannot resume from its checkpoint"),
    "job-expired": Kind(422, "The job did not finish within its time to live"),
    # Server
    "storage-full": Kind(507, "The server's disk is full", retryable=True),
    "unavailable": Kind(503, "The server cannot do this now", retryable=True),
    "internal": Kind(500, "The server failed", retryable=True),
}


class Problem(Exception):
    """An error answer; `extra` are further members of the document."""

    def __init__(
        self, slug: str, detail: str, *, status: int | None = None, headers: Mapping[str, str] | None = None, **extra: Any
    ) -> None:
        super().__init__(f"{slug}: {detail}")
        self.slug = slug
        self.detail = detail
        self.status = KINDS[slug].status if status is None else status
        self.headers = dict(headers or {})
        self.extra = extra

    def as_json(self) -> dict[str, Any]:
        kind = KINDS[self.slug]
        return {
            "type": f"/problems/{self.slug}",
            "title": kind.title,
            "status": self.status,
            "detail": self.detail,
            "retryable": kind.retryable,
            **self.extra,
        }


def problem_of(document: Mapping[str, Any]) -> Problem:
    """Return the exception for a stored document."""
    slug = str(document["type"]).removeprefix("/problems/")
    extra = {k: v for k, v in document.items() if k not in ("type", "title", "status", "detail", "retryable")}
    return Problem(slug, str(document["detail"]), status=int(document["status"]), **extra)
