"""Requests that no render could follow are refused when they are made, with a sentence."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import pytest

from primray import RenderSettings
from primray.errors import LimitError, SettingsError
from primray.settings.render_settings import CALLED_OTHERWISE, with_values


def test_defaults_are_good() -> None:
    assert RenderSettings().most_samples == 64


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("spp", 0),
        ("spp", -1),
        ("spp", 1.5),
        ("resolution", (0, 0)),
        ("resolution", (-1, 10)),
        ("resolution", (10, 2.5)),
        ("max_depth", 0),
        ("filter_width", 0.0),
        ("filter_width", float("nan")),
        ("filter_width", float("inf")),
        ("threads", 0),
        ("seed", -1),
        ("seed", 2**32),
        ("time_code", float("nan")),
        ("time_code", 1e308),
        ("time_code", 10**400),  # more than a double holds
        ("orbit_deg", 1e308),
        ("dome_rotation", -1e308),
        ("shutter", (0.0, 1e308)),
        pytest.param("spp", 10**5000, id="more digits than Python writes"),
        pytest.param("resolution", (10**5000, 1), id="so many pixels"),
        ("max_memory_bytes", 0),
        ("purposes", ("render", "final")),
        ("purposes", ()),
    ],
)
def test_nonsense_is_refused(name: str, value: Any) -> None:
    with pytest.raises(SettingsError, match=r"\w+ .*\w+"):
        RenderSettings(**{name: value})


@pytest.mark.parametrize(("name", "value"), [("spp", 2**25), ("resolution", (2_000_000, 2_000_000)), ("threads", 5000)])
def test_limits(name: str, value: Any) -> None:
    with pytest.raises(LimitError):
        RenderSettings(**{name: value})


def test_half_a_resolution_is_allowed() -> None:
    assert RenderSettings(resolution=(640, 0)).resolution == (640, 0)
    assert RenderSettings(resolution=(0, 480)).resolution == (0, 480)


@pytest.mark.parametrize(
    ("name", "hint"), [("samples", "spp"), ("width", "resolution"), ("quality", "target_error"), ("output", "save")]
)
def test_names_that_others_have_for_a_setting_are_known(name: str, hint: str) -> None:
    with pytest.raises(SettingsError, match=rf"unknown setting {name}; .*\b{hint}\b"):
        with_values(RenderSettings(), {name: 3})


def test_no_setting_is_called_otherwise() -> None:
    assert not CALLED_OTHERWISE.keys() & {field.name for field in fields(RenderSettings)}
