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
from primray.images.showing import DARKEST, LEAST, LEVELS, RAMP, heat, logarithms, reduced, relative_errors

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


def test_logarithms_come_back() -> None:
    values = np.exp2(np.linspace(-11, 9, 64, dtype=np.float32)).reshape(8, 8, 1).repeat(3, axis=2)
    levels, brightest = logarithms(values)
    level = (levels[:8].astype(int) << 4) | (levels[8:] >> 4)
    back = np.exp2(DARKEST + level / LEVELS * (brightest - DARKEST))
    assert np.abs(back / values - 1).max() < 0.002
    assert logarithms(np.zeros((1, 1, 3), np.float32))[0].max() == 0


def test_large_pictures_are_means() -> None:
    values = np.arange(1000 * 800, dtype=np.float32).reshape(800, 1000, 1)
    small = reduced(values)
    assert small.shape == (400, 500, 1)
    assert small[0, 0, 0] == values[:2, :2].mean()


def test_errors_are_relative_and_their_squares_averaged() -> None:
    pixels, errors = np.ones((5, 5, 4), np.float32), np.zeros((5, 5, 3), np.float32)
    errors[2, 2] = 0.3
    found = relative_errors(pixels, errors)
    assert found is not None
    assert found[1, 1] == pytest.approx(0.3 / 3 / np.sqrt(1.01))
    assert found[0, 4] == 0
    assert relative_errors(pixels, np.full((5, 5, 3), np.inf, np.float32)) is None
    assert heat(np.array([[0.0, LEAST], [1.0, 10.0]])).tolist() == [[RAMP[0].tolist()] * 2, [RAMP[-1].tolist()] * 2]


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
