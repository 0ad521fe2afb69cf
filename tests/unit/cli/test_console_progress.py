"""Progress as JSON lines and as a bar: rates, the time left, and how often lines come."""

from __future__ import annotations

import io
import json
import sys

import pytest

from primray.cli import console
from primray.cli.console import showing
from primray.render import progress


class Clock:
    now = 100.0

    def monotonic(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    for module in (console, progress):
        monkeypatch.setattr(module, "time", clock)
    return clock


def test_json_lines_have_rates_and_the_time_left(clock: Clock, capsys: pytest.CaptureFixture[str]) -> None:
    with showing("a.exr", as_json=True) as show:
        clock.now += 5  # opening the stage
        show(0.0, 0, 0)
        clock.now += 2
        show(0.25, 1000, 3000)
    first, second = (json.loads(line) for line in capsys.readouterr().out.splitlines())
    assert first["eta_s"] is None
    assert second == {
        "type": "progress",
        "output": "a.exr",
        "fraction": 0.25,
        "samples": 1000,
        "rays": 3000,
        "samples_per_s": 500,
        "rays_per_s": 1500,
        "elapsed_s": 2,
        "eta_s": 6,
    }


def test_json_lines_come_twice_a_second_and_at_the_end(clock: Clock, capsys: pytest.CaptureFixture[str]) -> None:
    with showing("a.exr", as_json=True) as show:
        for quarter in range(4):
            show(quarter / 4, quarter, quarter)
            clock.now += 0.25
        show(1.0, 10, 10)
    assert [json.loads(line)["fraction"] for line in capsys.readouterr().out.splitlines()] == [0.0, 0.5, 1.0]


def test_nothing_is_shown_without_a_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    with showing("a.exr", as_json=False) as show:
        show(0.5, 1, 1)
    assert capsys.readouterr() == ("", "")


def test_the_bar_on_a_terminal(monkeypatch: pytest.MonkeyPatch, clock: Clock) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "200")
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    with showing("[a].exr", as_json=False) as show:
        show(0.0, 0, 0)
        clock.now += 60
        show(0.25, 60_000_000, 180_000_000)
    shown = terminal.getvalue()
    assert "[a].exr" in shown
    assert "25%" in shown
    assert "1.00 Msamples/s 3.0 Mrays/s ETA 0:03:00" in shown
