"""The widget without a notebook: what its page asks and gets, edits, and what is left when nobody looks."""

from __future__ import annotations

import gc
import sys
import threading
import time
import weakref
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("anywidget", reason="skipped: no anywidget")
from pxr import Usd, UsdGeom, UsdLux

import primray
from primray.errors import PrimrayError, SettingsError, StageOpenError
from primray.notebook import view as module
from primray.notebook.view import VIEWS, View

STAGE = """#usda 1.0
def Cube "s" {
    color3f[] primvars:displayColor = [(0.8, 0.05, 0.05)]
    double size.timeSamples = {1: 1, 5: 2}
}
def DomeLight "d" {
}
def Camera "cam" {
    double3 xformOp:translate = (0.2, 0.1, 5)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
THREADS = {"viewer", "files", "courier", "preparing"}


class Page:
    """The page of a view: it draws whatever comes, and says so."""

    def __init__(self, view: View) -> None:
        self.view = view
        self.news = threading.Condition()
        self.messages: list[tuple[dict[str, Any], list[bytes]]] = []
        view.send = self.receive

    def receive(self, content: dict[str, Any], buffers: list[bytes] | None = None) -> None:
        with self.news:
            self.messages.append((content, buffers or []))
            self.news.notify_all()
        if content["kind"] == "update":
            self.say(kind="drawn", number=content["number"])

    def say(self, **content: Any) -> None:
        self.view._hear(self.view, content, [])

    def command(self, **command: Any) -> dict[str, Any] | None:
        """What was refused."""
        before = len(self.messages)
        self.say(kind="command", id="x", command=command)
        answers = [content for content, _ in self.messages[before:] if content["kind"] == "answer"]
        assert [answer["id"] for answer in answers] == ["x"]
        problem: dict[str, Any] | None = answers[0]["problem"]
        return problem

    def until(self, holds: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        def found() -> dict[str, Any] | None:
            states = [content["state"] for content, _ in self.messages if content["kind"] == "update"]
            return next((state for state in reversed(states) if holds(state)), None)

        with self.news:
            assert self.news.wait_for(lambda: found() is not None, 60), self.messages[-1]
            state = found()
        assert state is not None
        return state

    def pictures(self) -> int:
        return sum(len(buffers) for _, buffers in self.messages)


@pytest.fixture
def stage(tmp_path: Path) -> Path:
    (tmp_path / "s.usda").write_text(STAGE)
    return tmp_path / "s.usda"


@pytest.fixture
def page(stage: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Page]:
    monkeypatch.setattr(module, "GRACE_S", 0.0)
    view = View(stage, resolution=(48, 32), spp=4)
    yield Page(view)
    view.close()


def threads() -> set[str]:
    return {thread.name for thread in threading.enumerate()} & THREADS


def until(holds: Callable[[], bool]) -> None:
    end = time.monotonic() + 60
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_nothing_runs_until_it_is_shown(page: Page) -> None:
    assert not threads()
    assert page.view.image is None
    assert page.view.camera is None
    page.say(kind="shown", front="a")
    state = page.until(lambda state: state["phase"] == "finished")
    assert state["times"] == [1.0, 5.0] or tuple(state["times"]) == (1.0, 5.0)
    assert state["relmse"] is not None
    assert page.pictures() > 0
    assert page.view.image is not None
    assert page.view.image.resolution == (48, 32)


def test_the_camera_is_turned_and_read(page: Page, stage: Path) -> None:
    page.say(kind="shown", front="a")
    first = page.view.wait()
    before = page.view.camera
    assert page.command(do="tumble", across=0.2, down=0.1) is None
    until(lambda: page.view.camera is not before)
    turned = page.view.wait()
    camera = page.view.camera
    assert before is not None
    assert camera is not None
    assert not np.allclose(camera.world_from_camera, before.world_from_camera)
    assert not np.array_equal(first.pixels, turned.pixels)
    again = primray.render(stage, camera=camera, resolution=(48, 32), spp=4)
    assert np.mean(np.abs(again.pixels - turned.pixels)) < 0.02 * np.mean(turned.pixels)


def test_what_is_refused_is_said(page: Page) -> None:
    assert page.command(do="tumble") == {"title": "It was refused", "detail": "view-command: the view is closed", "where": ""}
    page.say(kind="shown", front="a")
    refused = page.command(do="jump")
    assert refused is not None
    assert refused["detail"].startswith("view-command: there is no command 'jump'")
    page.say(kind="command", id="y", command=[1])
    page.say(kind="nothing")


def test_a_click_is_observed(page: Page) -> None:
    seen: list[Any] = []
    page.view.observe(lambda change: seen.append(change["new"]), "selected")
    page.say(kind="shown", front="a")
    page.view.wait()
    page.command(do="select", x=0.5, y=0.5)
    page.until(lambda state: state["selected"] is not None)
    assert page.view.selected["prim"] == "/s"
    assert len(page.view.selected["position"]) == 3
    page.command(do="deselect")
    until(lambda: page.view.selected is None)
    assert [one and one["prim"] for one in seen] == ["/s", None]
    page.view.observe(lambda change: 1 / 0, "selected")  # pictures go on
    page.command(do="select", x=0.5, y=0.5)
    page.command(do="tumble", across=0.2)
    before = page.pictures()
    page.view.wait()
    until(lambda: page.pictures() > before)


def test_a_pixel_is_explained_and_edits_that_were_taken_for_it_are_shown(page: Page) -> None:
    """The thread that explains pixels may be the first to read the stage after a cell has edited it."""
    page.say(kind="shown", front="a")
    red = page.view.wait().pixels
    page.command(do="explain", x=0.5, y=0.5)
    state = page.until(lambda state: (state["explained"] or {}).get("phase") == "explained")
    assert state["selected"]["prim"] == "/s"
    assert [part["name"] for part in state["explained"]["splits"][0]["parts"]] == ["/d"]
    UsdGeom.Cube.Get(page.view.stage, "/s").GetDisplayColorAttr().Set([(0.05, 0.05, 0.8)])
    scene = page.view._scene
    assert scene is not None
    assert scene._kept is not None
    scene._kept.translated(scene.settings)  # as that thread does
    assert scene.is_edited()
    module._show_edits()
    page.until(lambda state: state["explained"] is not None and state["explained"]["outdated"])
    blue = page.view.wait().pixels
    assert red[16, 24, 0] > 2 * red[16, 24, 2]
    assert blue[16, 24, 2] > 2 * blue[16, 24, 0]
    assert not scene.is_edited()


def test_edits_are_shown(page: Page) -> None:
    page.say(kind="shown", front="a")
    red = page.view.wait().pixels
    color = UsdGeom.Cube.Get(page.view.stage, "/s").GetDisplayColorAttr()
    color.Set([(0.05, 0.05, 0.8)])
    blue = page.view.wait().pixels
    assert red[16, 24, 0] > 2 * red[16, 24, 2]
    assert blue[16, 24, 2] > 2 * blue[16, 24, 0]
    with page.view.edit() as stage:
        UsdGeom.Cube.Get(stage, "/s").GetDisplayColorAttr().Set([(0.05, 0.8, 0.05)])
    green = page.view.wait().pixels
    assert green[16, 24, 1] > 2 * green[16, 24, 2]
    before = page.view.image
    color.Set([(0.8, 0.05, 0.05)])
    page.view.refresh()
    assert page.view.image is not before


def test_cells_that_edit_keep_threads_from_reading(page: Page) -> None:
    """Otherwise a picture could be of half of an edit, or worse."""
    page.say(kind="shown", front="a")
    page.view.wait()
    module.LOCK.hold()  # as a cell does
    try:
        page.command(do="tumble", across=0.1)
        assert page.view.camera is not None
        before = page.view.camera.world_from_camera
        time.sleep(0.2)
        assert np.array_equal(page.view.camera.world_from_camera, before)
        page.view.wait()  # which lets go meanwhile
        assert not np.array_equal(page.view.camera.world_from_camera, before)
    finally:
        module.LOCK.let_go()


def test_a_stage_in_memory() -> None:
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.Sphere.Define(stage, "/s")
    light = UsdLux.DomeLight.Define(stage, "/d")
    view = View(stage, resolution=(24, 16), spp=2)
    dark = view.wait().pixels.mean()
    light.CreateIntensityAttr().Set(8.0)
    assert view.wait().pixels.mean() > 2 * dark
    assert view.stage is stage
    view.close()


def test_what_goes_wrong_is_said_with_its_code_and_place(stage: Path) -> None:
    view = View(stage, resolution=(48, 32), spp=4, camera="/cam")
    page = Page(view)
    page.say(kind="shown", front="a")
    view.wait()
    view.stage.RemovePrim("/cam")
    with pytest.raises(PrimrayError) as raised:
        view.wait()
    state = page.until(lambda state: state["phase"] == "failed")
    assert state["problem"]["code"] == raised.value.code == "unknown-camera"
    assert state["problem"]["where"] == "/cam"
    assert view.problem is not None
    view.stage.GetRootLayer().Reload(force=True)
    view.wait()
    assert view.problem is None
    view.close()


@pytest.mark.parametrize(
    ("given", "error", "code"),
    [
        ({"stage": "none.usda"}, StageOpenError, "stage-open"),
        ({"spp": 0}, SettingsError, "settings-error"),
        ({"samples": 4}, SettingsError, "unknown-setting"),
        ({"view": "none such"}, SettingsError, "unknown-view"),
    ],
)
def test_what_cannot_be_shown_is_refused_at_once(
    stage: Path, given: dict[str, Any], error: type[PrimrayError], code: str
) -> None:
    with pytest.raises(error) as raised:
        View(**({"stage": stage} | given))
    assert raised.value.code == code
    assert not threads()


def test_a_view_that_no_cell_shows_sleeps(page: Page) -> None:
    page.say(kind="shown", front="a")
    page.say(kind="shown", front="b")
    page.view.wait()
    page.command(do="tumble", across=0.2)
    page.view.wait()
    camera = page.view.camera
    assert camera is not None
    kept = weakref.ref(page.view._scene._prepared)  # type: ignore[union-attr]
    page.say(kind="gone", front="a")
    time.sleep(0.1)
    assert threads()
    page.say(kind="gone", front="b")
    until(lambda: not threads())
    gc.collect()
    until(lambda: kept() is None)
    page.say(kind="shown", front="c")
    page.view.wait()
    assert page.view.camera is not None
    assert np.allclose(page.view.camera.world_from_camera, camera.world_from_camera)


def test_a_view_that_is_shown_again_stays_awake(page: Page) -> None:
    """The thread that was about to end it looks again."""
    page.say(kind="shown", front="a")
    page.view.wait()
    with page.view._life:
        page.say(kind="gone", front="a")
        time.sleep(0.2)
        page.say(kind="shown", front="b")
    until(lambda: not any(thread.name == "sleep" for thread in threading.enumerate()))
    assert page.command(do="tumble", across=0.1) is None


def test_a_view_that_is_closed_frees_all(stage: Path) -> None:
    view = View(stage, resolution=(48, 32), spp=4)
    page = Page(view)
    page.say(kind="shown", front="a")
    view.wait()
    scene = weakref.ref(view._scene)
    view.close()
    assert not threads()
    assert page.messages[-1][0] == {"kind": "closed"}
    assert view not in VIEWS
    gc.collect()
    assert scene() is None
    with pytest.raises(SettingsError, match="closed"):
        _ = view.stage
    view.close()


def test_two_views_of_one_stage_share_its_edits(stage: Path) -> None:
    one, other = (View(stage, resolution=(24, 16), spp=2) for _ in range(2))
    first = other.wait().pixels
    one.wait()
    UsdGeom.Cube.Get(one.stage, "/s").GetDisplayColorAttr().Set([(0.05, 0.05, 0.8)])
    module._show_edits()
    assert np.abs(other.wait().pixels - first).mean() > 0.01
    one.close()
    other.wait()
    other.close()


def test_without_anywidget_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("primray.notebook.find_spec", lambda name: None)
    monkeypatch.delitem(sys.modules, "primray.notebook.view", raising=False)
    with pytest.raises(PrimrayError) as raised:
        _ = primray.notebook.View
    assert (raised.value.code, raised.value.where) == ("extra-missing", "anywidget")
    assert "pip install 'primray[notebook]'" in raised.value.message
