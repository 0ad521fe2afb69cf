"""OpenAPI descriptions of what operations take and answer: `@router.get(path, answer(views.Job), problems=(...))`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pydantic import BaseModel

from ..problems import KINDS

REF = "#/components/schemas/"
MODELS: dict[str, type[BaseModel]] = {}  # all models that are named here, for the document's components

Json = dict[str, Any]

HEADERS: Mapping[str, Json] = {
    "ETag": {"description": "Version, for If-None-Match and If-Match.", "schema": {"type": "string"}},
    "Retry-After": {"description": "Seconds to wait before the next request.", "schema": {"type": "integer", "minimum": 0}},
    "Location": {"description": "Address of the resource.", "schema": {"type": "string"}},
    "Link": {"description": 'Next page: rel="next".', "schema": {"type": "string"}},
    "Preference-Applied": {"description": "wait=<seconds>, if Prefer requested a wait.", "schema": {"type": "string"}},
    "Idempotency-Replayed": {"description": "true: an earlier request created the job.", "schema": {"type": "string"}},
    "Allow": {"description": "Methods that this path supports.", "schema": {"type": "string"}},
    "Set-Cookie": {"description": "The session.", "schema": {"type": "string"}},
    "Accept-Ranges": {"description": "bytes", "schema": {"type": "string"}},
    "Content-Range": {"description": "Range of bytes in this answer.", "schema": {"type": "string"}},
    "Content-Disposition": {"description": "File name for saving.", "schema": {"type": "string"}},
    "Repr-Digest": {"description": "sha-256 of the file (RFC 9530).", "schema": {"type": "string"}},
    "X-Request-Id": {
        "description": "The request's own id, or a new one; also in the server's log.",
        "schema": {"type": "string"},
    },
}

_TAG = {"type": "string", "examples": ['"3"']}
REQUEST_HEADERS: Mapping[str, Json] = {
    "Prefer": {
        "description": "wait=<seconds>: answer when something has changed, or after that time (RFC 7240).",
        "schema": {"type": "string", "examples": ["wait=30", "respond-async"]},
    },
    "Idempotency-Key": {
        "description": "Repeating a request with the same key within a day creates only one job.",
        "schema": {"type": "string", "pattern": "^[!-~]{1,255}$", "examples": ["3f0c1d5e-shot-010"]},
    },
    "If-None-Match": {"description": "304 if the version is still this one.", "schema": _TAG},
    "If-Match": {"description": "412 if the version is another one now.", "schema": _TAG},
    "Last-Event-ID": {
        "description": "Resume after this event.",
        "schema": {"type": "string", "pattern": "^[0-9]{1,18}$", "examples": ["17"]},
    },
    "Range": {"description": "Only these bytes (RFC 9110, 14.2).", "schema": {"type": "string", "examples": ["bytes=0-99"]}},
    "If-Range": {"description": "Apply Range only to this version; otherwise send the whole file.", "schema": _TAG},
    "Repr-Digest": {
        "description": "sha-256 of the body, which is checked (RFC 9530).",
        "schema": {"type": "string", "examples": ["sha-256=:47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU=:"]},
    },
}


@dataclass(frozen=True)
class Answer:
    status: int
    description: str
    content: Json
    headers: Sequence[str] = ()
    links: Json = field(default_factory=dict)

    def described(self) -> Json:
        return {
            "description": self.description,
            **({"content": self.content} if self.content else {}),
            "headers": {name: HEADERS[name] for name in self.headers},
            **({"links": self.links} if self.links else {}),
        }


def schema_of(model: type[BaseModel]) -> Json:
    """Return a reference to the model's schema in the document."""
    MODELS[model.__name__] = model
    return {"$ref": REF + model.__name__}


def answer(
    model: type[BaseModel] | None = None,
    status: int = 200,
    description: str = "Success.",
    *,
    headers: Sequence[str] = (),
    content: Mapping[str, Json] | None = None,
    many: bool = False,
    example: Any = None,
    links: Json | None = None,
) -> Answer:
    """Return a description of an answer: JSON of a model (`many`: a list of them), and other media types with their schemas in
    `content`."""
    kinds: Json = {media_type: {"schema": schema} for media_type, schema in (content or {}).items()}
    if model is not None:
        schema = schema_of(model)
        kinds["application/json"] = {"schema": {"type": "array", "items": schema} if many else schema}
        if example is not None:
            kinds["application/json"]["example"] = example
    return Answer(status, description, kinds, headers, links or {})


def leading_to(parameter: str, *operations: str) -> Json:
    """Return links (OpenAPI 3.1, 4.8.20) from an answer with an id to the operations that take it."""
    return {name: {"operationId": name, "parameters": {parameter: "$response.body#/id"}} for name in operations}


def json_request(model: type[BaseModel], example: Any = None, *, required: bool = True) -> Json:
    media = {"schema": schema_of(model), **({} if example is None else {"example": example})}
    return {"requestBody": {"required": required, "content": {"application/json": media}}}


def problem_response(slugs: Sequence[str]) -> Json:
    return {
        "description": "; ".join(f"{slug}: {KINDS[slug].title.lower()}" for slug in slugs),
        "content": {
            "application/problem+json": {
                "schema": {"$ref": "#/components/schemas/Problem"},
                "examples": {slug: {"$ref": f"#/components/examples/{slug}"} for slug in slugs},
            }
        },
    }
