"""schemas/ is what the server says, and says enough of every operation."""

from __future__ import annotations

import json

import pytest
from tests.docs.openapi import FOLDER, files

TEXTS = files()
DOCUMENT = json.loads(TEXTS["openapi.json"])
OPERATIONS = [(method, path, operation) for path, methods in DOCUMENT["paths"].items() for method, operation in methods.items()]
NAMES = [f"{method} {path}" for method, path, _ in OPERATIONS]


@pytest.mark.parametrize("name", TEXTS)
def test_schemas_are_fresh(name):
    assert (FOLDER / name).read_text() == TEXTS[name], "run: .venv/bin/python -m tests.docs.openapi"


def test_nothing_else_is_in_the_folder():
    assert {path.name for path in FOLDER.glob("*.json")} >= set(TEXTS)


@pytest.mark.parametrize(("method", "path", "operation"), OPERATIONS, ids=NAMES)
def test_each_operation_says_what_it_does(method, path, operation):
    assert operation["description"].endswith((".", ":"))
    assert "HTTPValidationError" not in json.dumps(operation)
    for status, response in operation["responses"].items():
        if "$ref" in response:
            response = DOCUMENT["components"]["responses"][response["$ref"].rpartition("/")[2]]
        assert response["description"], status
        assert "X-Request-Id" in response["headers"]
        if int(status) >= 400 and method != "head" and path != "/readyz":
            assert set(response["content"]) == {"application/problem+json"}, status
    assert any(int(status) < 400 for status in operation["responses"])


def test_operation_ids_are_unique():
    ids = [operation["operationId"] for _, _, operation in OPERATIONS]
    assert len(set(ids)) == len(ids)


@pytest.mark.parametrize(("method", "path", "operation"), OPERATIONS, ids=NAMES)
def test_each_parameter_is_described(method, path, operation):
    bare = [one["name"] for one in operation.get("parameters", []) if not one.get("description")]
    assert bare == []
