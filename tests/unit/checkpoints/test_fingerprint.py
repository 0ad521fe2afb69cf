"""Digests of scenes: any change of what is seen shows, where it comes from does not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from enum import Enum
from typing import Any

import numpy as np
import pytest
from tests.kernels.scenes import SCENES

from primray.checkpoints.fingerprint import IGNORED_FIELDS, fingerprint

PARTS = ("shapes", "surfaces", "static", "prototypes", "placements", "lights", "camera")


def changed(value: Any) -> Any:
    """Something else of the same kind."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, Enum):
        kinds = list(type(value))
        return kinds[(kinds.index(value) + 1) % len(kinds)]
    if isinstance(value, float):
        return float(np.nextafter(value, np.inf))
    if isinstance(value, np.ndarray):
        other = value.copy()
        flat = other.reshape(-1).view(np.uint8)
        flat[-1] ^= 1
        return other
    if value is None:
        return np.zeros((1, 3), np.float32)
    return value + ("x" if isinstance(value, str) else 1)


def variants(value: Any) -> list[tuple[str, Any]]:
    """The value with one thing changed, for each thing in it."""
    if is_dataclass(value) and not isinstance(value, type):
        return [
            (f"{f.name}.{where}", replace(value, **{f.name: other}))
            for f in fields(value)
            if f.name not in IGNORED_FIELDS
            for where, other in variants(getattr(value, f.name))
        ]
    if isinstance(value, tuple):
        found = [
            (f"{k}.{where}", (*value[:k], other, *value[k + 1 :]))
            for k, item in enumerate(value)
            for where, other in variants(item)
        ]
        return [*found, ("fewer", value[:-1])] if value else found
    return [("", changed(value))]


@pytest.mark.parametrize("name", SCENES)
def test_every_change_shows(name: str) -> None:
    made = SCENES[name]()
    d, textures = made.description, {file: list(images) for file, images in made.textures.items()}
    whole = fingerprint(d, textures)
    assert fingerprint(d, textures) == whole
    tried = 0
    for part in PARTS:
        for where, other in variants(getattr(d, part))[:80]:
            if "file." in where or "texture." in where or where.endswith("path"):
                continue
            assert fingerprint(replace(d, **{part: other}), textures) != whole, f"{part}.{where}"
            tried += 1
    assert tried > 20


def test_names_and_places_do_not_show() -> None:
    made = SCENES["materials"]()
    d = made.description
    renamed = replace(
        d,
        shapes=tuple(replace(shape, path="/other") for shape in d.shapes),
        camera=replace(d.camera, path="/other"),
        lights=tuple(replace(light, path="/other") for light in d.lights),
    )
    assert fingerprint(renamed, made.textures) == fingerprint(d, made.textures)


def textured() -> tuple[str, Any]:
    return next((name, made) for name, make in SCENES.items() if (made := make()).textures)


def test_textures_are_what_they_hold() -> None:
    _, made = textured()
    whole = fingerprint(made.description, made.textures)
    file, images = next(iter(made.textures.items()))

    def with_images(change: Callable[[Any], Any]) -> dict[str, str]:
        return fingerprint(made.description, {**made.textures, file: [(n, change(image)) for n, image in images]})

    assert with_images(lambda image: replace(image, stored=image.stored.copy())) == whole
    assert with_images(lambda image: replace(image, stored=changed(image.stored))) != whole
    assert with_images(lambda image: replace(image, srgb_channels=image.srgb_channels + 1)) != whole
    assert fingerprint(made.description, {k: v for k, v in made.textures.items() if k != file}) != whole


def test_the_part_that_differs_is_named() -> None:
    d = SCENES["all lights"]().description
    whole = fingerprint(d, {})
    dimmer = fingerprint(replace(d, lights=d.lights[1:]), {})
    assert [name for name in whole if whole[name] != dimmer[name]] == ["lights"]
