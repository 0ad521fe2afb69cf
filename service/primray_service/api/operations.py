"""The operations of the OpenAPI document as data: what each takes and answers, and how it is called from a shell and from
Python.

Two pages are made from it: the service's own (operations_page.py), and the site's reference of the HTTP API (docs/site).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from .schema_words import Member, Words, members, type_words

Document = Mapping[str, Any]


@dataclass(frozen=True)
class Parameter:
    name: str
    where: str  # "path", "query" or "header"
    is_required: bool
    type: Words
    text: str


@dataclass(frozen=True)
class Body:
    """A request's body; `members` are those of an object that has no name in the document, `example` is JSON, or None for a
    file."""

    media_type: str
    type: Words
    members: tuple[Member, ...]
    example: Any


@dataclass(frozen=True)
class Answer:
    """A response; `type` is empty if it has no body."""

    status: str
    text: str
    media_types: tuple[str, ...]
    type: Words
    headers: tuple[str, ...]


@dataclass(frozen=True)
class Operation:
    method: str
    path: str
    key: str  # the operationId, which is the anchor on both pages
    tag: str
    text: str
    parameters: tuple[Parameter, ...]
    bodies: tuple[Body, ...]
    answers: tuple[Answer, ...]

    @property
    def name(self) -> str:
        return f"{self.method} {self.path}"


def operations(document: Document) -> Iterator[Operation]:
    for path, methods in document["paths"].items():
        for method, one in methods.items():
            yield Operation(
                method.upper(),
                path,
                one["operationId"],
                one["tags"][0],
                one.get("description", ""),
                tuple(_parameter(each) for each in one.get("parameters", ())),
                tuple(_body(kind, each) for kind, each in one.get("requestBody", {}).get("content", {}).items()),
                tuple(_answer(document, status, each) for status, each in one["responses"].items()),
            )


def _parameter(one: Document) -> Parameter:
    text = one.get("description") or one["schema"].get("description", "")
    return Parameter(one["name"], one["in"], one.get("required", False), type_words(one["schema"]), text)


def _body(media_type: str, media: Document) -> Body:
    return Body(media_type, type_words(media["schema"]), members(media["schema"]), media.get("example"))


def _answer(document: Document, status: str, response: Document) -> Answer:
    if "$ref" in response:
        response = document["components"]["responses"][response["$ref"].rpartition("/")[2]]
    content = response.get("content", {})
    schemas = [media.get("schema", {}) for media in content.values()]
    named = next((type_words(schema) for schema in schemas if "$ref" in schema), None)
    types = named or (type_words(schemas[0]) if schemas else ())
    headers = tuple(name for name in response.get("headers", {}) if name != "X-Request-Id")  # sent with every answer
    return Answer(status, response.get("description", ""), tuple(content), types, headers)
