"""Patterns fire where and when their tables say; what no sensor has is an error that says so."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from primray import LidarPattern
from primray.errors import LimitError, SettingsError
from primray.sensor.lidar_pattern import NAMED


def test_firings_follow_steps_and_channels() -> None:
    pattern = LidarPattern.rotating([-1, 2], steps=4, rate_hz=5, azimuths_deg=[0, 3], times_s=[0, 1e-3], channel_numbers=[7, 9])
    firings = pattern.firings()
    assert firings.azimuth_deg.tolist() == [0, 3, 90, 93, 180, 183, 270, 273]
    assert firings.elevation_deg.tolist() == [-1, 2] * 4
    assert np.allclose(firings.time_s, [0, 0.001, 0.05, 0.051, 0.1, 0.101, 0.15, 0.151], rtol=0, atol=1e-12)
    assert firings.channel.tolist() == [7, 9] * 4
    assert firings.column.tolist() == [0, 0, 1, 1, 2, 2, 3, 3]
    assert firings.directions[2] == pytest.approx([0, np.cos(np.radians(1)), -np.sin(np.radians(1))], abs=1e-15)
    assert pattern.duration_s == pytest.approx(0.151)
    assert pattern.count == len(firings.time_s) == 8


def test_a_clockwise_head_turns_the_other_way() -> None:
    pattern = LidarPattern.rotating([0], steps=4, clockwise=True)
    assert pattern.firings().azimuth_deg.tolist() == [0, 270, 180, 90]
    assert pattern.firings().directions[1] == pytest.approx([0, -1, 0], abs=1e-15)


def test_a_sector_takes_its_share_of_a_turn() -> None:
    pattern = LidarPattern.rotating([0], steps=3, sweep_deg=(-45, 45), rate_hz=10)
    assert pattern.firings().azimuth_deg.tolist() == [315, 345, 15]
    assert pattern.firings().time_s == pytest.approx([0, 0.1 * 30 / 360, 0.1 * 60 / 360])


def test_the_vlp_16_fires_its_lasers_in_its_own_order() -> None:
    pattern = LidarPattern.named("vlp-16")
    firings = pattern.firings()
    assert firings.elevation_deg[:4].tolist() == [-15, 1, -13, 3]
    assert firings.channel[:4].tolist() == [0, 8, 1, 9]  # by elevation
    assert firings.time_s[15] == pytest.approx(15 * 2.304e-6)
    assert firings.time_s[16] == pytest.approx(55.296e-6, rel=1e-3)


@pytest.mark.parametrize("name", NAMED)
def test_named_patterns_are_read_back_from_their_json(name: str, tmp_path: Path) -> None:
    pattern = LidarPattern.named(name)
    file = tmp_path / "pattern.json"
    file.write_text(json.dumps(pattern.as_json()))
    assert LidarPattern.read(file) == pattern


def test_a_table_of_channels_is_a_csv(tmp_path: Path) -> None:
    table = tmp_path / "channels.csv"
    table.write_text("# made by hand\nelevation_deg,azimuth_deg,time_s,channel\n-10,1.5,0,1\n10,-1.5,2e-6,2\n")
    pattern = LidarPattern.read(table)
    assert (pattern.elevations_deg, pattern.azimuths_deg) == ((-10, 10), (1.5, -1.5))
    assert (pattern.times_s, pattern.channel_numbers) == ((0, 2e-6), (1, 2))
    turned = tmp_path / "pattern.json"
    turned.write_text(json.dumps({"table": "channels.csv", "steps": 512, "rate": 20, "range": [1, 80]}))
    found = LidarPattern.read(turned)
    assert (found.elevations_deg, found.steps, found.rate_hz, found.range_m) == ((-10, 10), 512, 20, (1, 80))
    few = LidarPattern.of({"pattern": "rotating-16", "channels": 5, "elevation_range": [-20, 20]})
    assert few.elevations_deg == (-20, -10, 0, 10, 20)
    assert few.range_m == (0.3, 100)


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"elevation": [1]}, "did you mean elevations"),
        ({"elevations": "low"}, "elevations cannot be 'low'"),
        ({"elevations": []}, "one channel at least"),
        ({"elevations": [0, 95]}, "-90 to 90"),
        ({"elevations": [0, float("nan")]}, "elevations cannot be"),
        ({"elevations": [0, 1, 2], "azimuths": [0, 1]}, "3 elevations and 2 azimuths"),
        ({"elevations": [0], "channels": 3}, "elevations are listed, or"),
        ({"elevations": [0], "times": [-1]}, "0 seconds or more"),
        ({"elevations": [0], "channel_numbers": [-1]}, "0 to 65535"),
        ({"steps": 0}, "one step at least"),
        ({"steps": 1.5}, "steps cannot be 1.5"),
        ({"rate": 0}, "above 0 Hz"),
        ({"range": [5, 5]}, "from 0 or more to more than that"),
        ({"sweep": [0, 400]}, "up to 360 degrees later"),
        ({"pattern": "rotating-33"}, "no pattern is named 'rotating-33'"),
        ({"pattern": "vlp-16", "table": "a.csv"}, "is named, or the table"),
        ({"table": "a.json"}, "a .csv file"),
        ([1, 2], "an object with members"),
    ],
)
def test_bad_members_are_errors(values: Any, sentence: str) -> None:
    with pytest.raises(SettingsError, match=sentence) as caught:
        LidarPattern.of(values, "here")
    assert caught.value.code == "lidar-pattern"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "elevation_deg must be there"),
        ("azimuth_deg\n1\n", "elevation_deg must be there"),
        ("elevation_deg,ring\n1,2\n", "not 'ring'"),
        ("elevation_deg\n", "no channels"),
        ("elevation_deg,azimuth_deg\n1\n", "row 2 has 1 values for 2 columns"),
        ("elevation_deg\nup\n", "row 2: elevation_deg cannot be 'up'"),
    ],
)
def test_bad_tables_are_errors(tmp_path: Path, text: str, sentence: str) -> None:
    file = tmp_path / "table.csv"
    file.write_text(text)
    with pytest.raises(SettingsError, match=sentence) as caught:
        LidarPattern.read(file)
    assert (caught.value.code, caught.value.where) == ("lidar-pattern", str(file))


def test_absent_and_broken_files_and_too_many_firings_are_errors(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="there is no such file"):
        LidarPattern.read(tmp_path / "no.json")
    (tmp_path / "bad.json").write_text("{")
    with pytest.raises(SettingsError, match="no JSON"):
        LidarPattern.read(tmp_path / "bad.json")
    with pytest.raises(LimitError, match="up to 67,108,864 firings"):
        LidarPattern.rotating([0] * 1000, steps=1_000_000)
