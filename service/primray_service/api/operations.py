"""The operations of the OpenAPI document as data: what each takes and answers, with types in words.

Two pages are made from it: the service's own (api/pages.py), and the site's reference of the HTTP API (docs/site).
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

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
                method=method.upper(),
                path=path,
                key=one["operationId"],
                tag=one["tags"][0],
                text=one.get("description", ""),
                parameters=tuple(_parameter(each) for each in one.get("parameters", ())),
                bodies=tuple(_body(kind, each) for kind, each in one.get("requestBody", {}).get("content", {}).items()),
                answers=tuple(_answer(document, status, each) for status, each in one["responses"].items()),
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


Schema = Mapping[str, Any]


@dataclass(frozen=True)
class Ref:
    """Reference to a schema that the document defines by name."""

    name: str


Words = tuple[str | Ref, ...]


@dataclass(frozen=True)
class Member:
    """Member of an object; `text` holds the schema's description and default."""

    name: str
    is_required: bool
    type: Words
    text: str


def type_words(schema: Schema) -> Words:
    """Return a type in words: `integer, 0 to 100`, `array of Job`, `"png" or "jpeg"`."""
    if "$ref" in schema:
        return (Ref(schema["$ref"].rpartition("/")[2]),)
    if "anyOf" in schema:
        parts = [type_words(each) for each in schema["anyOf"]]
        has_comma = any("," in word for part in parts for word in part if isinstance(word, str))
        return _joined(parts, ", or " if has_comma else " or ")
    if "const" in schema:
        return (json.dumps(schema["const"]),)
    if "enum" in schema:
        return (" or ".join(json.dumps(value) for value in schema["enum"]),)
    kind = schema.get("type", "any value")
    if "prefixItems" in schema:
        return ("[", *_joined([type_words(each) for each in schema["prefixItems"]], ", "), "]")
    if kind == "array":
        items = type_words(schema.get("items", {}))
        return ("array of ", *items, *(f", {each}" for each in _count(schema, "minItems", "maxItems", " of them")))
    if kind == "object" and isinstance(schema.get("additionalProperties"), dict) and "properties" not in schema:
        return ("object of ", *type_words(schema["additionalProperties"]))
    if schema.get("format") == "binary":
        return ("a file's bytes",)
    words = [kind, *_limits(schema), *_count(schema, "minLength", "maxLength", " characters")]
    words += [schema["format"]] if "format" in schema else []
    return (", ".join(words),)


def members(schema: Schema) -> tuple[Member, ...]:
    required = schema.get("required", ())
    return tuple(
        Member(name, name in required, type_words(each), _text(each)) for name, each in schema.get("properties", {}).items()
    )


def _text(schema: Schema) -> str:
    text = schema.get("description", "")
    default = schema.get("default")
    if default in (None, "", {}, []) or isinstance(default, dict):
        return str(text)
    return f"{text} Default: {json.dumps(default)}.".strip()


def _joined(parts: list[Words], between: str) -> Words:
    found: list[str | Ref] = []
    for number, part in enumerate(parts):
        found += [between, *part] if number else part
    return tuple(found)


def _limits(schema: Schema) -> Iterator[str]:
    low, high = schema.get("minimum"), schema.get("maximum")
    if low is not None and high is not None:
        yield f"{low:.10g} to {high:.10g}"
    elif low is not None:
        yield f"at least {low:.10g}"
    elif high is not None:
        yield f"at most {high:.10g}"
    if "exclusiveMinimum" in schema:
        yield f"more than {schema['exclusiveMinimum']:.10g}"
    if "exclusiveMaximum" in schema:
        yield f"less than {schema['exclusiveMaximum']:.10g}"


def _count(schema: Schema, least: str, most: str, what: str) -> Iterator[str]:
    low, high = schema.get(least), schema.get(most)
    if low is not None and low == high:
        yield f"{low}{what}"
    elif high is not None:
        yield f"{'' if low is None else f'{low} to '}{'at most ' if low is None else ''}{high}{what}"
