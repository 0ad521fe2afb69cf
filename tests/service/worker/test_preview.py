"""Previews: what is written comes back, and nothing else is taken for one."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from primray_service.worker.preview import (
    HEADER,
    MOST_BYTES,
    MOST_PIXELS,
    BadPreview,
    Preview,
    box_side,
    decode_preview,
    preview_of,
    read_preview,
    write_preview,
)


def picture(width: int, height: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    return random.random((height, width, 4), np.float32), random.random((height, width, 3), np.float32)


def encoded(folder: Path, preview: Preview) -> bytes:
    name, size = write_preview(preview, folder)
    data = (folder / name).read_bytes()
    assert len(data) == size
    return data


def test_what_is_written_comes_back(tmp_path: Path) -> None:
    pixels, errors = picture(17, 9)
    errors[3, 4] = np.inf
    pixels[0, 0, 0] = 1e9
    encoded(tmp_path, preview_of(pixels, errors, 5, 12345))
    found = read_preview(tmp_path / "preview.raw")
    assert (found.resolution, found.picture, found.passes, found.samples) == ((17, 9), (17, 9), 5, 12345)
    assert found.rgb[0, 0, 0] == 65504
    pixels[0, 0, 0] = 65504
    np.testing.assert_array_equal(found.rgb, pixels[..., :3].astype(np.float16))
    np.testing.assert_array_equal(found.alpha, pixels[..., 3].astype(np.float16))
    np.testing.assert_array_equal(found.stderr, errors.astype(np.float16))
    assert [path.name for path in tmp_path.iterdir()] == ["preview.raw"]


@pytest.mark.parametrize(
    "size", [(1024, 1024), (1025, 1024), (1920, 1080), (3840, 2160), (32768, 2048), (131072, 3), (1, 131072)]
)
def test_boxes_are_the_smallest_that_make_a_megapixel(size: tuple[int, int]) -> None:
    width, height = size
    side = box_side(width, height)
    assert -(-width // side) * -(-height // side) <= MOST_PIXELS
    assert side == 1 or -(-width // (side - 1)) * -(-height // (side - 1)) > MOST_PIXELS


def test_large_pictures_are_averaged(tmp_path: Path) -> None:
    width, height = 1500, 1401  # boxes of 2 x 2, the last row's of 2 x 1
    pixels, errors = picture(width, height)
    found = preview_of(pixels, errors, 1, 2)
    assert found.resolution == (750, 701)
    box, deviations = pixels[10:12, 20:22].astype(np.float64), errors[10:12, 20:22].astype(np.float64)
    np.testing.assert_allclose(found.rgb[5, 10], box[..., :3].mean((0, 1)), rtol=1e-3)
    np.testing.assert_allclose(found.alpha[5, 10], box[..., 3].mean(), rtol=1e-3)
    # Of four independent pixels.
    np.testing.assert_allclose(found.stderr[5, 10], np.sqrt((deviations**2).sum((0, 1))) / 4, rtol=1e-3)
    np.testing.assert_allclose(found.rgb[-1, 0], pixels[-1, :2, :3].mean(0), rtol=1e-3)
    np.testing.assert_allclose(found.stderr[-1, 0], np.sqrt((errors[-1, :2] ** 2).sum(0)) / 2, rtol=1e-3)
    assert decode_preview(encoded(tmp_path, found)).picture == (width, height)


def test_every_shorter_or_longer_file_is_refused(tmp_path: Path) -> None:
    data = encoded(tmp_path, preview_of(*picture(3, 2), 1, 12))
    for length in range(len(data)):
        with pytest.raises(BadPreview):
            decode_preview(data[:length])
    with pytest.raises(BadPreview):
        decode_preview(data + b"\0")


def test_no_other_byte_of_the_head_is_taken(tmp_path: Path) -> None:
    """But for the counts of passes and samples, which may be anything, and sizes that are those of as many pixels."""
    data = encoded(tmp_path, preview_of(*picture(3, 2), 1, 12))
    begin = HEADER.size + 1 + sum(1 + len(name) for name in ("R", "G", "B", "stderr.R", "stderr.G", "stderr.B", "A"))
    for position in [*range(HEADER.size - 12), *range(HEADER.size, begin)]:
        for flip in (1, 0x80, 0xFF):
            changed = bytearray(data)
            changed[position] ^= flip
            with pytest.raises(BadPreview):
                decode_preview(bytes(changed))


@pytest.mark.parametrize(("channel", "value"), [(0, np.nan), (2, np.inf), (3, np.nan), (6, -np.inf)])
def test_values_that_no_picture_has(tmp_path: Path, channel: int, value: float) -> None:
    made = preview_of(*picture(3, 2), 1, 12)
    made.channels[channel, 1, 1] = value
    with pytest.raises(BadPreview):
        decode_preview(encoded(tmp_path, made))


def test_claimed_sizes_cost_nothing() -> None:
    head = HEADER.pack(b"primrayP", 1, 1024, 1024, 2**17, 2**17, 1, 1)
    with pytest.raises(BadPreview):
        decode_preview(head + b"\0" * 100)


def test_what_is_no_plain_file(tmp_path: Path) -> None:
    encoded(tmp_path, preview_of(*picture(3, 2), 1, 12))
    (tmp_path / "link").symlink_to(tmp_path / "preview.raw")
    with pytest.raises(OSError, match="symbolic"):
        read_preview(tmp_path / "link")
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(BadPreview):
        read_preview(tmp_path / "pipe")
    with open(tmp_path / "large", "wb") as file:
        file.truncate(MOST_BYTES * 100)
    with pytest.raises(BadPreview, match="large"):
        read_preview(tmp_path / "large")
