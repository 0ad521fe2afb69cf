"""JupyterLab as a user has it, in a browser: a server, notebooks that are opened, their cells and the views below them.

JupyterLab is found by PRIMRAY_JUPYTER, an environment that has it, or in build/jupyter, where .ci/run makes one. Kernels are of
this Python, with that environment's ipykernel.
"""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from playwright.sync_api import Browser, Locator, Page, sync_playwright

CHROMIUM = "/usr/bin/chromium"
ROOT = Path(__file__).resolve().parents[3]
VARIABLE = "PRIMRAY_JUPYTER"
WAIT_S = 240
TRIES = 6  # of ten seconds
KERNEL = "import site, sys; site.addsitedir(sys.argv.pop(1)); from ipykernel.kernelapp import launch_new_instance as l; l()"


def folder_of_packages() -> Path:
    """Return the site-packages of JupyterLab; skips the test where there is none."""
    found = list(Path(os.environ.get(VARIABLE) or ROOT / "build/jupyter").glob("lib/python*/site-packages/jupyterlab"))
    if not found:
        pytest.skip("skipped: no JupyterLab")
    pytest.importorskip("anywidget", reason="skipped: no anywidget")
    return found[0].parent


def environment(home: Path) -> dict[str, str]:
    """Return the variables of a user who has nothing but a kernel named primray."""
    spec = home / "data/kernels/primray/kernel.json"
    spec.parent.mkdir(parents=True, exist_ok=True)
    argv = [sys.executable, "-c", KERNEL, str(folder_of_packages()), "-f", "{connection_file}"]
    spec.write_text(json.dumps({"argv": argv, "display_name": "primray", "language": "python"}))
    names = {"DATA": "data", "CONFIG": "config", "RUNTIME": "runtime"}
    own = {f"JUPYTER_{name}_DIR": str(home / folder) for name, folder in names.items()}
    own |= {f"JUPYTERLAB_{name.upper()}_DIR": str(home / name) for name in ("settings", "workspaces")}
    news = home / "settings/@jupyterlab/apputils-extension/notification.jupyterlab-settings"
    news.parent.mkdir(parents=True, exist_ok=True)
    news.write_text('{"fetchNews": "false", "checkForUpdates": false}')
    return os.environ | own | {"IPYTHONDIR": str(home / "ipython"), "JUPYTER_PLATFORM_DIRS": "1", "HOME": str(home)}


@dataclass
class Lab:
    """A server of notebooks on a folder, and a browser."""

    folder: Path
    url: str
    browser: Browser
    opened: list[Page] = field(default_factory=list)

    def open(self, *cells: str) -> Book:
        """Open a new notebook of these cells, with an empty one behind them, and a kernel of its own."""
        name = f"book{len(self.opened)}.ipynb"
        rows: list[dict[str, Any]] = [
            {"cell_type": "code", "id": f"c{k}", "execution_count": None, "metadata": {}, "outputs": [], "source": source}
            for k, source in enumerate([*cells, ""])
        ]
        metadata = {"kernelspec": {"name": "primray", "display_name": "primray", "language": "python"}}
        book = {"nbformat": 4, "nbformat_minor": 5, "metadata": metadata, "cells": rows}
        (self.folder / name).write_text(json.dumps(book))
        page = self.browser.new_page(viewport={"width": 1200, "height": 1800})
        self.opened.append(page)
        page.set_default_timeout(1000 * WAIT_S)
        page.goto(f"{self.url}/lab/tree/{name}?reset")
        page.locator(".jp-Cell").nth(len(cells)).wait_for()
        # A kernel that has begun to answer.
        page.locator(".jp-Notebook-ExecutionIndicator[data-status=idle]").wait_for(state="attached")
        return Book(page)

    def close_pages(self) -> None:
        for page in self.opened:
            page.close()


