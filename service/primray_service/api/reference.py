"""The API's reference: every operation with what it takes and answers, and a page for each kind of problem.

The operations of the OpenAPI document are data, with types in words. Two pages are made from them: the service's own, here,
and the site's reference of the HTTP API (docs/site). Operations have examples in curl and Python; page/docs/ adds a form to
each that sends it, and page/style/ has the styles. The pages are readable without scripts. Nothing here knows HTTP.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from html import escape
from typing import Any

from ..problems import KINDS, Problem

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


FRAME = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="dark light">
<title>{title} · primray</title>
<link rel="icon" href="/page/favicon.svg" type="image/svg+xml">
<link rel="stylesheet" href="/page/style/base.css">
<link rel="stylesheet" href="/page/style/docs.css">
{script}
<body class="docs">
<a class="skip" href="#main">To the content</a>
<header class="top">
  <a class="brand" href="/"><img src="/page/favicon.svg" alt="" width="24" height="24">primray</a>
  <nav aria-label="Pages"><a href="/docs">API</a><a href="/problems">Problems</a><a href="/openapi.json">openapi.json</a></nav>
</header>
<main id="main" tabindex="-1"><h1>{title}</h1>{body}</main>
<div id="say" class="unseen" role="status" aria-live="polite"></div>
</body>
</html>
"""


def page(title: str, body: str, script: str = "") -> str:
    """Return a page; `script` is the address of one of the page's modules."""
    loaded = f'<script src="{script}" type="module"></script>' if script else ""
    return FRAME.format(title=escape(title), body=body, script=loaded)


def table(heads: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    lines = ("".join(f"<td>{cell}</td>" for cell in row) for row in rows)
    head = "".join(f'<th scope="col">{text}</th>' for text in heads)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(f'<tr>{line}</tr>' for line in lines)}</tbody></table>"


def problems_page() -> str:
    rows = (
        (f'<a href="/problems/{slug}"><code>{slug}</code></a>', str(kind.status), escape(kind.title))
        for slug, kind in KINDS.items()
    )
    return page("Problems", table(("type", "status", "title"), rows))


def problem_page(slug: str) -> str:
    kind = KINDS[slug]
    example = Problem(slug, f"{kind.title}.").as_json()
    again = "The same request may succeed later." if kind.retryable else "The same request will fail again."
    return page(
        slug,
        f"<p>{escape(kind.title)}. Status {kind.status}. {again}</p>"
        "<p><code>detail</code> says what was wrong this time; <code>member</code>, where there is one, which part of the "
        "request was at fault; <code>request_id</code> is in the server's log.</p>"
        f"<pre>{escape(json.dumps(example, indent=2, ensure_ascii=False))}</pre><p><a href='/problems'>All problems</a></p>",
    )


SCRIPT = "/page/docs/try_it.js"


def operations_page(document: Document) -> str:
    found = list(operations(document))
    descriptions = {tag["name"]: tag["description"] for tag in document["tags"]}
    groups = [(tag, [one for one in found if one.tag == tag]) for tag in descriptions]
    index = "".join(_index(tag, group) for tag, group in groups)
    sections = "".join(_group(tag, descriptions[tag], group) for tag, group in groups)
    schemas = "".join(
        f'<details id="schema-{name}"><summary><code>{name}</code></summary><p>{_text_html(schema.get("description", ""))}</p>'
        f"{_members(members(schema))}</details>"
        for name, schema in document["components"]["schemas"].items()
    )
    return page(
        "API",
        f"<p>{escape(document['info']['description'])}</p>"
        '<div id="key"></div>'
        f'<nav class="index" aria-label="Operations">{index}</nav>'
        f'{sections}<section class="group"><h2>Schemas</h2>{schemas}</section>',
        script=SCRIPT,
    )


def _index(tag: str, group: Iterable[Operation]) -> str:
    links = "".join(f'<li><a href="#{one.key}">{_name(one)}</a></li>' for one in group)
    return f"<div><h2>{escape(tag.capitalize())}</h2><ul>{links}</ul></div>"


def _group(tag: str, text: str, group: Iterable[Operation]) -> str:
    found = "".join(map(_operation, group))
    return f'<section class="group"><h2>{escape(tag.capitalize())}</h2><p>{escape(text)}</p>{found}</section>'


def _operation(one: Operation) -> str:
    parameters = (
        (
            f"<code>{escape(each.name)}</code>",
            f"{each.where}{', required' if each.is_required else ''}",
            _words(each.type),
            _text_html(each.text),
        )
        for each in one.parameters
    )
    return (
        f'<article class="card operation" id="{one.key}" aria-labelledby="{one.key}-name">'
        f'<h3 id="{one.key}-name">{_name(one)}</h3>'
        + "".join(f"<p>{_text_html(text)}</p>" for text in one.text.split("\n\n"))
        + (table(("parameter", "in", "type", "means"), parameters) if one.parameters else "")
        + "".join(map(_body_html, one.bodies))
        + _folded("Answers", f'<div class="answers">{_answers(one.answers)}</div>')
        + _folded("curl", f"<pre>{escape(curl_example(one))}</pre>")
        + _folded("Python", f"<pre>{escape(python_example(one))}</pre>")
        + "</article>"
    )


