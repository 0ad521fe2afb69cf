"""A real server and a real browser for the page's tests. Every page is watched: errors in its console, violations of its
content security policy, exceptions and requests to anywhere else fail the test that made it."""

from __future__ import annotations

import re
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, FilePayload, Page, sync_playwright
from tests.service.page.scenes import SMALL
from tests.service.serving import RunningServer, start

CHROMIUM = "/usr/bin/chromium"
ARGUMENTS = (
    "--no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking --disable-component-update "
    "--disable-sync"
)
# Answers that a page is meant to get; a browser writes them into its console all the same.
REFUSED = re.compile(r"the server responded with a status of (\d+)")


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """Gone when the page's tests are over: Playwright keeps an event loop running, and no other test could start one."""
    if shutil.which(CHROMIUM) is None:
        pytest.skip("skipped: no Chromium")
    with sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS.split())
        yield found
        found.close()


@pytest.fixture(scope="session")
def site() -> Iterator[RunningServer]:
    """One server for all tests of the page; each uses scenes and jobs of its own."""
    folder = Path(tempfile.mkdtemp(prefix="primray-page-"))
    server = start(folder / "data")
    yield server
    server.stop()
    shutil.rmtree(folder)


class Watched:
    """What went wrong in a page, as it happened."""

    def __init__(self, page: Page, url: str) -> None:
        self.page = page
        self.wrong: list[str] = []
        self.expected: set[int] = set()  # statuses of answers that the test means to get
        page.add_init_script(
            "addEventListener('securitypolicyviolation', (e) => console.error('CSP ' + e.violatedDirective + e.blockedURI))"
        )
        page.on("console", self._on_console)
        page.on("pageerror", lambda error: self.wrong.append(f"exception: {error}"))
        page.on("request", lambda request: self._on_request(request.url, url))

    def _on_console(self, message: Any) -> None:
        if message.type not in ("error", "warning"):
            return
        refused = REFUSED.search(message.text)
        if refused is None or int(refused[1]) not in self.expected:
            self.wrong.append(f"console: {message.text} {message.location}")

    def _on_request(self, asked: str, url: str) -> None:
        if not asked.startswith((f"{url}/", f"blob:{url}/", "data:")):
            self.wrong.append(f"request: {asked}")


OpenPage = Callable[..., Watched]


@pytest.fixture
def open_page(browser: Browser, site: RunningServer) -> Iterator[OpenPage]:
    """A function that opens the page at a fragment, watched; nothing may have gone wrong when the test ends."""
    contexts, opened = [], []

    def make(fragment: str = "", url: str = site.url, **options: Any) -> Watched:
        context = browser.new_context(**{"viewport": {"width": 1280, "height": 900}, "locale": "en-GB", **options})
        contexts.append(context)
        page = context.new_page()
        page.set_default_timeout(60_000)
        watched = Watched(page, url)
        opened.append(watched)
        page.goto(f"{url}/{fragment}")
        return watched

    yield make
    for context in contexts:
        context.close()
    with site.client() as client:  # the next test's jobs are not to wait behind this one's
        for state in ("queued", "preparing", "running"):
            for job in client.get("/v1/jobs", params={"state": state}).json()["items"]:
                client.post(f"/v1/jobs/{job['id']}/cancel")
    wrong = [line for watched in opened for line in watched.wrong]
    assert not wrong, "\n".join(wrong)


def choose(page: Page, name: str = "small.usda", content: bytes | str = SMALL) -> None:
    """Choose a file by the input behind the button, and wait for the form."""
    data = content.encode() if isinstance(content, str) else content
    chosen: FilePayload = {"name": name, "mimeType": "", "buffer": data}
    page.set_input_files("input[type=file]:not([webkitdirectory])", files=[chosen])
    page.wait_for_selector("form.settings")


def render(page: Page, *, width: int = 64, target: str | None = None, samples: int | None = None) -> str:
    """Fill in the form and submit it; the job's id."""
    page.get_by_label("Width", exact=True).fill(str(width))
    if target is not None:
        page.get_by_label("Own target error").fill(target)
    if samples is not None:
        page.get_by_label("Or after samples a pixel").fill(str(samples))
    page.get_by_role("button", name="Render", exact=True).click()
    page.wait_for_url("**#/jobs/job_*")
    return page.url.rpartition("/")[2]


def wait_for_state(page: Page, state: str, timeout_s: float = 180.0) -> None:
    page.wait_for_selector(f'.head .state[data-state="{state}"]', timeout=1000 * timeout_s)


def until(page: Page, expression: str, timeout_s: float = 180.0) -> None:
    """Until the expression is true. Playwright's own waiting evaluates text inside the page, which its policy forbids."""
    end = time.monotonic() + timeout_s
    while not page.evaluate(expression):
        assert time.monotonic() < end, f"not in {timeout_s} s: {expression}\n{page.locator('main').inner_text()}"
        page.wait_for_timeout(50)


def pictures(page: Page) -> int:
    """How many have been shown one after the other."""
    return int(page.locator(".viewer").get_attribute("data-pictures") or 0)


def until_pictures(page: Page, more_than: int) -> None:
    until(page, f"Number(document.querySelector('.viewer').dataset.pictures) > {more_than}")
