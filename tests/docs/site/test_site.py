"""The site's own pages: commands that run, and a check that finds what it should. `make site` builds it."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[3]
SITE = ROOT / "docs/site"
INDEX = (SITE / "index.md").read_text(encoding="utf-8")


def loaded_build() -> Any:
    spec = importlib.util.spec_from_file_location("site_build", SITE / "build.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.path.insert(0, str(SITE))  # as it is for a script
    spec.loader.exec_module(module)
    return module


build = loaded_build()
SHOWN = sys.modules["outputs"].SHOWN


def test_the_first_picture_is_made_by_its_commands(tmp_path: Path) -> None:
    page = (SITE / "first-picture.md").read_text(encoding="utf-8")
    script = "set -euo pipefail\n" + "".join(re.findall(r"^```sh\n(.*?)^```$", page, re.DOTALL | re.MULTILINE))
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    ended = subprocess.run(
        ["bash", "-c", script], cwd=tmp_path, env=os.environ | {"PATH": path}, capture_output=True, text=True, timeout=120
    )
    assert ended.returncode == 0, ended.stderr
    assert (tmp_path / "shot.png").read_bytes().startswith(b"\x89PNG")
    assert "target 0.005 reached" in ended.stdout
    assert "no-material" in ended.stdout  # as the page says of the floor
    assert "hidden" not in ended.stdout


def test_every_page_has_its_place() -> None:
    """Those of docs/ that the index does not name come under "More"; pages that it names are there, or made."""
    named = [name for name in re.findall(r"^(?!:|```)([\w./-]+)$", INDEX, re.MULTILINE) if not name.startswith("reference/")]
    assert len(named) > 30
    assert [name for name in named if not (SITE / f"{name}.md").exists() and not (SITE / f"{name}.ipynb").exists()] == []
    assert not {f"../{name}" for name in ("error", "library", "README")} & set(build.unlisted())


def test_tutorials_show_examples_that_tests_run() -> None:
    shown = {
        name for page in (SITE / "tutorials").glob("*.md") for name in re.findall(r"\{literalinclude\} (\S+)", page.read_text())
    }
    examples = ("command_line.sh", "service_client.py", "test_pictures.py", "farm.sh")
    told = [text for text, _ in SHOWN.values()]
    assert shown == {f"../../../examples/{name}" for name in (*examples, *(f"out/{text}" for text in told))}


def test_tutorials_show_what_their_examples_said_and_made() -> None:
    """The build runs them; that a page shows what is written for it is seen here."""
    for name, (text, picture) in SHOWN.items():
        page = (SITE / f"tutorials/{name}.md").read_text(encoding="utf-8")
        assert f"{{literalinclude}} ../../../examples/out/{text}\n" in page
        assert re.search(rf"{{image}} \S+/examples/out/{re.escape(picture)}\n:alt: \w", page)


def test_references_are_of_the_code() -> None:
    flags = build.command_line()
    for text in ("## primray doctor", "## primray submit", "`--target-error`", "`--pilot`"):
        assert text in flags
    http = build.http_reference(ROOT / "schemas/openapi.json")
    assert "(submissions-submit)=\n### POST /v1/jobs" in http
    assert http.count("\ncurl -sS") == http.count("/docs#") == 51
    assert {name.lower() for name in re.findall(r"\[(\w+)\]\(#schema-", http)} <= set(re.findall(r"\(schema-(\w+)\)=", http))
    assert ".. autofunction:: render\n" in build.library()


@pytest.mark.parametrize(
    ("html", "fault"),
    [
        ('<a href="b.html#here">', ""),
        ('<a href="https://example.org/">', ""),
        ('<img src="data:image/png;base64,">', ""),
        ('<a href="gone.html">', "leads nowhere"),
        ('<a href="b.html#gone">', "names no place"),
        ('<script src="https://example.org/a.js"></script>', "loads https"),
        ('<link rel="stylesheet" href="//example.org/a.css">', "loads //"),
    ],
)
def test_what_is_wrong_with_a_page(tmp_path: Path, html: str, fault: str) -> None:
    (tmp_path / "a.html").write_text(html, encoding="utf-8")
    (tmp_path / "b.html").write_text('<p id="here">', encoding="utf-8")
    found = list(build.faults(tmp_path))
    assert len(found) == bool(fault)
    assert all(fault in each for each in found)


def test_a_page_is_mended_for_ear_and_keyboard() -> None:
    html = build.mended('<p class="caption" role="heading">Begin</p><pre>code</pre><aside class="sidebar-drawer"></aside>')
    assert 'aria-level="2">Begin' in html
    assert '<pre tabindex="0">code' in html
    assert 'aria-label="All pages"' in html


def test_thumbnails_of_readme_are_pictures_and_links_that_sphinx_knows() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    made = build.linked_thumbnails(readme)
    assert "<img" in readme
    assert "<img" not in made
    assert "[![A groom](docs/gallery/groom-small.jpg){width=16%}](docs/gallery.md)" in made


def test_links_to_what_is_not_on_the_site_are_text(tmp_path: Path) -> None:
    (tmp_path / "page.md").write_text("[here](page.md#a) [out](https://a.b) [gone](../gone.py)", encoding="utf-8")
    assert build.without_links_outside(tmp_path / "page.md") == "[here](page.md#a) [out](https://a.b) gone"
