"""Builds the site, `make site`: copies the pages, writes those that are made of the code, runs Sphinx, checks the result.

    python docs/site/build.py            into build/site/html; fails on a warning, a dead link, a request to anywhere

The copy lies as the repository does, so that a page's links are the same on the site and in the repository.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from enum import Enum
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urldefrag

from http_reference import http_reference
from outputs import write_outputs

ROOT = Path(__file__).resolve().parents[2]
WORK = ROOT / "build/site"
SOURCE, HTML = WORK / "source", WORK / "html"
# What pages link to. Git says which files of these there are; nothing else is copied.
COPIED = ("*.md", "LICENSE", "NOTICE", "docs", "examples", "schemas", "deploy", "contrib", "scenes/features/README.md",
          "scenes/gallery/*.py", "scenes/gallery/*.usda", "scenes/analytic/cse168_project1.usda")  # fmt: skip
MORE = """
```{{toctree}}
:hidden:
:caption: More
../decisions/README
{}
```
"""
FIRST = """<!doctype html><html lang="en"><meta charset="utf-8"><title>primray</title>
<meta http-equiv="refresh" content="0; url=docs/site/index.html"><a href="docs/site/index.html">primray</a></html>
"""


def main() -> None:
    shutil.rmtree(WORK, ignore_errors=True)
    listed = subprocess.run(["git", "ls-files", "--cached", "--others", "--exclude-standard", *COPIED], cwd=ROOT, check=True,
                            capture_output=True, text=True).stdout  # fmt: skip
    for name in listed.split("\n"):
        if name and (ROOT / name).is_file():
            (SOURCE / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, SOURCE / name)
    for page in SOURCE.rglob("*.md"):
        page.write_text(linked_thumbnails(without_links_outside(page)), encoding="utf-8")
    with (SOURCE / "docs/site/index.md").open("a", encoding="utf-8") as index:
        index.write(MORE.format("\n".join(unlisted())))
    shutil.copy(ROOT / "service/primray_service/page/favicon.svg", SOURCE / "docs/site/static/favicon.svg")
    (SOURCE / "docs/site/reference").mkdir(exist_ok=True)
    (SOURCE / "docs/site/reference/library.md").write_text(library(), encoding="utf-8")
    (SOURCE / "docs/site/reference/command-line.md").write_text(command_line(), encoding="utf-8")
    (SOURCE / "docs/site/reference/http.md").write_text(http_reference(ROOT / "schemas/openapi.json"), encoding="utf-8")
    write_outputs(SOURCE / "examples")
    sphinx = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html", "-c", ROOT / "docs/site", SOURCE, HTML]
    if (ended := subprocess.run(sphinx).returncode) != 0:
        sys.exit(ended)
    for page in HTML.rglob("*.html"):
        page.write_text(mended(page.read_text(encoding="utf-8")), encoding="utf-8")
    (HTML / "index.html").write_text(FIRST, encoding="utf-8")
    if wrong := list(faults(HTML)):
        sys.exit("\n".join(wrong))
    print(f"{HTML / 'index.html'}: {len(list(HTML.rglob('*.html')))} pages")


def unlisted() -> list[str]:
    """Pages of docs/ that the index does not list: they come last, so that no page is without a place."""
    site = ROOT / "docs/site"
    named = re.findall(r"^(?!:|```)([\w./-]+)$", (site / "index.md").read_text(encoding="utf-8"), re.MULTILINE)
    listed = {(site / f"{name}.md").resolve() for name in named} | {site / "index.md", ROOT / "docs/README.md"}
    pages = {path for path in (ROOT / "docs").rglob("*.md") if "decisions" not in path.parts}
    return sorted(f"../{path.relative_to(ROOT / 'docs').with_suffix('')}" for path in pages - listed)


def without_links_outside(page: Path) -> str:
    """The page's text, links to files that are not on the site as plain text."""

    def replaced(link: re.Match[str]) -> str:
        target = link[3].partition("#")[0]
        is_here = not target or re.match(r"[a-z]+:", target) or (page.parent / target).is_file()
        return link[0] if is_here else link[2]

    return re.sub(r"(!?)\[([^\]]*)\]\(([^)\s]+)\)", replaced, page.read_text(encoding="utf-8"))


def linked_thumbnails(text: str) -> str:
    """HTML that GitHub needs for rows of pictures as Markdown, whose files and links Sphinx takes along."""
    return re.sub(r'<a href="(\S+)"><img src="(\S+)" width="(\d+%)" alt="([^"]*)"></a>', r"[![\4](\2){width=\3}](\1)", text)


