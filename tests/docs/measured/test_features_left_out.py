"""Features that a build can leave out: the core, the build and the measurement name the same ones."""

from __future__ import annotations

import re

from tests.bench.ablations import SOURCES
from tests.bench.features_off import FEATURES


def test_the_measurement_knows_every_feature_of_the_core() -> None:
    text = (SOURCES / "base/features.hpp").read_text()
    assert [f.upper() for f in FEATURES] == re.findall(r"#ifndef PRIMRAY_HAS_(\w+)", text)


def test_every_feature_spares_code() -> None:
    constants = ["k" + "".join(part.capitalize() for part in f.split("_")) for f in FEATURES]
    text = "".join(p.read_text() for p in SOURCES.rglob("*.hpp") if p.name != "features.hpp")
    assert [c for c in constants if f"built::{c}" not in text] == []


def test_a_scene_that_needs_what_is_left_out_is_refused() -> None:
    """Each fact is asked about where a scene is finished."""
    asked = re.search(
        r"bool Scene::needs_left_out\(\) const \{(.*?)\n\}", (SOURCES / "build/builder.cpp").read_text(), re.DOTALL
    )
    assert asked
    facts = re.findall(r"Fact<built::k\w+> (\w+)", "".join(p.read_text() for p in SOURCES.rglob("*.hpp")))
    assert [f for f in facts if f"{f}.is_left_out()" not in asked[1] and f != "has_grouped"] == []
