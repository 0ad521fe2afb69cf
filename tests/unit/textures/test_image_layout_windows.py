"""An EXR's display window is the picture: overscan lies outside it, and what its data window leaves out is 0."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from primray.description import TextureFile
from primray.errors import LimitError
from primray.textures import texture
from primray.textures.image_layout import read_header
from primray.textures.texture import load_texture

from ..conftest import make_description, make_dome

Window = tuple[int, int, int, int]  # x, y, width, height


def write(path: Path, data: Window, display: Window, names: str = "R,G,B,A") -> str:
    """Each stored pixel is its column and row, then 2 and alpha 0.5, by the file's own coordinates."""
    x, y, width, height = data
    columns, rows = np.meshgrid(np.arange(x, x + width), np.arange(y, y + height))
    values = {"R": columns, "G": rows, "B": np.full_like(rows, 2), "A": np.full(rows.shape, 0.5), "Y": columns}
    pixels = np.stack([values[name] for name in names.split(",")], axis=2).astype(np.float32)
    spec = oiio.ImageSpec(width, height, pixels.shape[2], oiio.FLOAT)
    spec.channelnames = tuple(names.split(","))
    spec.x, spec.y = x, y
    spec.full_x, spec.full_y, spec.full_width, spec.full_height = display
    out = oiio.ImageOutput.create(str(path))
    assert out is not None
    assert out.open(str(path), spec), out.geterror()
    assert out.write_image(pixels), out.geterror()
    out.close()
    return str(path)


def load(path: str, channels: str = "rgba") -> np.ndarray:
    return load_texture(TextureFile(path, "raw"), channels=frozenset(channels)).pixels


WINDOWS: dict[str, tuple[Window, Window]] = {
    "overscan": ((-2, -1, 9, 7), (0, 0, 4, 5)),
    "inside": ((1, 2, 2, 1), (0, 0, 4, 5)),
    "across an edge": ((-3, 3, 5, 9), (0, 0, 4, 5)),
    "display away from 0": ((10, 20, 3, 3), (9, 21, 4, 4)),
    "negative display": ((-4, -4, 8, 8), (-2, -3, 3, 2)),
    "nothing in the picture": ((10, 10, 2, 2), (0, 0, 4, 5)),
    "the same": ((3, 4, 4, 5), (3, 4, 4, 5)),
}


@pytest.mark.parametrize("name", WINDOWS)
def test_the_display_window_is_the_picture(tmp_path: Path, name: str) -> None:
    data, display = WINDOWS[name]
    found = load(write(tmp_path / "a.exr", data, display))
    columns, rows = np.meshgrid(np.arange(display[2]) + display[0], np.arange(display[3]) + display[1])
    stored = (columns >= data[0]) & (columns < data[0] + data[2]) & (rows >= data[1]) & (rows < data[1] + data[3])
    expected = np.stack([columns, rows, np.full_like(rows, 2), np.full(rows.shape, 0.5)], axis=2) * stored[..., None]
    assert np.array_equal(found, expected)


@pytest.mark.parametrize(("names", "channels"), [("R,G,B", 4), ("Y", 2)])
def test_what_is_not_stored_has_no_alpha_in_files_without_one(tmp_path: Path, names: str, channels: int) -> None:
    """Their alpha is 1 where they have something, and where all of the picture is stored nothing needs saying."""
    path = write(tmp_path / "a.exr", (1, 0, 1, 1), (0, 0, 3, 1), names)
    assert load(path).shape == (1, 3, channels)
    assert load(path)[0, :, -1].tolist() == [0, 1, 0]
    assert load(path, "rgb").shape == (1, 3, len(names.split(",")))
    assert load(write(tmp_path / "b.exr", (-1, 0, 5, 1), (0, 0, 3, 1), names)).shape == (1, 3, len(names.split(",")))


def test_headers_have_the_size_of_the_picture(tmp_path: Path) -> None:
    header = read_header(write(tmp_path / "a.exr", (-2, -1, 9, 7), (0, 0, 4, 5)), lambda path: b"")
    assert header is not None
    assert (header.width, header.height) == (4, 5)


def test_a_huge_display_window_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(texture, "MAX_TEXTURE_MB", 1)
    with pytest.raises(LimitError, match="4000 x 3000"):
        load(write(tmp_path / "a.exr", (0, 0, 2, 2), (0, 0, 4000, 3000)))


def test_other_formats_are_as_they_are_stored(tmp_path: Path) -> None:
    """A TIFF's position is one on a page."""
    assert load(write(tmp_path / "a.tif", (3, 4, 5, 2), (0, 0, 20, 20))).shape == (2, 5, 4)


def test_a_dome_sees_the_display_window(tmp_path: Path) -> None:
    """Lights read their files as materials do."""
    from primray.diagnostics import Diagnostics
    from primray.render import load_textures

    path = write(tmp_path / "sky.exr", (-2, -1, 12, 6), (0, 0, 8, 4), "R,G,B")
    dome = make_dome(path, "raw")
    _, textures = load_textures(make_description(lights=(dome,)), Diagnostics(), None)
    [[(_, image)]] = textures.values()
    assert image.pixels[0, 0].tolist() == [0, 0, 2]
    assert image.shape == (4, 8, 3)
