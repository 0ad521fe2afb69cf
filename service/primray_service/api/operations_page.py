"""The API's reference as a page of the service: every operation with what it takes and answers. page/docs/ adds a form to each
that sends it; the page is readable without scripts. Knows no HTTP."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from html import escape

from .examples import curl_example, python_example
from .operations import Answer, Body, Document, Operation, operations
from .pages import page, table
from .schema_words import Member, Ref, Words, members

SCRIPT = "/page/docs/try_it.js"


def operations_page(document: Document) -> str:
    found = list(operations(document))
    told = {tag["name"]: tag["description"] for tag in document["tags"]}
    groups = [(tag, [one for one in found if one.tag == tag]) for tag in told]
    index = "".join(_index(tag, group) for tag, group in groups)
    sections = "".join(_group(tag, told[tag], group) for tag, group in groups)
    schemas = "".join(
        f'<details id="schema-{name}"><summary><code>{name}</code></summary><p>{_text(schema.get("description", ""))}</p>'
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
            _text(each.text),
        )
        for each in one.parameters
    )
    return (
        f'<article class="card operation" id="{one.key}" aria-labelledby="{one.key}-name">'
        f'<h3 id="{one.key}-name">{_name(one)}</h3>'
        + "".join(f"<p>{_text(text)}</p>" for text in one.text.split("\n\n"))
        + (table(("parameter", "in", "type", "means"), parameters) if one.parameters else "")
        + "".join(map(_body, one.bodies))
        + _folded("Answers", f'<div class="answers">{_answers(one.answers)}</div>')
        + _folded("curl", f"<pre>{escape(curl_example(one))}</pre>")
        + _folded("Python", f"<pre>{escape(python_example(one))}</pre>")
        + "</article>"
    )


def _body(body: Body) -> str:
    example = "" if body.example is None else f"<pre>{escape(json.dumps(body.example, indent=2))}</pre>"
    return (
        f"<p>Body: <code>{escape(body.media_type)}</code>, {_words(body.type)}</p>"
        + (_members(body.members) if body.members else "")
        + example
    )


def _members(found: Iterable[Member]) -> str:
    rows = [
        (f"<code>{escape(each.name)}</code>{' (required)' if each.is_required else ''}", _words(each.type), _text(each.text))
        for each in found
    ]
    return table(("member", "type", "means"), rows) if rows else ""


def _answers(found: Iterable[Answer]) -> str:
    return table(("status", "means", "body"), ((each.status, _means(each), _answered(each)) for each in found))


def _means(answer: Answer) -> str:
    headers = ", ".join(answer.headers)
    return _text(answer.text) + (f"<br><small>Headers: {escape(headers)}</small>" if headers else "")


def _answered(answer: Answer) -> str:
    if not answer.media_types:
        return "none"
    return f"{_words(answer.type)}<br><small>{escape(', '.join(answer.media_types))}</small>"


def _words(words: Words) -> str:
    return "".join(
        f'<a href="#schema-{word.name}">{escape(word.name)}</a>' if isinstance(word, Ref) else escape(word) for word in words
    )


def _text(text: str) -> str:
    """Return the text as HTML, with passages between backticks as code."""
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", escape(text))


def _name(one: Operation) -> str:
    return f'<span class="method">{one.method}</span> <code>{escape(one.path)}</code>'


def _folded(name: str, body: str) -> str:
    return f"<details><summary>{name}</summary>{body}</details>"
