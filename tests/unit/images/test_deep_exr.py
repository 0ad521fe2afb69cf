"""Deep EXR files are read by OpenImageIO, and by the OpenEXR package where it is installed, as they were written."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest

from primray.errors import PrimrayError
from primray.images.deep import CHANNELS, DeepPicture
from primray.images.deep_exr import write_deep


def picture(width: int = 7, height: int = 5, most: int = 6) -> DeepPicture:
    rng = np.random.default_rng(1)
    counts = rng.integers(0, most + 1, (height, width)).astype(np.uint32)
    counts[2] = 0  # a row without samples
    values = rng.random((int(counts.sum()), 6)).astype(np.float32)
    values[:, 0] = np.round(values[:, 0], 1)  # compresses
    return DeepPicture(counts, values, 0.01, most)


def spec_of(deep: DeepPicture) -> Any:
    height, width = deep.counts.shape
    spec = oiio.ImageSpec(width, height, 4, oiio.FLOAT)
    spec.x, spec.y, spec.full_x, spec.full_y, spec.full_width, spec.full_height = 3, 4, 0, 0, 20, 10
    spec.attribute("PixelAspectRatio", 2.0)
    spec.attribute("chromaticities", oiio.TypeDesc("float[8]"), (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329))
    spec.attribute("worldtocamera", oiio.TypeMatrix, tuple(float(i) for i in range(16)))
    for name, value in (("primray:text", "grün"), ("primray:number", 3), ("primray:share", 0.25)):
        spec.attribute(name, value)
    spec.attribute("artist", "Ada")
    spec.attribute("size", oiio.TypeDesc("int[2]"), (5, 6))
    return spec


@pytest.fixture
def written(tmp_path: Path) -> tuple[Path, DeepPicture]:
    deep, path = picture(), tmp_path / "a.exr"
    write_deep(str(path), deep, spec_of(deep))
    return path, deep


def opened(path: Path) -> Any:
    file = oiio.ImageInput.open(str(path))
    assert file is not None
    return file


def test_openimageio_reads_it(written: tuple[Path, DeepPicture]) -> None:
    path, deep = written
    file = opened(path)
    spec = file.spec()
    assert spec.deep
    assert (spec.x, spec.y, spec.width, spec.height, spec.full_width, spec.full_height) == (3, 4, 7, 5, 20, 10)
    assert spec.getattribute("PixelAspectRatio") == 2.0
    assert spec.getattribute("compression") == "zips"
    assert spec.getattribute("primray:text") == "grün"
    assert spec.getattribute("primray:number") == 3
    assert spec.getattribute("primray:share") == 0.25
    assert spec.getattribute("Artist") == "Ada"
    assert spec.getattribute("worldtocamera") == tuple(float(i) for i in range(16))
    np.testing.assert_allclose(
        spec.getattribute("chromaticities"), (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329), rtol=1e-6
    )
    data = file.read_native_deep_image()
    names = [data.channelname(k) for k in range(data.channels)]
    assert sorted(names) == sorted(CHANNELS)
    at = 0
    for pixel, count in enumerate(deep.counts.ravel()):
        assert data.samples(pixel) == count
        for number in range(count):
            found = [data.deep_value(pixel, names.index(name), number) for name in CHANNELS]
            assert found == deep.values[at].tolist()
            at += 1


def test_the_openexr_package_reads_it(written: tuple[Path, DeepPicture]) -> None:
    openexr = pytest.importorskip("OpenEXR")
    path, deep = written
    with openexr.File(str(path), separate_channels=True) as file:
        header = file.header()
        assert header["type"] == openexr.deepscanline
        assert header["maxSamplesPerPixel"] == deep.counts.max()
        channels = file.channels()
        first = np.concatenate([[0], np.cumsum(deep.counts.ravel(), dtype=np.int64)])
        for column, name in enumerate(CHANNELS):
            pixels = channels[name].pixels.ravel()
            for pixel, found in enumerate(pixels):
                own = deep.values[first[pixel] : first[pixel + 1], column]
                np.testing.assert_array_equal(np.zeros(0) if found is None else found, own)


def test_a_picture_without_samples(tmp_path: Path) -> None:
    deep = DeepPicture(np.zeros((2, 3), np.uint32), np.zeros((0, 6), np.float32), 0.01, 32)
    path = tmp_path / "a.exr"
    write_deep(str(path), deep, spec_of(deep))
    data = opened(path).read_native_deep_image()
    assert [data.samples(pixel) for pixel in range(6)] == [0] * 6


def test_a_file_that_cannot_be_written_is_an_error(tmp_path: Path) -> None:
    deep = picture()
    with pytest.raises(PrimrayError, match="cannot be written"):
        write_deep(str(tmp_path / "none" / "a.exr"), deep, spec_of(deep))
