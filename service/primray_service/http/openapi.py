"""The OpenAPI document of operations, with their schemas, problem documents and whatever holds for every operation."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Iterator
from typing import Literal

from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from primray import __version__

from ..api import views
from ..problems import KINDS, Problem
from .callers import COOKIE
from .described import HEADERS, MODELS, REF, REQUEST_HEADERS, Json, problem_response
from .routing import Operation

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
DOCUMENTED_HEAD = ("/v1/scenes/{scene_id}",)  # paths whose HEAD is documented separately


def openapi(operations: Iterable[Operation]) -> Json:
    models: list[tuple[type[BaseModel], Literal["validation"]]] = [(model, "validation") for model in MODELS.values()]
    _, definitions = models_json_schema([*models, (views.Problem, "validation")], ref_template=f"{REF}{{model}}")
    return {
        "openapi": "3.1.0",
        "info": {
            "title": "primray",
            "description": DESCRIPTION,
            "license": {"name": "Apache-2.0", "identifier": "Apache-2.0"},
            "version": __version__,
        },
        "tags": [{"name": name, "description": text} for name, text in TAGS],
        "security": [{"key": []}, {"session": []}, {}],
        "paths": _paths(operations),
        "components": {
            "schemas": dict(sorted(definitions["$defs"].items())),
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


def _paths(operations: Iterable[Operation]) -> Json:
    paths: dict[str, list[tuple[str, Json]]] = {}
    for one in operations:
        if one.include_in_schema:
            paths.setdefault(one.path, []).extend(_methods(one))
    return {path: dict(sorted(found, key=_order)) for path, found in paths.items()}


def _order(described: tuple[str, Json]) -> int:
    return METHODS.index(described[0])


def _methods(one: Operation) -> Iterator[tuple[str, Json]]:
    described = _described(one)
    yield one.method.lower(), described
    if one.path in DOCUMENTED_HEAD and one.method == "GET":
        responses = {status: _without_content(response) for status, response in described["responses"].items()}
        yield "head", {**described, "operationId": f"{one.id}_head", "responses": responses}


def _described(one: Operation) -> Json:
    parameters = one.parameters.described()
    for parameter in parameters:
        parameter.setdefault("description", PARAMETERS.get(parameter["name"], ""))
    headers = [{"name": name, "in": "header", "required": False, **REQUEST_HEADERS[name]} for name in one.headers]
    responses = _responses(one)
    if parameters:
        responses.setdefault("422", _shared("invalid-request"))
    return {
        "tags": [one.tag],
        "summary": one.name.replace("_", " ").title(),
        "description": inspect.getdoc(one.handler),
        "operationId": one.id,
        **({"parameters": parameters + headers} if parameters or headers else {}),
        **one.body,
        "responses": dict(sorted(responses.items())),
    }


def _responses(one: Operation) -> Json:
    responses: Json = {str(answer.status): answer.described() for answer in one.answers}
    for slug in one.problems:
        status = str(KINDS[slug].status)
        responses[status] = problem_response([each for each in one.problems if str(KINDS[each].status) == status])
    for response in responses.values():
        response["headers"] = {**response.get("headers", {}), **REQUEST_ID}
    if one.path.startswith("/v1"):
        for status, slugs in ALWAYS.items():
            responses.setdefault(status, _shared(slugs[0]))
    return responses


def _shared(slug: str) -> Json:
    return {"$ref": f"#/components/responses/{slug}"}


def _without_content(response: Json) -> Json:
    """Return the answer without its content, for HEAD; a shared response has a body elsewhere."""
    if "$ref" in response:
        slug = response["$ref"].rpartition("/")[2]
        response = {"description": KINDS[slug].title, "headers": REQUEST_ID}
    return {name: member for name, member in response.items() if name != "content"}