def _body_html(body: Body) -> str:
    example = "" if body.example is None else f"<pre>{escape(json.dumps(body.example, indent=2))}</pre>"
    return (
        f"<p>Body: <code>{escape(body.media_type)}</code>, {_words(body.type)}</p>"
        + (_members(body.members) if body.members else "")
        + example
    )


def _members(found: Iterable[Member]) -> str:
    rows = [
        (
            f"<code>{escape(each.name)}</code>{' (required)' if each.is_required else ''}",
            _words(each.type),
            _text_html(each.text),
        )
        for each in found
    ]
    return table(("member", "type", "means"), rows) if rows else ""


def _answers(found: Iterable[Answer]) -> str:
    return table(("status", "means", "body"), ((each.status, _means(each), _answered(each)) for each in found))


def _means(answer: Answer) -> str:
    headers = ", ".join(answer.headers)
    return _text_html(answer.text) + (f"<br><small>Headers: {escape(headers)}</small>" if headers else "")


def _answered(answer: Answer) -> str:
    if not answer.media_types:
        return "none"
    return f"{_words(answer.type)}<br><small>{escape(', '.join(answer.media_types))}</small>"


def _words(words: Words) -> str:
    return "".join(
        f'<a href="#schema-{word.name}">{escape(word.name)}</a>' if isinstance(word, Ref) else escape(word) for word in words
    )


def _text_html(text: str) -> str:
    """Return the text as HTML, with passages between backticks as code."""
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", escape(text))


def _name(one: Operation) -> str:
    return f'<span class="method">{one.method}</span> <code>{escape(one.path)}</code>'


def _folded(name: str, body: str) -> str:
    return f"<details><summary>{name}</summary>{body}</details>"


SERVER = "http://127.0.0.1:8700"
# answers that are saved as a file
FILES = {"previews_preview": "preview.png", "outputs_output": "beauty.exr", "logs_log": "log.txt"}
SENT = "shot.usda"


def curl_example(operation: Operation) -> str:
    options = {"GET": "", "POST": "", "HEAD": " -I"}.get(operation.method, f" -X {operation.method}")
    body = _sent_body(operation)
    if operation.method == "POST" and body is None:
        options = " -X POST"
    lines = [f'curl -sS{options} "{_url(operation, "$")}"']
    if body is not None and body.example is None:
        lines.append(f"  -H 'Content-Type: {body.media_type}' --data-binary @{SENT}")
    elif body is not None:
        lines.append(f"  -H 'Content-Type: {body.media_type}' -d '{json.dumps(body.example)}'")
    if operation.key in FILES:
        lines.append(f"  -o {FILES[operation.key]}")
    return " \\\n".join(lines)


def python_example(operation: Operation) -> str:
    url, body = _url(operation, ""), _sent_body(operation)
    asked = [f'{"f" if "{" in url else ""}"{url}"']
    imports = ["from urllib.request import Request, urlopen"]
    if operation.method != "GET":
        asked.append(f'method="{operation.method}"')
    if body is not None:
        asked.append(f'headers={{"Content-Type": "{body.media_type}"}}')
        if body.example is None:
            asked.append(f'data=Path("{SENT}").read_bytes()')
            imports.insert(0, "from pathlib import Path")
        else:
            asked.append(f"data=json.dumps({body.example}).encode()")
    if operation.key in FILES:
        shown = f'    Path("{FILES[operation.key]}").write_bytes(answer.read())'
        imports.insert(0, "from pathlib import Path")
    elif _answers_json(operation):
        shown = "    print(answer.status, json.load(answer))"
    elif operation.method == "HEAD" or operation.answers[0].status == "204":
        shown = "    print(answer.status, answer.headers)"
    else:
        shown = "    print(answer.status, answer.read().decode())"
    if "json." in f"{asked}{shown}":
        imports.insert(0, "import json")
    request = f"Request({asked[0]})" if len(asked) == 1 else "Request(\n    " + ",\n    ".join(asked) + ",\n)"
    return "\n".join([*imports, "", f"request = {request}", "with urlopen(request) as answer:", shown])


def _sent_body(operation: Operation) -> Body | None:
    """Return the operation's body, JSON if possible; a file body of a media type that any file has."""
    found = [body for body in operation.bodies if body.example is not None]
    found += [body for body in operation.bodies if body.media_type == "application/octet-stream"]
    return found[0] if found else None


def _url(operation: Operation, sign: str) -> str:
    path = re.sub(r"\{(\w+)\}", rf"{sign}\1" if sign else r"{\1}", operation.path)
    query = f"?name={SENT}" if operation.key == "scenes_upload" else ""
    return f"{SERVER}{path}{query}"


def _answers_json(operation: Operation) -> bool:
    """Return whether the operation answers JSON to a request without an Accept header."""
    return operation.method != "HEAD" and "application/json" in operation.answers[0].media_types
