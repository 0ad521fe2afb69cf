"""Lights that give what they are to give through an image, once that is read or cannot be."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from primray.description import Doubles, Floats, Light, LightType, TextureFile
from primray.description.lighting import Photometric
from primray.diagnostics import Diagnostics
from primray.photometry.flux import amount_of_unit_emission
from primray.textures import texture_set
from primray.textures.texture import Texture
from primray.textures.texture_set import with_read_textures

FILE = TextureFile("a", "raw")
WEIGHTS = (0.2126, 0.7152, 0.0722)


def read(light: Light, image: np.ndarray | None) -> tuple[list[Light], list[str]]:
    diagnostics = Diagnostics()
    textures = {} if image is None else {FILE: [(0, Texture(np.asarray(image, np.float32)))]}
    found = with_read_textures([light], textures, diagnostics)
    return list(found), [d.code for d in diagnostics]


def asking(kind: LightType, amount: float = 10.0, emission: tuple[float, float, float] = (2, 2, 2)) -> Light:
    return Light("/a", kind, np.eye(4), emission, texture=FILE, photometric=Photometric(amount, WEIGHTS))


def test_a_rectangle_has_the_mean_of_its_image() -> None:
    image = np.array([[[1, 0, 0], [0, 3, 0]]])
    (light,), codes = read(asking(LightType.RECT, emission=(1, 0.5, 0)), image)
    luminance = 0.2126 * 1 / 2 + 0.7152 * 0.5 * 3 / 2
    assert light.emission == pytest.approx(np.array([1, 0.5, 0]) * 10 / (math.pi * luminance))
    assert (light.photometric, codes) == (None, [])


def test_without_its_image_it_gives_as_much() -> None:
    (light,), _ = read(asking(LightType.RECT), None)
    assert light.texture is None
    assert light.emission == pytest.approx((10 / math.pi,) * 3)
    assert read(asking(LightType.DOME), None)[0] == []


def test_nothing_comes_through_a_black_image() -> None:
    below = np.where(np.arange(8) < 4, 0.0, 1.0)[:, None, None] * np.ones((8, 16, 3))
    below[3:5] = 0  # nothing is read across the horizon
    for kind, image in ((LightType.RECT, np.zeros((2, 2, 3))), (LightType.DOME, below)):
        (light,), codes = read(asking(kind), image)
        assert (light.emission, light.photometric, codes) == ((0, 0, 0), None, ["light-dark"])


def test_too_bright() -> None:
    (light,), codes = read(asking(LightType.RECT, amount=1e30), np.ones((1, 1, 3)))
    assert (light.emission, codes) == ((1e15, 1e15, 1e15), ["out-of-range"])


def test_alike_lights_are_measured_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Wherever they stand and however they are turned; not where they are larger."""
    calls: list[Light] = []

    def counted(light: Light, wanted: Photometric, image: Floats | None) -> Doubles:
        calls.append(light)
        return amount_of_unit_emission(light, wanted, image)

    monkeypatch.setattr(texture_set, "amount_of_unit_emission", counted)
    turned, larger = np.eye(4), np.diag([2.0, 1.0, 1.0, 1.0])
    turned[:3, :3], turned[:3, 3] = [[0, 0, 1], [1, 0, 0], [0, 1, 0]], (4, 5, 6)
    lights = [replace(asking(LightType.RECT, amount), world_from_light=m)
              for amount, m in ((10.0, np.eye(4)), (20.0, turned), (10.0, larger))]  # fmt: skip
    textures = {FILE: [(0, Texture(np.ones((2, 2, 3), np.float32)))]}
    found = with_read_textures(lights, textures, Diagnostics())
    assert [light.emission[0] for light in found] == pytest.approx([10 / math.pi, 20 / math.pi, 5 / math.pi])
    assert len(calls) == 2


def test_others_stay_as_they_are() -> None:
    plain = Light("/a", LightType.RECT, np.eye(4), (2, 2, 2), texture=FILE)
    (light,), _ = read(plain, np.ones((1, 1, 3)))
    assert light is plain
