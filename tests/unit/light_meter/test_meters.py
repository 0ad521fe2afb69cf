"""Grids of light meters, and files of them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from primray import LightMeter, MeterGrid
from primray.errors import SettingsError
from primray.light_meter.meters import grid_spacing, read_meters


@pytest.mark.parametrize(("length", "spacing"), [(1.0, 0.2), (5.0, 0.62), (10.0, 1.0), (1e6, 10.0)])
def test_the_spacing_of_en_12464(length: float, spacing: float) -> None:
    assert grid_spacing(length) == pytest.approx(spacing, abs=0.005)


def test_a_grid_is_at_the_middles_of_its_cells() -> None:
    grid = MeterGrid("g", (1, 0, 2), (0, 0, 4), (2, 0, 0), (4, 2), 0.0)
    meters = grid.meters()
    assert [meter.name for meter in meters][:3] == ["g[0,0]", "g[1,0]", "g[2,0]"]
    assert meters[0].position == (1.5, 0.0, 2.5)
    assert meters[-1].position == (2.5, 0.0, 5.5)
    assert all(meter.direction == (0.0, 1.0, 0.0) for meter in meters)
    turned = MeterGrid("g", (1, 0, 2), (2, 0, 0), (0, 0, 4), (2, 4), 0.0).meters()
    assert turned[0].direction == (0.0, 1.0, 0.0)  # whichever side of it points up


def test_a_border_is_left_out_where_there_is_room_for_it() -> None:
    wide = np.array([meter.position for meter in MeterGrid("g", (0, 0, 0), (0, 0, 6), (4, 0, 0)).meters()])
    low, high = wide.min(axis=0), wide.max(axis=0)
    assert (low[[0, 2]] > 0.5).all()
    assert (high[[0, 2]] < (3.5, 5.5)).all()
    assert len(MeterGrid("g", (0, 0, 0), (0, 0, 600), (400, 0, 0)).meters(meters_per_unit=0.01)) == len(wide)
    narrow = MeterGrid("g", (0, 0, 0), (0, 0, 0.4), (0.4, 0, 0)).meters()
    assert len(narrow) == 16
    with pytest.raises(SettingsError, match="leaves nothing"):
        MeterGrid("g", (0, 0, 0), (0, 0, 1), (1, 0, 0), border=0.5).meters()


def test_files_of_meters(tmp_path: Path) -> None:
    path = tmp_path / "meters.json"
    rows = [
        {"name": "desk", "position": [0, 0.75, 0]},
        {"name": "face", "position": [0, 1.2, 0], "kind": "cylindrical"},
        {"name": "floor", "corner": [0, 0, 0], "across": [0, 0, 2], "along": [2, 0, 0], "counts": [2, 2], "border": 0},
    ]
    path.write_text(json.dumps(rows))
    desk, face, floor = read_meters(path)
    assert isinstance(desk, LightMeter)
    assert isinstance(face, LightMeter)
    assert face.kind.value == "cylindrical"
    assert isinstance(floor, MeterGrid)
    assert len(floor.meters()) == 4


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", "is no JSON"),
        ("{}", "is a list"),
        ("[1]", "is an object"),
        ('[{"name": "a"}]', "needs a position"),
        ('[{"name": "a", "positon": [0, 0, 0]}]', "has no positon"),
        ('[{"name": "a", "position": [0, 0]}]', "three finite numbers"),
        ('[{"name": "a", "position": [0, 0, 0], "direction": [0, 0, 0]}]', "must not be 0"),
        ('[{"name": "a", "position": [0, 0, 0], "kind": "lux"}]', "kind is one of"),
        ('[{"name": "a", "corner": [0, 0, 0], "across": [1, 0, 0], "along": [0, 0, 1], "counts": [0, 1]}]', "above 0"),
    ],
)
def test_files_that_are_refused(text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "meters.json"
    path.write_text(text)
    with pytest.raises(SettingsError, match=said):
        read_meters(path)
