"""Passes that the add-on gives Blender, read from the multilayer EXRs that Blender writes: Cryptomattes and light groups beside
Cycles', errors, the denoised picture; and what ends a render."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from . import host

Parts = dict[str, npt.NDArray[np.float32]]
LAYERS = 4  # of scenes.py's depth of 8


@pytest.fixture(scope="module")
def masks(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, Any]]:
    host.python()
    return {row["name"]: row for row in host.run("masks", tmp_path_factory.mktemp("masks"))}


@pytest.fixture(scope="module")
def ours(masks: dict[str, dict[str, Any]]) -> Parts:
    return host.parts(masks["PRIMRAY"]["file"])


@pytest.fixture(scope="module")
def theirs(masks: dict[str, dict[str, Any]]) -> Parts:
    return host.parts(masks["CYCLES"]["file"])


def coverage(parts: Parts, kind: str) -> dict[int, npt.NDArray[np.float32]]:
    """Return the coverage of pixels by id."""
    pairs = np.concatenate([parts[f"{kind}{layer:02d}"] for layer in range(LAYERS)], axis=2)
    ids, weights = np.ascontiguousarray(pairs[..., 0::2]).view(np.uint32), pairs[..., 1::2]
    return {int(found): np.where(ids == found, weights, 0).sum(axis=2) for found in np.unique(ids[weights > 0])}


@pytest.mark.parametrize("kind", ["CryptoObject", "CryptoMaterial", "CryptoAsset"])
def test_cryptomattes_are_cycles_(kind: str, ours: Parts, theirs: Parts) -> None:
    found, wanted = coverage(ours, kind), coverage(theirs, kind)
    assert set(found) == set(wanted)
    for number in wanted:
        assert abs(found[number].sum() / wanted[number].sum() - 1) < 0.01
        assert np.abs(found[number] - wanted[number]).max() < 0.15  # of edges, with the noise of their samples


@pytest.mark.parametrize(
    ("kind", "names"),
    [
        ("CryptoObject", {"le sol", "Grid", "W\u00fcrfel.001", "on top", "glow"}),
        ("CryptoMaterial", {"matte", "matte.001", "balls", "red, shiny", "glow", "default_surface"}),
        ("CryptoAsset", {"le sol", "Grid", "W\u00fcrfel.001", "glow"}),
    ],
)
def test_manifests_name_what_blender_does(kind: str, names: set[str], masks: dict[str, dict[str, Any]]) -> None:
    """Under the keys of Cycles, whose manifests also have what is not seen."""
    found, wanted = (host.header(masks[engine]["file"]) for engine in ("PRIMRAY", "CYCLES"))
    (key,) = [key for key, value in wanted.items() if key.startswith("cryptomatte/") and value == f"ViewLayer.{kind}"]
    told, known = (json.loads(header[key.replace("/name", "/manifest")]) for header in (found, wanted))
    assert set(told) == names
    assert told.items() <= known.items()
    for what in ("name", "hash", "conversion"):
        assert found[key.replace("/name", f"/{what}")] == wanted[key.replace("/name", f"/{what}")]


@pytest.mark.parametrize("group", ["key", "l'air", "glows"])
def test_light_groups_are_cycles_(group: str, ours: Parts, theirs: Parts) -> None:
    found, wanted = ours[f"Combined_{group}"], theirs[f"Combined_{group}"]
    assert found.shape == wanted.shape == (64, 64, 3)
    assert wanted.mean() > 0.05
    assert np.abs(found.mean(axis=(0, 1)) / wanted.mean(axis=(0, 1)) - 1).max() < 0.006


def test_light_groups_are_parts_of_the_picture(ours: Parts) -> None:
    groups = sum(ours[f"Combined_{group}"].astype(np.float64) for group in ("key", "l'air", "glows"))
    rest = ours["Combined"][..., :3] - groups
    assert rest.min() > -1e-5
    assert rest.mean() > 0.003  # the lamp in no group


def test_nothing_is_noted_of_masks_and_groups(masks: dict[str, dict[str, Any]]) -> None:
    assert masks["PRIMRAY"]["notes"] == []


def test_the_overlay_is_blue_where_the_error_is_small_and_green_where_it_is_larger(ours: Parts) -> None:
    overlay, error, picture = ours["Error Overlay"], ours["Error"][..., 0], ours["Combined"][..., :3].mean(axis=2)
    assert (overlay[..., 3] == 1).all()
    green = overlay[..., 1] - overlay[..., 2]
    relative = error / np.sqrt(picture**2 + 0.01)
    assert green[relative <= np.quantile(relative, 0.1)].mean() < -0.1
    assert green[relative > np.quantile(relative, 0.99)].mean() > 0.1


def test_what_ends_a_render(tmp_path: Path) -> None:
    rows = {row["name"]: row for row in host.run("stops", tmp_path)}
    assert rows["error"]["stop"] == "target-error"
    assert rows["error"]["relmse"] <= 0.01
    assert rows["error"]["samples"][1] < 1 << 20
    assert "target error" in rows["error"]["words"]
    assert rows["time"]["stop"] == "time-limit"
    assert rows["time"]["samples"][1] < 1 << 20
    assert rows["samples"]["samples"] == [4, 4]
    parts = host.parts(rows["samples"]["file"])
    assert set(parts) == {"Combined", "Denoised"}
    truth = host.parts(rows["many samples"]["file"])["Combined"][..., :3]
    noisy, denoised = (float(np.square(parts[name][..., :3] - truth).mean()) for name in ("Combined", "Denoised"))
    assert 0 < denoised < 0.6 * noisy
