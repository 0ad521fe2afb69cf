"""A route's parameters by its handler's signature: their values, what is wrong with them, their description."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import pytest
from pydantic import BaseModel, Field
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.testclient import TestClient

from primray_service.app import add_handlers
from primray_service.http.bodies import json_body
from primray_service.http.described import answer
from primray_service.http.openapi import openapi
from primray_service.http.parameters import Provided
from primray_service.http.routing import Router, path_of
from primray_service.problems import Problem


class Asked(BaseModel):
    size: int


def user(request: Request) -> str:
    if "user" not in request.headers:
        raise Problem("unauthenticated", "Who asks?")
    return request.headers["user"]


router = Router("/things", resource="things", tag="jobs")


@router.get("/{number}", answer(Asked), problems=("not-found",))
async def show(
    caller: Annotated[str, Provided(user)],
    number: Annotated[int, Field(ge=0)],
    order: Literal["up", "down"] = "up",
    label: Annotated[list[str] | None, Field(max_length=2, description="Labels.")] = None,
    limit: int | None = None,
) -> Response:
    """Show what was understood."""
    return JSONResponse([caller, number, order, label, limit])


@router.put("/{number}", answer(Asked))
def change(number: int, asked: Annotated[Asked, json_body(Asked, {"size": 1})]) -> Response:
    """Change it."""
    return JSONResponse([number, asked.size])


@router.get("/{number}/picture")
def picture(number: int) -> Response:
    return Response()


@pytest.fixture
def client() -> TestClient:
    app = Starlette(routes=router.operations)
    add_handlers(app)
    return TestClient(app, headers={"user": "ada"})


def document() -> Any:
    return openapi(router.operations)["paths"]


def test_values_come_from_the_path_the_query_and_the_request(client: TestClient) -> None:
    assert client.get("/things/7").json() == ["ada", 7, "up", None, None]
    query = "?order=down&label=a&label=b&limit=1&limit=2&unknown=1"
    assert client.get(f"/things/7{query}").json() == ["ada", 7, "down", ["a", "b"], 2]


def test_all_that_is_wrong_is_reported_the_path_first(client: TestClient) -> None:
    found = client.get("/things/-1?order=dwon&label=a&label=b&label=c&limit=x")
    assert found.status_code == 422
    errors = found.json()["errors"]
    assert [(one["member"], one["in"]) for one in errors] == [
        ("number", "path"),
        ("order", "query"),
        ("label", "query"),
        ("limit", "query"),
    ]
    assert found.json()["detail"] == "number in the path: Input should be greater than or equal to 0."
    assert errors[1]["detail"].endswith("did you mean down?")


def test_a_caller_who_is_refused_learns_nothing_about_the_other_parameters(client: TestClient) -> None:
    client.headers.pop("user")
    assert client.get("/things/x?limit=y").status_code == 401


def test_head_is_answered_and_all_methods_of_a_path_are_named(client: TestClient) -> None:
    assert client.head("/things/7").status_code == 200
    assert client.delete("/things/7").headers["allow"] == "GET, HEAD, PUT"


def test_the_document_has_parameters_and_bodies_as_the_signature_has_them() -> None:
    paths = document()
    assert list(paths) == ["/things/{number}"]  # a route without answers is not documented
    parameters = {one["name"]: one for one in paths["/things/{number}"]["get"]["parameters"]}
    assert [(name, one["in"], one["required"]) for name, one in parameters.items()] == [
        ("number", "path", True),
        ("order", "query", False),
        ("label", "query", False),
        ("limit", "query", False),
    ]
    assert parameters["label"]["description"] == "Labels."
    assert parameters["order"]["schema"]["default"] == "up"
    assert "default" not in parameters["limit"]["schema"]
    put = paths["/things/{number}"]["put"]
    assert put["requestBody"]["content"]["application/json"]["example"] == {"size": 1}
    assert {"400", "413", "415", "422"} <= set(put["responses"])


def test_the_path_of_a_request_is_the_declared_one() -> None:
    scope = {"type": "http", "method": "GET", "path": "/things/7/picture"}
    assert path_of(router.operations, scope) == "/things/{number}/picture"
    assert path_of(router.operations, scope | {"path": "/nothing"}) == ""