def library() -> str:
    """Every public name, as its docstring has it."""
    import inspect

    import primray

    told = [
        "# Library reference\n",
        "Every public name of `primray`, as its docstring has it; a test runs each example in them.",
        "[More of the library](../../library.md).\n",
        "```{eval-rst}\n.. currentmodule:: primray\n",
    ]
    for name in primray.__all__:
        public = getattr(primray, name)
        if inspect.isclass(public) or callable(public):
            told.append(f".. auto{'class' if inspect.isclass(public) else 'function'}:: {name}\n")
    return "\n".join([*told, "```\n"])


def command_line() -> str:
    """Every command with its flags, from its definition."""
    from typer.main import get_command

    from primray.cli.app import LazyCommand, app, loaded

    group = get_command(app)
    context = group.make_context("primray", ["doctor"], resilient_parsing=True)
    told = ["# Command line reference\n"]
    for name in group.list_commands(context):  # type: ignore[attr-defined]
        command = group.get_command(context, name)  # type: ignore[attr-defined]
        if isinstance(command, LazyCommand):
            command = loaded(name, command.target)
        told.append(f"## primray {name}\n\n{command.help or ''}\n")
        rows = [_flag(each) for each in getattr(command, "params", ()) if each.name != "help"]
        if rows:
            told.append("| flag | does |\n|---|---|\n" + "\n".join(rows) + "\n")
    return "\n".join(told)


def _flag(parameter: Any) -> str:
    is_argument = parameter.param_type_name == "argument"
    names = [] if is_argument else [*parameter.opts, *parameter.secondary_opts]
    kind = parameter.type_descriptor.annotation
    choices = [str(each.value) for each in kind] if isinstance(kind, type) and issubclass(kind, Enum) else []
    value = ", ".join(choices) or ("" if getattr(parameter, "is_flag", False) else parameter.metavar or parameter.name.upper())
    shown = f"{', '.join(f'`{name}`' for name in names)} {value.strip('[]').replace('|', ', ')}".strip()
    default = parameter.default.value if isinstance(parameter.default, Enum) else parameter.default
    told = parameter.show_default if isinstance(parameter.show_default, str) else default if parameter.show_default else None
    is_told = isinstance(told, str | int | float) and not isinstance(told, bool) and str(told)
    help_text = f"{parameter.help or ''}{f' Without it: {told}.' if is_told else ''}".replace("|", "\\|").replace("\n", " ")
    return f"| {shown} | {help_text} |"


# What the theme leaves out for those who read by ear or keyboard (axe: aria-required-attr, landmark-unique,
# scrollable-region-focusable, page-has-heading-one).
MENDED = {
    '<p class="caption" role="heading">': '<p class="caption" role="heading" aria-level="2">',
    '<aside class="sidebar-drawer">': '<aside class="sidebar-drawer" aria-label="All pages">',
    '<aside class="toc-drawer': '<aside aria-label="This page" class="toc-drawer',
    '<div id="search-results">': '<h1>Search</h1><div id="search-results">',
    "<pre>": '<pre tabindex="0">',
    '<div class="table-wrapper': '<div tabindex="0" class="table-wrapper',
}


def mended(html: str) -> str:
    for left, put in MENDED.items():
        html = html.replace(left, put)
    return html


class Page(HTMLParser):
    """What a page links to, loads, and has for others to link to."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.places: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        self.places.add(values.get("id", ""))
        if tag == "a" and "href" in values:
            self.links.append(values["href"])
        if tag in ("img", "script", "iframe", "source") and "src" in values:
            self.loaded.append(values["src"])
        if tag == "link" and values.get("rel") not in ("canonical",) and "href" in values:
            self.loaded.append(values["href"])


def faults(folder: Path) -> Iterator[str]:
    """Links that lead nowhere on the site, what is loaded from elsewhere, pages that are too large."""
    pages = {path: Page(path.read_text(encoding="utf-8")) for path in folder.rglob("*.html")}
    for path, page in pages.items():
        name = path.relative_to(folder)
        yield from (f"{name} loads {each}" for each in page.loaded if re.match(r"(https?:)?//", each))
        for link in page.links:
            target, place = urldefrag(link)
            if re.match(r"[a-z]+:", link):
                continue
            there = path if not target else (path.parent / unquote(target)).resolve()
            if not there.exists():
                yield f"{name}: {link} leads nowhere"
            elif place and there in pages and unquote(place) not in pages[there].places:
                yield f"{name}: {link} names no place of the page"


if __name__ == "__main__":
    main()
