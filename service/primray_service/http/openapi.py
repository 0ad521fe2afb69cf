"""The OpenAPI document: FastAPI's, with our schemas, problem documents and whatever holds for every operation."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from typing import Any, Literal

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from ..api import views
from ..problems import KINDS, Problem
from .callers import COOKIE
from .described import HEADERS, MODEL, MODELS, problem_response

Json = dict[str, Any]
REF = "#/components/schemas/"
DESCRIPTION = (
    "Rendering of USD over HTTP, to a stated error: upload a scene, queue a job, watch its error fall, download its files. "
    "Every error is a problem document (RFC 9457) whose type is stable. Every GET also works as HEAD."
)
TAGS = (
    ("scenes", "USD files, uploaded once and identified by their digest."),
    ("jobs", "Render jobs: queue, watch, cancel, continue."),
    ("previews", "A job's current picture."),
    ("outputs", "Files that a job has made."),
    ("admin", "Jobs of all tenants, workers, usage and quotas, for a key with the scope admin."),
    ("keys", "API keys, and browsers' sessions."),
    ("account", "The caller's identity, usage and limits."),
    ("health", "Health of the server."),
)
# Problems that any request under /v1 may get.
ALWAYS = {
    "401": ("unauthenticated",),
    "403": ("forbidden", "cross-origin"),
    "421": ("host-not-allowed",),
    "429": ("too-many-requests",),
    "500": ("internal",),
    "503": ("unavailable",),
}
REQUEST_ID = {"X-Request-Id": {"$ref": "#/components/headers/X-Request-Id"}}
PARAMETERS = {
    "limit": "Most items of a page.",
    "cursor": "Cursor from the previous page.",
    "scene": "Only jobs of this scene.",
    "scene_id": "Id from POST /v1/scenes.",
    "key_id": "Id from POST /v1/keys.",
    "name": "Name from the list of outputs.",
    "sha256": "Digest that the file must have.",
}
METHODS = ("get", "head", "post", "put", "patch", "delete")
HEAD_TOLD = ("/v1/scenes/{scene_id}",)  # operations whose HEAD is documented separately


def openapi(app: FastAPI) -> Json:
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Duplicate Operation ID")  # GET and HEAD are one route
        found = get_openapi(
            title="primray",
            version=app.version,
            description=DESCRIPTION,
            license_info={"name": "Apache-2.0", "identifier": "Apache-2.0"},
            tags=[{"name": name, "description": text} for name, text in TAGS],
            routes=app.routes,
        )
    paths: Json = {path: dict(_operations(path, methods)) for path, methods in found["paths"].items()}
    models: list[tuple[type[BaseModel], Literal["validation"]]] = [(model, "validation") for model in MODELS.values()]
    _, definitions = models_json_schema([*models, (views.Problem, "validation")], ref_template=REF + "{model}")
    schemas = dict(sorted(definitions["$defs"].items()))
    return {
        **{name: found[name] for name in ("openapi", "info", "tags")},
        "security": [{"key": []}, {"session": []}, {}],
        "paths": _with_refs(paths),
        "components": {
            "schemas": schemas,
            "responses": {
                slugs[0]: {**problem_response(slugs), "headers": REQUEST_ID}
                for slugs in (*ALWAYS.values(), ("invalid-request",))
            },
            "examples": {slug: {"value": Problem(slug, f"{kind.title}.").as_json()} for slug, kind in KINDS.items()},
            "headers": {"X-Request-Id": HEADERS["X-Request-Id"]},
            "securitySchemes": {
                "key": {"type": "http", "scheme": "bearer", "description": "An API key; none is needed on loopback."},
                "session": {
                    "type": "apiKey",
                    "in": "cookie",
                    "name": COOKIE,
                    "description": "Session cookie from POST /v1/session.",
                },
            },
        },
    }


def _operations(path: str, methods: Json) -> Iterator[tuple[str, Json]]:
    for method in METHODS:
        operation = methods.get(method)
        if operation is None or (method == "head" and path not in HEAD_TOLD):
            continue
        yield method, _completed(path, method, operation)


def _completed(path: str, method: str, operation: Json) -> Json:
    responses: Json = {}
    for status, response in operation["responses"].items():
        if "HTTPValidationError" in str(response):
            responses[status] = _shared("invalid-request")
        else:
            responses[status] = {**response, "headers": {**response.get("headers", {}), **REQUEST_ID}}
    if path.startswith("/v1"):
        for status, slugs in ALWAYS.items():
            responses.setdefault(status, _shared(slugs[0]))
    if method == "head":
        responses = {status: _without_content(response) for status, response in responses.items()}
    for parameter in operation.get("parameters", []):
        parameter.setdefault("description", PARAMETERS.get(parameter["name"], ""))
    name = operation["operationId"]
    return {
        **operation,
        "operationId": f"{name}_head" if method == "head" else name,
        "responses": dict(sorted(responses.items())),
    }


def _shared(slug: str) -> Json:
    return {"$ref": f"#/components/responses/{slug}"}


def _without_content(response: Json) -> Json:
    """Return the answer without its content, for HEAD; a shared response has a body elsewhere."""
    if "$ref" in response:
        slug = response["$ref"].rpartition("/")[2]
        response = {"description": KINDS[slug].title, "headers": REQUEST_ID}
    return {name: member for name, member in response.items() if name != "content"}


def _with_refs(value: Any) -> Any:
    """Replace models by references."""
    if isinstance(value, dict):
        if set(value) == {MODEL}:
            return {"$ref": REF + value[MODEL]}
        return {name: _with_refs(member) for name, member in value.items()}
    return [_with_refs(member) for member in value] if isinstance(value, list) else value
