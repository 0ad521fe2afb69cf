"""The thread that looks at a stage: drafts first, orders in between, and nothing lost by what goes wrong."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import primray
from primray.live.viewed_scene import ViewedScene
from primray.live.viewer import Looks, Viewer

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
