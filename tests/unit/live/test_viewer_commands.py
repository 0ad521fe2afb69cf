"""Commands from outside are checked before anything is done."""

from __future__ import annotations

from typing import Any

import pytest

from primray.errors import SettingsError
from primray.live.viewer import order_of, stops_of


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
