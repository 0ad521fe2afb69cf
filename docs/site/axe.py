"""Looks at the built site as a browser shows it: axe-core finds nothing, no page scrolls sideways on a phone, search finds.

    python docs/site/axe.py [FOLDER]            after `make site`; FOLDER: where screenshots go

One page of each kind, light at 1280 pixels and dark at 360. Ends with exit code 1 where something is found.
"""

from __future__ import annotations

import functools
import http.server
import shutil
import sys
import threading
import time
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

HTML = Path(__file__).resolve().parents[2] / "build/site/html"
PAGES = (
    *(f"docs/site/{name}" for name in ("index", "first-picture", "from-mitsuba", "tutorials/command-line")),
    *(f"docs/site/{name}" for name in ("concepts/error-bars", "concepts/pipeline", "concepts/exact")),
    *(f"docs/site/reference/{name}" for name in ("library", "command-line", "http")),
    *(f"docs/{name}" for name in ("gallery", "conformance", "diagnostics", "benchmarks", "service/api", "decisions/README")),
    "examples/notebook",
)
VIEWS = (("light", 1280), ("dark", 360))
SEARCHED, FOUND = "relMSE", "What an error bar of a picture is"
RUN = """async () => (await axe.run(document, { resultTypes: ['violations'] })).violations.map(
  ({ id, nodes }) => `${id}: ${nodes.slice(0, 4).map(({ target }) => target.join(" ")).join(", ")} (${nodes.length})`)"""
# What sticks out of a page that can be scrolled sideways, for the message.
WIDE = """() => document.documentElement.scrollWidth <= innerWidth ? [] : [...document.querySelectorAll("article *")]
  .filter((each) => each.getBoundingClientRect().right > innerWidth + 1)
  .slice(0, 4).map((each) => each.outerHTML.slice(0, 80))"""


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_: object) -> None:
        pass


def faults(browser: Any, url: str, shots: Path | None) -> Iterator[str]:
    axe = files("axe_playwright_python").joinpath("axe.min.js").read_text(encoding="utf-8")
    for scheme, width in VIEWS:
        page = browser.new_page(color_scheme=scheme, viewport={"width": width, "height": 900})
        wrong: list[str] = []
        page.on("pageerror", lambda error, wrong=wrong: wrong.append(f"exception: {error}"))
        page.on(
            "console", lambda said, wrong=wrong: said.type == "error" and wrong.append(f"console: {said.text} {said.location}")
        )
        page.on("request", lambda asked, wrong=wrong: asked.url.startswith((url, "data:")) or wrong.append(f"asks {asked.url}"))
        for name in PAGES:
            page.goto(f"{url}/{name}.html")
            page.evaluate(axe)
            wide = page.evaluate(WIDE)
            found = [*page.evaluate(RUN), *(["scrolls sideways", *wide] if wide else []), *wrong]
            yield from (f"{name}, {scheme}, {width} pixels: {each}" for each in found)
            wrong.clear()
            if shots:
                page.screenshot(path=shots / f"{name.replace('/', '-')}-{scheme}-{width}.png")
        page.goto(f"{url}/search.html?q={SEARCHED}")
        results = page.locator("#search-results li a")
        results.filter(has_text=FOUND).first.wait_for(timeout=60_000)
        page.evaluate(axe)
        yield from (f"search, {scheme}, {width} pixels: {each}" for each in [*page.evaluate(RUN), *wrong])
        if shots:
            page.screenshot(path=shots / f"search-{scheme}-{width}.png")
        page.close()


def main(shots: Path | None) -> None:
    chromium = shutil.which("chromium")
    if chromium is None:
        print("site: skipped: no chromium")
        return
    from playwright.sync_api import sync_playwright

    began = time.monotonic()
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=str(HTML)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox", "--disable-gpu"])
        found = list(faults(browser, f"http://127.0.0.1:{server.server_port}", shots))
        browser.close()
    if found:
        sys.exit("\n".join(found))
    print(f"site: axe found nothing on {len(PAGES) + 1} pages, in two views each, in {time.monotonic() - began:.0f} s")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else None)
