"""The API's documents as pages to read: the operations, and each kind of problem. Plain HTML without scripts; knows no HTTP."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from html import escape
from typing import Any

from ..problems import KINDS, Problem

Document = Mapping[str, Any]
STYLESHEET = "/docs.css"
STYLE = """
:root { color-scheme: light dark; font: 16px/1.5 system-ui, sans-serif }
body { margin: 0 auto; padding: 1rem; max-width: 60rem; overflow-wrap: anywhere }
code, pre { font: .9em ui-monospace, monospace }
pre { overflow-x: auto; padding: .5rem; background: color-mix(in srgb, currentColor 8%, transparent) }
h3 code { font-weight: 700 }
table { border-collapse: collapse; display: block; overflow-x: auto }
td, th { padding: .2rem .5rem; text-align: left; vertical-align: top }
td, th { border: 1px solid color-mix(in srgb, currentColor 30%, transparent) }
details { margin: .25rem 0 }
nav ul { columns: 20rem; padding-left: 1.2rem }
"""


def page(title: str, body: str) -> str:
    return (
        "<!doctype html><html lang=en><meta charset=utf-8><meta name=viewport content='width=device-width'>"
        f"<title>{escape(title)} · primray</title><link rel=stylesheet href={STYLESHEET}><h1>{escape(title)}</h1>{body}"
    )


def problems_page() -> str:
    rows = (
        (f'<a href="/problems/{slug}">{_code(slug)}</a>', str(kind.status), escape(kind.title)) for slug, kind in KINDS.items()
    )
    return page("Problems", _table(("type", "status", "title"), rows))


def problem_page(slug: str) -> str:
    kind = KINDS[slug]
    example = Problem(slug, f"{kind.title}.").as_json()
    again = "The same request may succeed later." if kind.retryable else "The same request will fail again."
    return page(
        slug,
        f"<p>{escape(kind.title)}. Status {kind.status}. {again}</p>"
        "<p><code>detail</code> says what was wrong this time; <code>member</code>, where there is one, which part of the "
        "request was at fault; <code>request_id</code> is in the server's log.</p>"
        f"<pre>{_pretty(example)}</pre><p><a href='/problems'>All problems</a></p>",
    )


def operations_page(document: Document) -> str:
    operations = [
        (f"{method.upper()} {path}", operation)
        for path, methods in document["paths"].items()
        for method, operation in methods.items()
    ]
    index = "".join(f'<li><a href="#{one["operationId"]}">{escape(name)}</a></li>' for name, one in operations)
    sections = "".join(_operation(name, one) for name, one in operations)
    schemas = "".join(_folded(name, _pretty(schema)) for name, schema in document["components"]["schemas"].items())
    return page(
        "API",
        f"<p>{escape(document['info']['description'])}</p>"
        "<p><a href='/openapi.json'>openapi.json</a> · <a href='/problems'>problems</a></p>"
        f"<nav><ul>{index}</ul></nav>{sections}<h2>Schemas</h2>{schemas}",
    )


def _operation(name: str, operation: Document) -> str:
    parameters = [
        (_code(one["name"]), one["in"], escape(one.get("description", ""))) for one in operation.get("parameters", [])
    ]
    answers = [
        (escape(status), escape(", ".join(one.get("content", {}))), escape(one.get("description", "")))
        for status, one in operation["responses"].items()
    ]
    body = operation.get("requestBody")
    return (
        f'<h3 id="{operation["operationId"]}">{_code(name)}</h3><p>{escape(operation.get("description", ""))}</p>'
        + (_table(("parameter", "in", ""), parameters) if parameters else "")
        + ("" if body is None else f"<p>Body: {escape(', '.join(body['content']))}</p><pre>{_pretty(_example(body))}</pre>")
        + f"<details><summary>Answers</summary>{_table(('status', 'media type', ''), answers)}</details>"
    )


def _example(body: Document) -> Any:
    media = next(iter(body["content"].values()))
    return media.get("example", media["schema"])


def _table(heads: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    lines = ("".join(f"<td>{cell}</td>" for cell in row) for row in rows)
    head = "".join(f"<th>{text}</th>" for text in heads)
    return f"<table><tr>{head}</tr>{''.join(f'<tr>{line}</tr>' for line in lines)}</table>"


def _folded(name: str, text: str) -> str:
    return f"<details><summary>{_code(name)}</summary><pre>{text}</pre></details>"


def _code(text: str) -> str:
    return f"<code>{escape(text)}</code>"


def _pretty(value: Any) -> str:
    return escape(json.dumps(value, indent=2, ensure_ascii=False))
