"""What is sent to a page, and when: one message at a time, the newest, and not too much of it."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest

from primray.live.viewer import Shown
from primray.notebook import courier as module
from primray.notebook.courier import MOST_BYTES, ROWS, WINDOW_S, Allowance, Courier, brief, encoded


class Sent:
    """A courier of a viewer that is played, and what it sent."""

    def __init__(self) -> None:
        self.news = threading.Condition()
        self.viewer = SimpleNamespace(shown=None, state=lambda: self.state)
        self.state: dict[str, Any] = {"phase": "drafting", "picture": 0}
        self.messages: list[tuple[dict[str, Any], list[bytes]]] = []
        self.told: list[dict[str, Any]] = []
        self.courier = Courier(self.viewer, self.send, self.told.append, self.news)  # type: ignore[arg-type]

    def send(self, content: dict[str, Any], buffers: list[bytes]) -> None:
        with self.news:
            self.messages.append((content, buffers))
            self.news.notify_all()

    def picture(self, number: int) -> None:
        self.viewer.shown = Shown(number, np.full((4, 6, 4), 255, np.uint8), f"t-{number}")
        self.state = {"phase": "rendering", "picture": number}
        self.courier.changed()

    def until(self, count: int) -> None:
        with self.news:
            assert self.news.wait_for(lambda: len(self.messages) >= count, 30)


@pytest.fixture
def sent(monkeypatch: pytest.MonkeyPatch) -> Iterator[Sent]:
    monkeypatch.setattr(module, "PATIENCE_S", 1000.0)
    made = Sent()
    made.courier.start()
    yield made
    made.courier.close()


def test_the_newest_is_sent_once_the_last_was_drawn(sent: Sent) -> None:
    sent.until(1)
    for number in (1, 2, 3):
        sent.picture(number)
    with sent.news:
        assert not sent.news.wait_for(lambda: len(sent.messages) > 1, 0.2)
    sent.courier.drawn(7)  # not what was sent
    with sent.news:
        assert not sent.news.wait_for(lambda: len(sent.messages) > 1, 0.2)
    sent.courier.drawn(sent.messages[0][0]["number"])
    sent.until(2)
    content, buffers = sent.messages[1]
    assert content["state"]["picture"] == 3
    assert content["picture"] == {"type": "image/jpeg", "token": "t-3"}
    assert len(buffers) == 1
    assert sent.told[-1]["picture"] == 3


def test_a_picture_is_sent_once_but_again_to_a_page_that_comes(sent: Sent) -> None:
    sent.picture(1)
    sent.courier.drawn(1)
    sent.until(1)
    while not sent.messages[-1][1]:
        sent.courier.drawn(sent.messages[-1][0]["number"])
        sent.until(len(sent.messages))
    first = len(sent.messages)
    sent.courier.drawn(sent.messages[-1][0]["number"])
    sent.courier.changed()
    sent.until(first + 1)
    assert sent.messages[-1][0]["picture"] is None
    sent.courier.begin_again()
    sent.until(first + 2)
    assert len(sent.messages[-1][1]) == 1


def test_a_page_that_comes_while_news_are_sent_gets_the_picture(sent: Sent, monkeypatch: pytest.MonkeyPatch) -> None:
    sent.picture(1)
    sent.until(1)
    while not sent.messages[-1][1]:
        sent.courier.drawn(sent.messages[-1][0]["number"])
        sent.until(len(sent.messages))
    came = list[int]()

    def delay(size: int, now: float) -> float:
        if not came:
            came.append(size)
            sent.courier.begin_again()
        return 0.0

    monkeypatch.setattr(module, "ALLOWANCE", SimpleNamespace(delay=delay))
    first = len(sent.messages)
    sent.courier.drawn(sent.messages[-1][0]["number"])
    sent.courier.changed()
    sent.until(first + 1)
    assert came == [0]
    sent.courier.drawn(sent.messages[first][0]["number"])
    sent.until(first + 2)
    assert len(sent.messages[first + 1][1]) == 1


def test_what_nobody_draws_is_taken_for_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "PATIENCE_S", 0.05)
    made = Sent()
    made.courier.start()
    made.until(1)
    made.picture(1)
    made.until(2)
    made.courier.close()


def test_views_share_what_may_be_sent() -> None:
    allowance = Allowance()
    assert allowance.delay(10 * MOST_BYTES, 100.0) == 0  # one picture, however large
    assert allowance.delay(1, 101.0) == pytest.approx(WINDOW_S - 1)
    assert allowance.delay(MOST_BYTES // 2, 100.0 + WINDOW_S) == 0
    assert allowance.delay(MOST_BYTES // 2, 101.0 + WINDOW_S) == 0
    assert allowance.delay(2, 102.0 + WINDOW_S) == pytest.approx(1.0)


def test_finished_pictures_lose_nothing(tmp_path: Any) -> None:
    rgba = np.random.default_rng(1).integers(0, 256, (32, 48, 4), np.uint8)
    rgba[..., 3] = 255
    for is_finished, opaque, kind in ((True, True, "png"), (False, False, "png"), (False, True, "jpeg")):
        given = rgba.copy()
        given[0, 0, 3] = 255 if opaque else 128
        file, media_type = encoded(given, is_finished)
        assert media_type == f"image/{kind}"
        (tmp_path / f"a.{kind}").write_bytes(file)
        if kind == "png" and opaque:
            assert np.array_equal(np.asarray(oiio.ImageBuf(str(tmp_path / "a.png")).get_pixels(oiio.UINT8)), rgba[..., :3])


def test_a_state_is_short_however_much_there_is_to_say() -> None:
    rows = [{"severity": "warning", "code": "a", "prim_path": f"/p{k}", "message": "m"} for k in range(10_000)]
    state = {"phase": "finished", "diagnostics": rows, "cameras": [f"/c{k}" for k in range(1000)], "set": {"time_code": 3.0}}
    found = brief({**state, "can": {}, "variants": []})
    assert len(found["diagnostics"]) == len(found["cameras"]) == ROWS
    assert found["counts"] == {"warning": 10_000}
    assert found["time"] == 3.0
    assert not found.keys() & {"can", "variants", "set"}
