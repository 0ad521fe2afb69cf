"""Every file is read once whoever uses it, as far as it is used; what cannot be read is told where it is used."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from primray.description import PrimvarInput, SceneDescription, Surface, TextureFile, TextureInput, Wrap
from primray.diagnostics import Diagnostics
from primray.render import load_textures
from primray.textures import texture, texture_set

from ..conftest import make_description, make_dome
from .loading import load_texture_set

ST = PrimvarInput("st", (0.0, 0.0))


def write(path: Path, pixels: np.ndarray) -> str:
    oiio.ImageBuf(np.ascontiguousarray(pixels, np.float32)).write(str(path))
    return str(path)


def described(*inputs: tuple[TextureFile, str]) -> SceneDescription:
    """A surface for each."""
    surfaces = tuple(
        Surface(f"/m{i}", inputs=(("diffuse_color", TextureInput(file, channels, ST)),))
        for i, (file, channels) in enumerate(inputs)
    )
    return replace(make_description(), surfaces=surfaces)


def codes(diagnostics: Diagnostics) -> list[tuple[str, str]]:
    return [(d.code, d.prim_path) for d in diagnostics]


@pytest.fixture
def reads(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str | None, frozenset[str]]]:
    """Which files are read, and which of their channels."""
    seen: list[tuple[str | None, frozenset[str]]] = []

    def load(
        file: TextureFile, read: texture.ReadAsset | None, *, path: str, channels: frozenset[str], default_wrap: Wrap
    ) -> texture.Texture:
        seen.append((path, channels))
        return texture.load_texture(file, read, path=path, channels=channels, default_wrap=default_wrap)

    monkeypatch.setattr(texture_set, "load_texture", load)
    return seen


def test_a_file_is_read_once_for_all_its_uses(tmp_path: Path, reads: list[tuple[str | None, frozenset[str]]]) -> None:
    path = write(tmp_path / "a.exr", np.full((1, 1, 4), 0.5))
    auto, raw = TextureFile(path, "auto"), TextureFile(path, "raw")
    found = load_texture_set(described((auto, "rgb"), (auto, "r"), (raw, "a")), Diagnostics(), None)
    assert reads == [(path, frozenset("rgba"))]  # alpha is the same in every colour space
    assert found[auto] is found[raw]
    assert [(number, t.pixels.shape) for number, t in found[auto]] == [(0, (1, 1, 4))]


def test_only_channels_that_are_read(tmp_path: Path) -> None:
    path = write(tmp_path / "a.exr", np.full((1, 1, 4), 0.5))
    for channels, count in (("r", 1), ("g", 3), ("rgb", 3), ("a", 2)):
        file = TextureFile(path, "raw")
        [(_, found)] = load_texture_set(described((file, channels)), Diagnostics(), None)[file]
        assert found.pixels.shape[2] == count


def test_tiles_come_with_their_numbers_and_bad_ones_are_left_out(tmp_path: Path) -> None:
    tiles = tuple((n, write(tmp_path / f"t.{n}.exr", np.full((1, 1, 3), n))) for n in (1001, 1012))
    file = TextureFile("t.<UDIM>.exr", "raw", (*tiles, (1013, str(tmp_path / "gone.exr"))))
    diagnostics = Diagnostics()
    found = load_texture_set(described((file, "rgb")), diagnostics, None)[file]
    assert [(number, float(t.pixels[0, 0, 0])) for number, t in found] == [(1001, 1001), (1012, 1012)]
    assert codes(diagnostics) == [("texture-unreadable", "/m0")]


def test_what_cannot_be_read_is_told_and_left_to_its_fallback(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "damaged.png").write_bytes(b"\x89PNG\r\n\x1a\n junk")
    monkeypatch.setattr(texture, "MAX_TEXTURE_MB", 1)
    large = write(tmp_path / "large.exr", np.zeros((600, 600, 3)))
    files = [TextureFile(str(tmp_path / "damaged.png"), "auto"), TextureFile(large, "auto"), TextureFile(large, "nonsense")]
    diagnostics = Diagnostics()
    description, found = load_textures(described(*((f, "rgb") for f in files)), diagnostics, None)
    assert found == {}
    assert len(description.surfaces) == 3
    assert codes(diagnostics) == [("texture-unreadable", f"/m{i}") for i in range(3)]


def test_unknown_color_spaces_are_unreadable(tmp_path: Path) -> None:
    diagnostics = Diagnostics()
    file = TextureFile(write(tmp_path / "a.exr", np.ones((1, 1, 3))), "nonsense")
    assert load_texture_set(described((file, "rgb")), diagnostics, None) == {}
    assert codes(diagnostics) == [("texture-unreadable", "/m0")]


def test_negative_texels_are_bad_for_lights_only(tmp_path: Path) -> None:
    path = write(tmp_path / "a.exr", np.full((2, 4, 3), -1.0))
    file = TextureFile(path, "auto")
    diagnostics = Diagnostics()
    [(_, found)] = load_texture_set(described((file, "rgb")), diagnostics, None)[file]
    assert (found.pixels == -1).all()
    assert codes(diagnostics) == []
    lit = make_description(lights=(make_dome(path),))
    [(_, found)] = load_texture_set(lit, diagnostics, None)[file]
    assert (found.pixels == 0).all()
    assert [code for code, _ in codes(diagnostics)] == ["texture-bad-texels"]


def test_turned_files_are_told(tmp_path: Path) -> None:
    spec = oiio.ImageSpec(8, 8, 3, oiio.UINT8)
    spec.attribute("Orientation", 6)
    out = oiio.ImageOutput.create(str(tmp_path / "a.jpg"))
    assert out is not None
    assert out.open(str(tmp_path / "a.jpg"), spec)
    assert out.write_image(np.zeros((8, 8, 3), np.uint8))
    out.close()
    diagnostics = Diagnostics()
    load_texture_set(described((TextureFile(str(tmp_path / "a.jpg"), "auto"), "rgb")), diagnostics, None)
    assert codes(diagnostics) == [("texture-turned", "/m0")]
