"""EXR files are read back as they were written, by the names of their channels, and others are refused in words."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.measured import save

from primray import Image
from primray.errors import SettingsError
from primray.images.reading import ERROR_CHANNELS, MeasuredImage, read_measured

RNG = np.random.default_rng(0)
PIXELS = RNG.random((5, 7, 3), dtype=np.float32)
STDERR = RNG.random((5, 7, 3), dtype=np.float32)
ALPHA = RNG.random((5, 7), dtype=np.float32)
HEADER = {"samples": 35 * 64, "samples_per_pixel": "64 64", "settings.seed": 3, "isa": "v4"}


def write(path: Path, **planes: np.ndarray) -> Path:
    return Image(np.stack(list(planes.values()), axis=2), channels=tuple(planes)).save(path)


def test_what_was_written_is_read(tmp_path: Path) -> None:
    stderr = STDERR.copy()
    stderr[2, 3] = np.inf
    image = read_measured(save(MeasuredImage(PIXELS, ALPHA, stderr, HEADER), tmp_path / "a.exr"))
    assert np.array_equal(image.pixels, PIXELS)
    assert image.alpha is not None
    assert np.array_equal(image.alpha, ALPHA)
    assert image.stderr is not None
    assert np.array_equal(image.stderr, stderr)
    assert image.resolution == (7, 5)
    assert image.samples == 64
    assert image.metadata["settings.seed"] == 3
    assert image.metadata["isa"] == "v4"
    assert image.name == str(tmp_path / "a.exr")


def test_channels_are_known_by_their_names(tmp_path: Path) -> None:
    planes = {"Z": ALPHA, "stderr.B": STDERR[..., 2], "B": PIXELS[..., 2], "G": PIXELS[..., 1], "R": PIXELS[..., 0]}
    planes |= {"stderr.R": STDERR[..., 0], "stderr.G": STDERR[..., 1]}
    image = read_measured(write(tmp_path / "a.exr", **planes))
    assert np.array_equal(image.pixels, PIXELS)
    assert image.stderr is not None
    assert np.array_equal(image.stderr, STDERR)
    assert image.alpha is None


@pytest.mark.parametrize(
    ("header", "samples", "span"),
    [
        ({"samples_per_pixel": "64 64"}, 64, (64, 64)),
        ({"samples_per_pixel": "16 64", "samples": 35 * 20}, 20, (16, 64)),
        ({"samples_per_pixel": "16 64"}, 40, (16, 64)),
        ({}, None, None),
        ({"samples_per_pixel": "many"}, None, None),
        ({"samples_per_pixel": "0 0"}, None, None),
        ({"samples_per_pixel": "nan nan"}, None, None),
    ],
)
def test_samples(header: dict[str, object], samples: float | None, span: tuple[float, float] | None) -> None:
    image = MeasuredImage(PIXELS, None, None, header)
    assert image.samples == samples
    assert image.sample_span == span


def test_pictures_without_error_are_read_as_exact(tmp_path: Path) -> None:
    assert read_measured(write(tmp_path / "a.exr", R=ALPHA, G=ALPHA, B=ALPHA)).stderr is None


def refusal(path: Path) -> SettingsError:
    with pytest.raises(SettingsError) as error:
        read_measured(path)
    assert error.value.where == str(path)
    return error.value


def test_what_cannot_be_read(tmp_path: Path) -> None:
    assert refusal(tmp_path / "none.exr").code == "image-missing"
    assert refusal(tmp_path).code == "image-missing"
    no_picture = tmp_path / "text.exr"
    no_picture.write_text("a text")
    assert refusal(no_picture).code == "image-unreadable"
    whole = save(MeasuredImage(RNG.random((200, 200, 3), dtype=np.float32), None, None), tmp_path / "a.exr").read_bytes()
    cut = tmp_path / "cut.exr"
    cut.write_bytes(whole[: len(whole) // 2])
    assert refusal(cut).code == "image-unreadable"


def test_channels_that_do_not_fit(tmp_path: Path) -> None:
    error = refusal(write(tmp_path / "a.exr", Y=ALPHA))
    assert error.code == "image-channels"
    assert "no channel R, G, B; it has Y" in error.message
    colors = {"R": ALPHA, "G": ALPHA, "B": ALPHA}
    assert "only stderr.R" in refusal(write(tmp_path / "b.exr", **colors, **{ERROR_CHANNELS[0]: ALPHA})).message
    for bad in (-1, np.nan):
        errors = dict.fromkeys(ERROR_CHANNELS, np.full_like(ALPHA, bad))
        assert "negative values or NaN" in refusal(write(tmp_path / "c.exr", **colors, **errors)).message
