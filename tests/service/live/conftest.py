"""`primray view` as a user starts it, and its page in a real browser."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Page
from tests.service.page.conftest import Watched, browser, until

__all__ = ["browser"]

STAGE = """#usda 1.0
(
    upAxis = "Z"
    subLayers = [@./floor.usda@]
)
def Xform "world" (
    prepend variantSets = "paint"
    variants = {
        string paint = "red"
    }
)
{
    def Cube "box"
    {
        double size = 2
    }
    variantSet "paint" = {
        "red" {
            over "box" {
                color3f[] primvars:displayColor = [(0.8, 0.05, 0.05)]
            }
        }
        "blue" {
            over "box" {
                color3f[] primvars:displayColor = [(0.05, 0.05, 0.8)]
            }
        }
    }
}
def Camera "camera"
{
    float focalLength = 35
    float horizontalAperture = 36
    float verticalAperture = 24
    float2 clippingRange = (0.1, 1000)
    float3 xformOp:rotateXYZ = (75, 0, 20)
    double3 xformOp:translate = (3, -8, 2)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
}
def Camera "above"
{
    double3 xformOp:translate = (0, 0, 9)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def DomeLight "sky"
{
}
"""
FLOOR = """#usda 1.0
def Plane "floor"
{
    uniform token axis = "Z"
    double width = 20
    double length = 20
    double3 xformOp:translate = (0, 0, -1)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    color3f[] primvars:displayColor = [(%s)]
}
"""
GREY, GREEN = "0.4, 0.4, 0.4", "0.05, 0.6, 0.05"


@dataclass
class Running:
    """A viewer, its stage's folder, and its address."""

    process: subprocess.Popen[str]
    folder: Path
    url: str


def write_stage(folder: Path) -> Path:
    (folder / "shot.usda").write_text(STAGE)
    (folder / "floor.usda").write_text(FLOOR % GREY)
    return folder / "shot.usda"


def start_view(stage: Path, *flags: str) -> Running:
    program = Path(sys.executable).with_name("primray")
    asked = [str(program), "view", str(stage), "--no-open", "--res", "192", "0", "--spp", "16", *flags]
    process = subprocess.Popen(asked, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    line = process.stdout.readline()
    assert line.startswith("primray shows the stage at http://127.0.0.1:"), line or (process.stderr and process.stderr.read())
    return Running(process, stage.parent, line.split()[-1])


StartView = Callable[..., Running]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[StartView]:
    """A function that starts a viewer of a stage in this test's folder."""
    started: list[Running] = []

    def make(*flags: str, stage: Path | None = None) -> Running:
        started.append(start_view(stage or write_stage(tmp_path), *flags))
        return started[-1]

    yield make
    for running in started:
        running.process.terminate()
        assert running.process.wait(20) == 0
        assert running.process.stderr is not None
        assert "Traceback" not in running.process.stderr.read()


@pytest.fixture
def look(browser: Browser, start: StartView) -> Iterator[Callable[..., tuple[Page, Running]]]:
    """A function that starts a viewer and opens its page, at the finished picture; nothing may go wrong in it."""
    opened: list[Watched] = []

    def make(*flags: str, **options: Any) -> tuple[Page, Running]:
        running = start(*flags, **options)
        context = browser.new_context(viewport={"width": 1280, "height": 900}, locale="en-GB")
        watched = Watched(context.new_page(), running.url.rstrip("/"))
        watched.page.set_default_timeout(60_000)
        opened.append(watched)
        watched.page.goto(running.url)
        return watched.page, running

    make.opened = opened  # type: ignore[attr-defined]
    yield make
    for watched in opened:
        watched.page.context.close()
    wrong = [line for watched in opened for line in watched.wrong]
    assert not wrong, "\n".join(wrong)


def until_phase(page: Page, phase: str) -> None:
    until(page, f"document.body.dataset.phase === '{phase}'")


def until_finished(page: Page, after: int = 0) -> None:
    """A finished picture that is shown, later than that of the number."""
    shown = "Number(document.querySelector('.stage').dataset.pictures)"
    until(page, f"document.body.dataset.phase === 'finished' && {shown} > {after}")


def number(page: Page) -> int:
    return int(page.locator(".stage").get_attribute("data-pictures") or 0)


def mean_color(page: Page) -> tuple[float, float, float]:
    """Of the middle ninth of the picture, 0 to 255."""
    script = """() => {
      const canvas = document.querySelector(".stage canvas");
      const [w, h] = [Math.floor(canvas.width / 3), Math.floor(canvas.height / 3)];
      const data = canvas.getContext("2d").getImageData(w, h, w, h).data;
      const sums = [0, 0, 0];
      for (let i = 0; i < data.length; i += 4) for (let c = 0; c < 3; c++) sums[c] += data[i + c];
      return sums.map((sum) => (4 * sum) / data.length);
    }"""
    red, green, blue = page.evaluate(script)
    return red, green, blue
