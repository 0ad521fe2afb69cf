"""Commands from outside are checked before anything is done."""

from __future__ import annotations

from typing import Any

import pytest

from primray.errors import SettingsError
from primray.live.commands import order_of, stops_of


@pytest.mark.parametrize(
    "command",
    [
        {},
        {"do": "render"},
        {"do": ["tumble"]},
        {"do": "tumble", "across": "1"},
        {"do": "tumble", "across": True},
        {"do": "pan", "down": 1e9},
        {"do": "dolly", "steps": float("nan")},
        {"do": "dolly", "steps": float("inf")},
        {"do": "camera", "path": 3},
        {"do": "variant", "prim": "/a", "set": "s"},
        {"do": "pivot", "x": 1.5, "y": 0},
        {"do": "select", "x": 0.5, "y": "low"},
        {"do": "fly", "ahead": None},
        {"do": "look", "across": []},
        {"do": "set"},
        {"do": "set", "spp": 3},
        {"do": "set", "dome_rotation": 10, "session_layer": "/etc/passwd"},
        {"do": "aov", "name": "deep"},
        {"do": "denoise", "on": 1},
    ],
)
def test_what_is_no_command(command: dict[str, Any]) -> None:
    with pytest.raises(SettingsError) as caught:
        order_of(command)
    assert caught.value.code == "view-command"


def test_exposures() -> None:
    assert stops_of({"stops": "auto"}) == "auto"
    assert stops_of({"stops": -1}) == -1.0
    with pytest.raises(SettingsError):
        stops_of({"stops": "bright"})


@pytest.mark.parametrize(
    ("values", "code"),
    [
        ({"dome_rotation": "far"}, "settings-error"),
        ({"studio_light": "bright"}, "settings-error"),
        ({"time_code": float("inf")}, "settings-error"),
        ({"dome": ""}, "settings-error"),
    ],
)
def test_settings_are_checked_as_those_of_a_render(values: dict[str, Any], code: str) -> None:
    with pytest.raises(SettingsError) as caught:
        order_of({"do": "set", **values})
    assert caught.value.code == code
