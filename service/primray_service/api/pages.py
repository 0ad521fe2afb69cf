"""HTML frame of the API's reference pages, and a page for each kind of problem. Knows no HTTP; page/style/ has the styles."""

from __future__ import annotations

import json
from collections.abc import Iterable
from html import escape

from ..problems import KINDS, Problem

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
