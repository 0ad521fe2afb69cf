"""Textures that show nothing but the black around them are told, and no others."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.textured import FILE, UNIT_ST, glowing, look_at_plate, pixels_of, plate, texture

from primray.description import Wrap
from primray.diagnostics import Diagnostics
from primray.textures.coverage import note_textures_outside
from primray.textures.texture import Texture

DOWN = np.subtract(UNIT_ST, (0, 1))  # t from -1 to 0, as some tools write it
UP = (1, 0, 0, 0, 1, 1.0)


def images(own: Wrap, tile: int) -> Any:
    return {FILE: [(tile, Texture(np.ones((4, 4, 3), np.float32), wrap_s=own, wrap_t=own))]}


@pytest.mark.parametrize(
    ("st", "more", "own", "tile", "told"),
    [
        (DOWN, {}, Wrap.BLACK, 0, True),
        (np.subtract(UNIT_ST, (-1, 0)), {}, Wrap.BLACK, 0, True),
        (DOWN, {"wrap": Wrap.BLACK}, Wrap.REPEAT, 0, True),
        (DOWN, {}, Wrap.REPEAT, 0, False),
        (DOWN, {"wrap": Wrap.REPEAT}, Wrap.BLACK, 0, False),
        (DOWN, {"st_transform": UP}, Wrap.BLACK, 0, False),
        (UNIT_ST, {}, Wrap.BLACK, 0, False),
        (np.zeros((4, 2)), {}, Wrap.BLACK, 0, False),  # the image's corner
        (np.add(DOWN, (0, 0.5)), {}, Wrap.BLACK, 0, False),  # some of it
        (np.add(UNIT_ST, (1, 0)), {}, Wrap.BLACK, 1002, False),
    ],
)
def test_what_is_all_black_is_told(st: Any, more: dict[str, Any], own: Wrap, tile: int, told: bool) -> None:
    d = look_at_plate(glowing(texture(**{"wrap": Wrap.USE_METADATA, **more})), images(own, tile), (4, 4), plate(st))
    notes = Diagnostics()
    note_textures_outside(d.description, d.textures, notes)
    assert [note.code for note in notes] == ["texture-outside"] * told
    remedy = "wrap" not in more  # else it was asked for
    assert all(("--default-wrap repeat" in note.message) == remedy for note in notes)
    assert (pixels_of(d).max() == 0) == told
