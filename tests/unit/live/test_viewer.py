"""The thread that looks at a stage: drafts first, orders in between, and nothing lost by what goes wrong."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import primray
from primray.core import compiled, inputs
from primray.core import scene as core_scene
from primray.errors import SettingsError
from primray.live import viewer
from primray.live.viewed_scene import ViewedScene
from primray.live.viewer import Ladder, Looks, Viewer

STAGE = """#usda 1.0
def Sphere "s" (
    prepend variantSets = "v"
) {
    variantSet "v" = {
        "a" {
        }
    }
}
"""


class Watched:
    """A viewer, and all the states that it published."""

    def __init__(self, path: Path, spp: int) -> None:
        self.states: list[dict[str, Any]] = []
        self.news = threading.Condition()
        scene = ViewedScene(str(path), primray.RenderSettings(resolution=(64, 48)))
        self.viewer = Viewer(scene, spp, Looks(), self.changed)

    def changed(self) -> None:
        with self.news:
            self.states.append(self.viewer.state())
            self.news.notify_all()

    def until(self, holds: Callable[[dict[str, Any]], bool], after: int = 0) -> int:
        """The number of states by then."""
        with self.news:
            assert self.news.wait_for(lambda: any(map(holds, self.states[after:])), 60), self.states[-1]
            return len(self.states)


@pytest.fixture
def watched(tmp_path: Path) -> Iterator[Callable[[int], Watched]]:
    (tmp_path / "s.usda").write_text(STAGE)
    made: list[Watched] = []

    def make(spp: int) -> Watched:
        made.append(Watched(tmp_path / "s.usda", spp))
        made[-1].viewer.start()
        return made[-1]

    yield make
    for one in made:
        one.viewer.close()


def finished(state: dict[str, Any]) -> bool:
    return bool(state["phase"] == "finished")


def test_a_draft_comes_before_the_picture(watched: Callable[[int], Watched]) -> None:
    one = watched(32)
    one.until(finished)
    seen = list(dict.fromkeys((tuple(s["size"]), s["samples"]) for s in one.states if s["picture"]))
    assert seen[0] == ((16, 12), 2.0)
    assert seen[1][0] == (64, 48)
    assert seen[-1] == ((64, 48), 32.0)
    assert [samples for _, samples in seen] == sorted(samples for _, samples in seen)
    assert one.viewer.shown is not None
    assert one.viewer.shown.rgba.shape == (48, 64, 4)


def test_an_order_interrupts_and_the_picture_is_made_anew(watched: Callable[[int], Watched]) -> None:
    one = watched(1 << 16)
    before = one.until(lambda s: s["phase"] == "rendering" and s.get("samples", 0) > 8)
    start = time.monotonic()
    one.viewer.tell({"do": "tumble", "across": 0.1})
    one.until(lambda s: s["moved"] and s["samples"] == 2.0, before)
    assert time.monotonic() - start < 30


def test_the_exposure_interrupts_nothing(watched: Callable[[int], Watched]) -> None:
    one = watched(4096)
    one.until(lambda s: s["phase"] == "rendering" and s.get("samples", 0) > 3)
    before = len(one.states)
    one.viewer.tell({"do": "exposure", "stops": 1.5})
    one.until(finished)
    assert all(s["phase"] != "drafting" for s in one.states[before:])
    assert one.states[-1]["exposure"] == 1.5
    number = one.states[-1]["picture"]
    one.viewer.tell({"do": "exposure", "stops": "auto"})
    one.until(lambda s: s["exposure"] == "auto" and s["picture"] == number + 1)


def test_what_cannot_be_done_does_not_end_the_picture(watched: Callable[[int], Watched]) -> None:
    one = watched(4096)
    before = one.until(lambda s: s["phase"] == "rendering" and s.get("samples", 0) > 3)
    one.viewer.tell({"do": "variant", "prim": "/s", "set": "v", "name": "none such"})
    one.until(lambda s: s["problem"] is not None and s["problem"]["code"] == "unknown-variant", before)
    one.until(lambda s: s.get("samples") == 4096.0, before)


def test_a_defect_is_told_and_the_viewer_lives_on(watched: Callable[[int], Watched], monkeypatch: pytest.MonkeyPatch) -> None:
    one = watched(8)
    before = one.until(finished)
    with monkeypatch.context() as patch:
        patch.setattr(ViewedScene, "reset", lambda scene: 1 / 0)
        one.viewer.tell({"do": "reset"})
        one.until(lambda s: s["problem"] is not None and s["problem"]["code"] == "internal", before)
    before = len(one.states)
    one.viewer.tell({"do": "reset"})
    one.until(lambda s: finished(s) and s["problem"] is None, before)


def test_the_ladder_follows_the_speed_without_bouncing() -> None:
    ladder, whole = Ladder(), 2_000_000
    assert ladder.pixel_size(whole) == pytest.approx((whole / 48_000) ** 0.5)
    assert ladder.pixel_size(10_000) == 1  # the whole picture is smaller
    for _ in range(2):
        ladder.note(48_000, 0.01)
    assert ladder.pixels == 48_000  # two good drafts are chance
    ladder.note(48_000, 0.01)
    assert ladder.pixels == 192_000
    for seconds in (0.3, 0.05, 0.3, 0.05):
        ladder.note(192_000, seconds)
    assert ladder.pixels == 192_000  # and so is one slow one
    ladder.note(192_000, 0.13)
    ladder.note(192_000, 0.13)
    assert ladder.pixels == 48_000
    for _ in range(9):
        ladder.note(48_000, 0.03)
    assert ladder.pixels == 48_000  # four times that is too much
    for _ in range(9):
        ladder.note(48_000, 9.0)
    assert ladder.pixels == 12_000
    for _ in range(9):
        ladder.note(5_000, 0.001)  # the whole picture
    assert ladder.pixels == 12_000


def test_a_click_names_what_is_there_and_interrupts_nothing(watched: Callable[[int], Watched]) -> None:
    one = watched(4096)
    before = one.until(lambda s: s["phase"] == "rendering" and s.get("samples", 0) > 3)
    one.viewer.tell({"do": "select", "x": 0.5, "y": 0.5})
    one.until(lambda s: s["selected"] is not None and s["selected"]["prim"] == "/s", before)
    one.until(finished)
    assert all(s["phase"] != "drafting" for s in one.states[before:])
    assert [s["samples"] for s in one.states[before:]] == sorted(s["samples"] for s in one.states[before:])


def test_a_click_that_waits_for_the_stage_keeps_no_news(
    watched: Callable[[int], Watched], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A notebook's cell holds the stage while it asks the viewer: each would wait for the other."""
    asked, is_free = threading.Event(), threading.Event()

    def select(scene: ViewedScene, x: float, y: float) -> None:
        asked.set()
        assert is_free.wait(60)

    monkeypatch.setattr(ViewedScene, "select", select)
    monkeypatch.setattr(viewer, "RESTS_S", 60.0)
    one = watched(8)
    one.until(lambda s: s.get("samples") == 2.0 and s["doing"] is None)
    one.viewer.tell({"do": "select", "x": 0.5, "y": 0.5})
    assert asked.wait(60)
    asking = threading.Thread(target=one.viewer.edited, daemon=True)
    asking.start()
    asking.join(10)
    is_asking = asking.is_alive()
    is_free.set()
    assert not is_asking


