"""A notebook's picture in a browser, without a kernel: its sliders show what `to_uint8` and the errors say."""

from __future__ import annotations

import json
import os
import shutil
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Page, sync_playwright

import primray

CHROMIUM = "/usr/bin/chromium"
ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    if shutil.which(CHROMIUM) is None:
        pytest.skip("skipped: no Chromium")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
        yield browser.new_page(viewport={"width": 700, "height": 500})
        browser.close()


@pytest.fixture(scope="module")
def image() -> primray.Image:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", primray.RenderWarning)
        return primray.render(ROOT / "scenes/features/opacity-texture/scene.usda", resolution=(160, 0), spp=8)


def opened(page: Page, image: primray.Image, tmp_path: Path) -> list[str]:
    """What went wrong meanwhile."""
    wrong: list[str] = []
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("request", lambda request: None if request.url.startswith(("file:", "data:")) else wrong.append(request.url))
    html = image._repr_html_()
    assert html is not None
    (tmp_path / "picture.html").write_text(f'<!doctype html><meta charset="utf-8">{html}', encoding="utf-8")
    page.goto((tmp_path / "picture.html").as_uri())
    return wrong


def move(page: Page, part: str, value: float) -> None:
    page.eval_on_selector(f"[data-part={part}]", f'(x) => {{ x.value = {value}; x.dispatchEvent(new Event("input")); }}')


def canvas(page: Page, stops: float) -> Any:
    page.wait_for_function(f'document.querySelector("[data-primray]").dataset.shown == "{stops:g}"')
    read = "(c) => [c.height, c.width, Array.from(c.getContext('2d').getImageData(0, 0, c.width, c.height).data)]"
    height, width, values = page.eval_on_selector("[data-part=canvas]", read)
    return np.array(values).reshape(height, width, 4)


@pytest.mark.parametrize("stops", [-3.0, 2.0])
def test_exposure_is_that_of_the_view(page: Page, image: primray.Image, tmp_path: Path, stops: float) -> None:
    wrong = opened(page, image, tmp_path)
    move(page, "exposure", stops)
    found, wanted = canvas(page, stops), image.to_uint8(exposure=stops).astype(int)
    seen = wanted[..., 3] > 0
    difference = np.abs(found - wanted)[seen]
    assert np.percentile(difference, 99) <= 3  # the cube's straight lines
    assert difference.mean() < 1
    assert not wrong
    move(page, "exposure", 0)
    assert page.eval_on_selector("[data-part=canvas]", "(c) => c.hidden")


def test_the_error_stands_over_the_picture_with_its_legend(page: Page, image: primray.Image, tmp_path: Path) -> None:
    opened(page, image, tmp_path)
    assert not page.is_visible("[data-part=legend]")
    move(page, "error", 100)
    assert page.is_visible("[data-part=legend]")
    assert page.eval_on_selector("[data-part=heat]", "(x) => x.style.opacity") == "1"
    assert "8 samples a pixel" in page.inner_text("[data-primray]")


def test_without_scripts_there_is_the_picture_and_nothing_to_control(image: primray.Image, tmp_path: Path) -> None:
    html = image._repr_html_()
    assert html is not None
    assert '<div data-part="controls" hidden' in html
    assert html.index("data:image/png") < html.index("<canvas")


def test_the_example_notebook_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With a kernel of its own, beside the stage that it renders."""
    nbformat = pytest.importorskip("nbformat", reason="no Jupyter")
    nbclient = pytest.importorskip("nbclient", reason="no Jupyter")
    monkeypatch.setenv("JUPYTER_PLATFORM_DIRS", "1")
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / "ipython"))
    book = nbformat.read(ROOT / "examples/notebook.ipynb", as_version=4)
    assert not [cell for cell in book.cells if cell.get("outputs")], "outputs are made, not kept"
    nbclient.NotebookClient(book, timeout=120, resources={"metadata": {"path": str(ROOT / "examples")}}).execute()
    shown = [out["data"] for cell in book.cells for out in cell.get("outputs", ()) if "data" in out]
    assert any("data-primray" in str(data.get("text/html")) for data in shown)
    if os.environ.get("PRIMRAY_KEEP"):
        Path(os.environ["PRIMRAY_KEEP"]).write_text(json.dumps(book), encoding="utf-8")
