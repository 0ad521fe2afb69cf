"""The site's reference of the HTTP API, as Markdown: what the service shows at /docs, made of the same data."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from pathlib import Path

from primray_service.api.reference import (
    SERVER,
    Answer,
    Body,
    Member,
    Operation,
    Ref,
    Words,
    curl_example,
    members,
    operations,
    python_example,
)

HEAD = """# HTTP reference

Every operation of the service, from [openapi.json](../../../schemas/openapi.json). How they go together is in
[the guide](../../service/api.md).

```{{raw}} html
<form id="service-address"><label for="address">Address of your service</label>
<input id="address" type="url" value="{server}" spellcheck="false" autocomplete="off"></form>
```

**Try it** below each operation leads to your service's own page of this reference, `/docs`, where a form sends the request and
shows status, headers and body. It is there and not here because a service takes changes from its own pages only: no other
site's page can use it through your browser. A service that listens on loopback needs no key; else send
`Authorization: Bearer $PRIMRAY_API_KEY`, or type the key at `/docs`.
"""


def http_reference(document_file: Path) -> str:
    document = json.loads(document_file.read_text(encoding="utf-8"))
    found = list(operations(document))
    told = [HEAD.format(server=SERVER)]
    for tag in document["tags"]:
        told += [f"## {tag['name'].capitalize()}", tag["description"]]
        told += [text for one in found if one.tag == tag["name"] for text in _operation(one)]
    told.append("## Schemas")
    for name, schema in document["components"]["schemas"].items():
        told += [f"(schema-{name.lower()})=\n### {name}", schema.get("description", ""), _members(members(schema))]
    return "\n\n".join(text for text in told if text) + "\n"


def _operation(one: Operation) -> Iterator[str]:
    yield f"({_place(one.key)})=\n### {one.name}"
    yield one.text
    if one.parameters:
        rows = (
            (f"`{each.name}`", f"{each.where}{', required' if each.is_required else ''}", _words(each.type), each.text)
            for each in one.parameters
        )
        yield _table(("parameter", "in", "type", "means"), rows)
    for body in one.bodies:
        yield from _body(body)
    yield f"```sh\n{curl_example(one)}\n```"
    yield from _folded("Python", f"```python\n{python_example(one)}\n```")
    yield from _folded("Answers", _table(("status", "means", "body", "headers"), map(_answer, one.answers)))
    yield f"[Try it at your service]({SERVER}/docs#{one.key})"


def _body(body: Body) -> Iterator[str]:
    yield f"Body: `{body.media_type}`, {_words(body.type)}"
    if body.members:
        yield _members(body.members)
    if body.example is not None:
        yield f"```json\n{json.dumps(body.example, indent=2)}\n```"


def _answer(answer: Answer) -> tuple[str, ...]:
    body = f"{_words(answer.type)} ({', '.join(answer.media_types)})" if answer.media_types else "none"
    return answer.status, answer.text, body, ", ".join(answer.headers)


def _members(found: Iterable[Member]) -> str:
    rows = [(f"`{each.name}`{' (required)' if each.is_required else ''}", _words(each.type), each.text) for each in found]
    return _table(("member", "type", "means"), rows) if rows else ""


def _words(words: Words) -> str:
    return "".join(f"[{word.name}](#schema-{word.name.lower()})" if isinstance(word, Ref) else _plain(word) for word in words)


def _plain(text: str) -> str:
    """Brackets and stars as they are; backticks are code in what the document says."""
    return text.replace("[", "\\[").replace("*", "\\*").replace("<", "&lt;")


def _table(heads: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    lines = [heads, ("---",) * len(heads), *rows]
    return "\n".join(f"| {' | '.join(_cell(cell) for cell in line)} |" for line in lines)


def _cell(text: str) -> str:
    text = text.replace("\n", " ").replace("|", "\\|")
    return text if "](#" in text or "\\[" in text or "`" in text else _plain(text)


def _folded(name: str, text: str) -> Iterator[str]:
    yield f"<details><summary>{name}</summary>"
    yield text
    yield "</details>"


def _place(key: str) -> str:
    return key.replace("_", "-")
