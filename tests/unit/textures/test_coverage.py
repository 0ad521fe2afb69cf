"""Tiles of a UDIM set that are in use and not there are told by their numbers, and no others; the fallback is seen there."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest
from tests.textured import UNIT_ST, glowing, look_at_plate, pixels_of, plate, primvar, texture

from primray.description import Interpolation, SubdivisionMesh, TextureFile
from primray.description.shading import NodeOutput, Pattern, PatternNode, plain_images
from primray.diagnostics import Diagnostics
from primray.render import load_textures
from primray.textures.coverage import note_missing_tiles, overlapped_tiles
from primray.textures.texture import Texture

SET = TextureFile("t.<UDIM>.exr", "raw", ((1001, "t.1001.exr"), (1012, "t.1012.exr")))
IMAGES: Any = {SET: [(number, Texture(np.ones((4, 4, 3), np.float32))) for number, _ in SET.tiles]}
HALF = np.multiply(UNIT_ST, (2, 1))  # tiles 1001 and 1002


def told(mesh: Any, **more: Any) -> list[str]:
    d = look_at_plate(glowing(texture(file=SET, fallback=(0.25, 0.5, 0.75, 1), **more)), IMAGES, (4, 4), plate())
    notes = Diagnostics()
    note_missing_tiles(replace(d.description, shapes=(mesh,)), notes)
    assert {note.code for note in notes} <= {"tile-missing"}
    return [note.message for note in notes]


@pytest.mark.parametrize(
    ("st", "numbers"),
    [
        (UNIT_ST, ""),
        (np.add(UNIT_ST, (1, 1)), ""),
        (np.add(UNIT_ST, (1, 0)), "1002"),
        (np.add(UNIT_ST, (0, 9)), "1091"),
        (HALF, "1002"),
        (np.multiply(UNIT_ST, (2, 2)), "1002, 1011"),
        (np.multiply(UNIT_ST, 1 + 1e-6), ""),  # rounding
        (np.subtract(UNIT_ST, 1e-6), ""),
        ([(0.1, 0.1), (0.1, 0.1), (0.1, 0.1), (0.1, 0.1)], ""),
    ],
)
def test_tiles_in_use_are_told_by_number(st: Any, numbers: str) -> None:
    expected = f"t.<UDIM>.exr lacks tiles that texture coordinates use: {numbers}. The fallback is visible there."
    assert told(plate(st)) == ([expected] if numbers else [])


def test_the_fallback_is_seen_in_their_place() -> None:
    """Neither scaled nor biased, as in place of a file that cannot be read (TextureInput)."""
    reads = texture(file=SET, fallback=(0.25, 0.5, 0.75, 1), scale=(0.5, 0.5, 0.5, 1))
    found = pixels_of(look_at_plate(glowing(reads), IMAGES, (4, 2), plate(HALF)))
    assert found[0, :, 1].tolist() == [0.5, 0.5, 0.5, 0.5]
    assert found[0, :, 0].tolist() == [0.5, 0.5, 0.25, 0.25]


def test_many_are_counted() -> None:
    [message] = told(plate(np.multiply(UNIT_ST, (10, 2))))
    assert "1002, 1003, 1004, 1005, 1006, 1007, 1008, 1009 and 10 more" in message


@pytest.mark.parametrize("by", [(-0.5, 0), (0, -3), (9.5, 0), (0, 9.5)])
def test_what_lies_beyond_all_tiles_is_told(by: tuple[float, float]) -> None:
    [message] = told(plate(np.add(UNIT_ST, by)))
    assert "outside of all tiles (1001 to 1100)" in message


def test_coordinates_count_as_the_texture_is_laid_on() -> None:
    assert told(plate(UNIT_ST), st_transform=(1, 0, 1, 0, 1, 0)) != []
    assert told(plate(np.add(UNIT_ST, (1, 0))), st_transform=(1, 0, -1, 0, 1, 0)) == []


def test_only_faces_of_the_surface_count() -> None:
    two = replace(plate(), surface=np.array([0, 1], np.int32))  # the lower right half, then the upper left one
    corners = np.concatenate([np.zeros((3, 2)), np.full((3, 2), 5.5)])
    split = replace(two, primvars=(primvar("st", corners, Interpolation.CORNER),))
    assert told(split) == []
    [message] = told(replace(split, surface=np.array([1, 0], np.int32)))
    assert "1056" in message


@pytest.mark.parametrize("kind", [Interpolation.POINT, Interpolation.VARYING, Interpolation.CORNER, Interpolation.FACE])
def test_cages(kind: Interpolation) -> None:
    """A triangle in tile 1001 and a quad in 1003."""
    a, b = (0.2, 0.3), (2.2, 0.3)
    points = np.zeros((7, 3), np.float32)
    values = [a, b] if kind is Interpolation.FACE else [a] * 3 + [b] * 4
    cage = SubdivisionMesh(
        "/c", "catmullClark", points, np.array([3, 4], np.int32), np.arange(7, dtype=np.int32), 0,
        primvars=(primvar("st", values, kind),),
    )  # fmt: skip
    [message] = told(cage)
    assert "use: 1003." in message
    assert told(replace(cage, surface=np.array([0, -1], np.int32))) == []


def test_a_shape_without_coordinates_is_in_the_fallbacks_tile() -> None:
    bare = replace(plate(), primvars=())
    assert told(bare) == []
    only = replace(SET, tiles=SET.tiles[1:])
    notes = Diagnostics()
    d = look_at_plate(glowing(texture(file=only)), {only: IMAGES[SET][1:]}, (4, 4), bare)
    note_missing_tiles(d.description, notes)
    assert ["1001" in note.message for note in notes] == [True]


def test_a_large_triangle_meets_only_what_it_covers() -> None:
    """By counting points inside it; its box holds all of the tiles."""
    triangle = np.array([[[0.05, 0.05], [9.9, 0.3], [4.3, 9.7]]])
    rng = np.random.default_rng(3)
    w = rng.dirichlet((1, 1, 1), 400_000)
    inside = np.floor(w @ triangle[0]).astype(int)
    assert overlapped_tiles(triangle, set()) == set((1001 + inside[:, 0] + 10 * inside[:, 1]).tolist())


def test_it_is_told_where_textures_are_loaded(tmp_path: Path) -> None:
    """Once a surface, whatever reads the set; a tile that cannot be read is told as that, not as missing."""
    tiles = tuple((number, str(tmp_path / f"t.{number}.exr")) for number in (1001, 1003))
    oiio.ImageBuf(np.ones((2, 2, 3), np.float32)).write(tiles[0][1])
    Path(tiles[1][1]).write_bytes(b"none")
    file = TextureFile(str(tmp_path / "t.<UDIM>.exr"), "raw", tiles)
    surface = replace(glowing(texture(file=file)), path="/m")
    surface = replace(surface, inputs=(*surface.inputs, ("roughness", texture("g", file=file))))
    d = look_at_plate(surface, {}, (4, 4), plate(np.multiply(UNIT_ST, (3, 1))))
    notes = Diagnostics()
    load_textures(d.description, notes, None)
    assert [(n.code, n.prim_path) for n in notes] == [("texture-unreadable", "/m"), ("tile-missing", "/m")]
    assert "use: 1002." in list(notes)[1].message


def image_of(*nodes: PatternNode, coordinates: Any) -> Pattern:
    image = PatternNode("image", "color3", "ND_image_color3", (("file", SET), ("texcoord", coordinates)))
    return Pattern((*nodes, image))


ST = PatternNode("geompropvalue", "vector2", "ND_geompropvalue_vector2", (("geomprop", "uv"), ("default", (0.0, 0.0))))


@pytest.mark.parametrize(
    ("pattern", "primvar"),
    [
        (image_of(coordinates="UV0"), "st"),
        (image_of(ST, coordinates=NodeOutput(0, "out")), "uv"),
        (image_of(replace(ST, category="texcoord", inputs=(("index", (1.0,)),)), coordinates=NodeOutput(0, "out")), "st1"),
        (image_of(replace(ST, category="noise2d", inputs=()), coordinates=NodeOutput(0, "out")), None),
        (image_of(coordinates=(0.5, 0.5)), None),
        (None, None),
    ],
)
def test_images_of_patterns_are_laid_on_by_primvars(pattern: Pattern | None, primvar: str | None) -> None:
    assert [reads.st.name for reads in plain_images(pattern)] == [primvar] * (primvar is not None)


def test_tiles_that_a_pattern_reads_are_told() -> None:
    d = look_at_plate(glowing(texture(file=SET)), IMAGES, (4, 4), plate())
    [surface] = d.description.surfaces
    notes = Diagnostics()
    pattern = image_of(coordinates="UV0")
    surfaces = (replace(surface, inputs=(), pattern=pattern),)
    note_missing_tiles(replace(d.description, shapes=(plate(HALF),), surfaces=surfaces), notes)
    assert [note.code for note in notes] == ["tile-missing"]
    assert "1002" in next(iter(notes)).message