@dataclass
class Book:
    """An open notebook. Its last cell is for code that tests run."""

    page: Page
    asked: int = 0

    @property
    def cells(self) -> Locator:
        return self.page.locator(".jp-Notebook .jp-Cell")

    def run(self, number: int) -> None:
        """Run a cell as a user does."""
        self.cells.nth(number).locator(".cm-content").click()
        self._run(self.cells.nth(number))

    def _run(self, cell: Locator) -> None:
        """Run the cell that has the focus: a page that has just been opened may not take the keys yet."""
        prompt = cell.locator(".jp-InputArea-prompt")
        before = prompt.inner_text()
        for _ in range(TRIES):
            self.page.keyboard.press("Control+Enter")
            for _ in range(100):
                if prompt.inner_text() != before:
                    return
                self.page.wait_for_timeout(100)
        pytest.fail("JupyterLab does not run a cell")

    def ask(self, code: str) -> str:
        """Run code in the last cell; what it printed."""
        self.asked += 1
        editor, end = self.cells.last.locator(".cm-content"), f"end of {self.asked}"
        editor.click()
        self.page.keyboard.press("Control+a")
        self.page.keyboard.insert_text(f"{code}\nprint('end of', {self.asked})")
        self._run(self.cells.last)
        output = self.cells.last.locator(".jp-OutputArea-output")
        output.filter(has_text=end).last.wait_for()
        return "\n".join(output.all_inner_texts()).replace(end, "").strip()

    def view(self, number: int = 0) -> Shown:
        """The view below a cell."""
        return Shown(self.page, self.cells.nth(number).locator(".primray-view"))


@dataclass
class Shown:
    """A view as the page shows it."""

    page: Page
    root: Locator

    def text(self, part: str) -> str:
        return self.root.locator(f"[data-part={part}]").inner_text()

    @property
    def count(self) -> int:
        """Pictures that have been drawn."""
        return int(self.root.locator(".stage").get_attribute("data-pictures") or 0)

    def until(self, holds: str) -> None:
        """Wait for an expression of `root`, an element."""
        element = self.root.element_handle()
        self.page.wait_for_function(f"(root) => {holds}", arg=element)

    def until_finished(self, after: int = 0) -> None:
        self.root.wait_for()
        pictures = "Number(root.querySelector('.stage').dataset.pictures ?? 0)"
        self.until(f"root.dataset.phase === 'finished' && {pictures} > {after}")

    def pixels(self) -> npt.NDArray[np.uint8]:
        """The canvas (H, W, 4)."""
        script = """(canvas) => [canvas.height, canvas.width,
          Array.from(canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data)]"""
        height, width, values = self.root.locator("canvas").evaluate(script)
        return np.array(values, np.uint8).reshape(height, width, 4)

    def point(self, x: float, y: float) -> tuple[float, float]:
        box: Any = self.root.locator("canvas").bounding_box()
        return box["x"] + x * box["width"], box["y"] + y * box["height"]

    def drag(self, across: float, down: float, **how: Any) -> None:
        x, y = self.point(0.5, 0.5)
        self.page.mouse.move(x, y)
        self.page.mouse.down(**how)
        self.page.mouse.move(x + across, y + down, steps=5)
        self.page.mouse.up(**how)


@contextmanager
def serve(folder: Path, home: Path) -> Iterator[Lab]:
    """Run a server of JupyterLab on the notebooks of a folder."""
    if shutil.which(CHROMIUM) is None:
        pytest.skip("skipped: no Chromium")
    python = folder_of_packages().parents[2] / "bin/python"
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    flags = [
        "--no-browser",
        "--allow-root",
        "--ServerApp.ip=127.0.0.1",
        f"--ServerApp.port={port}",
        "--ServerApp.port_retries=0",
    ]
    flags += ["--IdentityProvider.token=", "--ServerApp.disable_check_xsrf=True", f"--ServerApp.root_dir={folder}"]
    flags += ["--LabApp.check_for_updates_class=jupyterlab.NeverCheckForUpdate"]
    log = home / "server.log"
    with log.open("w") as output:
        words = [str(python), "-m", "jupyterlab", *flags]
        server = subprocess.Popen(words, env=environment(home), stdout=output, stderr=subprocess.STDOUT)
    url = f"http://127.0.0.1:{port}"
    try:
        _wait_for(url, server, log)
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
            lab = Lab(folder, url, browser)
            yield lab
            lab.close_pages()
            browser.close()
    finally:
        server.terminate()
        server.wait(30)


def _wait_for(url: str, server: subprocess.Popen[bytes], log: Path) -> None:
    for _ in range(10 * WAIT_S):
        assert server.poll() is None, log.read_text()
        try:
            with urllib.request.urlopen(f"{url}/api/status", timeout=10):
                return
        except OSError:
            time.sleep(0.1)
    raise AssertionError(log.read_text())