def test_moves_that_wait_are_one_step_whose_time_is_told(watched: Callable[[int], Watched]) -> None:
    one = watched(8)
    before = one.until(finished)
    for number in range(200):
        one.viewer.tell({"do": "tumble", "across": 0.01, "token": f"page-{number}"})
    one.until(lambda s: finished(s) and s["moved"], before)
    steps = list(dict.fromkeys((s["token"], s["step_s"]) for s in one.states[before:] if s.get("token")))
    assert steps[-1][0] == "page-199"
    assert len(steps) < 50
    assert all(0 < seconds < 30 for _, seconds in steps)


def test_learning_ends_when_somebody_moves(watched: Callable[[int], Watched], monkeypatch: pytest.MonkeyPatch) -> None:
    """What is learnt before a long render may take seconds; it is not waited for."""
    waits: list[bool] = []

    def learn(scene: object, settings: object, lanes: int) -> tuple[int, int]:
        waits.append(True)
        while not settings.watched.is_asked:  # type: ignore[attr-defined]
            time.sleep(0.01)
        return 1, 1

    def asked(settings: primray.RenderSettings, **values: object) -> object:
        made = SimpleNamespace(watched=values.get("cancel"))
        return made if values.get("cancel") is not None else original(settings, **values)

    original = inputs.integrator_settings
    with monkeypatch.context() as patch:
        patch.setattr(compiled, "choose_splits", learn)
        patch.setattr(core_scene, "integrator_settings", asked)
        one = watched(64)
        before = one.until(lambda s: s.get("samples") == 3.0)
        while not waits:
            time.sleep(0.01)
        one.viewer.tell({"do": "tumble", "across": 0.1})
        one.until(lambda s: s["moved"] and s["samples"] == 2.0, before)
    one.viewer.tell({"do": "tumble", "across": 0.1})
    one.until(lambda s: finished(s) and s["moved"], before)


def test_the_picture_can_be_taken_away(watched: Callable[[int], Watched]) -> None:
    one = watched(8)
    with pytest.raises(SettingsError):
        Viewer(ViewedScene("none.usda", primray.RenderSettings()), 1, Looks(), lambda: None).saved(".png")
    one.until(finished)
    assert one.viewer.saved(".png").startswith(b"\x89PNG")
    assert one.viewer.saved(".exr").startswith(b"\x76\x2f\x31\x01")
    assert 'def Camera "primray_view"' in one.viewer.camera_text()
    before = len(one.states)
    one.viewer.tell({"do": "aov", "name": "normal"})
    one.until(lambda s: s["aov"] == "normal" and s["phase"] == "finished", before)
    assert one.viewer.saved(".png").startswith(b"\x89PNG")


def test_light_and_time_are_settings(watched: Callable[[int], Watched]) -> None:
    one = watched(8)
    before = one.until(finished)
    one.viewer.tell({"do": "set", "background": "#ff0000", "studio_light": "on"})
    one.until(lambda s: finished(s) and s["set"]["studio_light"] == "on", before)
    assert one.viewer.shown is not None
    assert one.viewer.shown.rgba[0, 0].tolist() == [255, 0, 0, 255]
    before = len(one.states)
    one.viewer.tell({"do": "set", "dome": "none such.exr"})
    one.until(lambda s: s["problem"] is not None and s["problem"]["code"] == "asset-missing", before)
    before = len(one.states)
    one.viewer.tell({"do": "set", "dome": None})
    one.until(lambda s: finished(s) and s["problem"] is None, before)
