"""Data windows as whole pixels: centres decide, windows side by side share none."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from primray.description import Camera, Projection
from primray.description.scene import Frame, PixelWindow, Window, pixels_within, whole_frame
from primray.settings import RenderSettings
from primray.tessellation.footprint import projected

RESOLUTION = (10, 4)
WINDOWS: dict[Window, PixelWindow] = {
    (0, 0, 1, 1): PixelWindow(0, 0, 10, 4),
    (0.5, 0, 1, 1): PixelWindow(5, 0, 5, 4),
    (0, 0.5, 1, 1): PixelWindow(0, 0, 10, 2),  # y goes up in the window, down in pixels
    (0, 0, 1, 0.5): PixelWindow(0, 2, 10, 2),
    (0.04, 0.1, 0.96, 0.9): PixelWindow(0, 0, 10, 4),  # all centres are still within
    (0.06, 0.1, 0.94, 0.9): PixelWindow(1, 0, 8, 4),
    (0.2, 0.25, 0.3, 0.5): PixelWindow(2, 2, 1, 1),
    (-0.2, -0.5, 1.1, 1.25): PixelWindow(-2, -1, 13, 7),
    (2, 2, 3, 3): PixelWindow(20, -8, 10, 4),
    (-1, 0, -0.5, 1): PixelWindow(-10, 0, 5, 4),
    (0.01, 0, 0.04, 1): PixelWindow(0, 0, 0, 4),  # no centre
    (0, 0.51, 1, 0.6): PixelWindow(0, 2, 10, 0),
    # Edges on centres: the left and the upper one are within.
    (0.05, 0, 0.15, 1): PixelWindow(0, 0, 1, 4),
    (0, 0.125, 1, 0.375): PixelWindow(0, 2, 10, 1),
}


@pytest.mark.conforms("RenderSettingsBase.dataWindowNDC")
@pytest.mark.parametrize("window", WINDOWS, ids=str)
def test_pixels_within(window: Window) -> None:
    found = pixels_within(window, RESOLUTION)
    assert found == WINDOWS[window]
    # The same from the single precision that USD holds.
    left, bottom, right, top = (float(np.float32(side)) for side in window)
    assert pixels_within((left, bottom, right, top), RESOLUTION) == found


@pytest.mark.parametrize("resolution", [(10, 4), (1920, 1080), (8192, 4320), (2048, 1080)])
def test_every_centre_says_what_is_within(resolution: tuple[int, int]) -> None:
    width, height = resolution
    rng = np.random.default_rng(3)
    for _ in range(200):
        (left, right), (bottom, top) = np.sort(rng.uniform(-0.3, 1.3, 2)), np.sort(rng.uniform(-0.3, 1.3, 2))
        edges = np.array([left, right]) * width, np.array([bottom, top]) * height
        if any((np.abs(e - 0.5 - np.round(e - 0.5)) < 1e-2).any() for e in edges):
            continue  # on a centre, as far as single precision tells
        found = pixels_within((left, bottom, right, top), resolution)
        x = (np.arange(-width, 2 * width) + 0.5) / width
        y = 1 - (np.arange(-height, 2 * height) + 0.5) / height
        columns, rows = np.flatnonzero((x >= left) & (x < right)) - width, np.flatnonzero((y <= top) & (y > bottom)) - height
        assert (found.width, found.height) == (len(columns), len(rows))
        if found.width and found.height:
            assert [found.x, found.y] == [c[0] for c in (columns, rows)]


@pytest.mark.parametrize("count", [3, 7, 16, 50])
def test_windows_side_by_side_cover_each_pixel_once(count: int) -> None:
    edges = [float(np.float32(k / count)) for k in range(count + 1)]
    for size in (50, 999, 4096):
        across = [pixels_within((a, 0, b, 1), (size, 1)) for a, b in pairwise(edges)]
        assert [w.x for w in across] == [0, *np.cumsum([w.width for w in across])[:-1]]
        assert sum(w.width for w in across) == size
        down = [pixels_within((0, a, 1, b), (1, size)) for a, b in pairwise(edges)]
        assert sum(w.height for w in down) == size


def test_frames() -> None:
    assert whole_frame(8, 4).is_whole
    assert whole_frame(8, 4, 2.0).is_whole
    part = Frame((8, 4), PixelWindow(-1, 0, 10, 4))
    assert (part.is_whole, part.size) == (False, (10, 4))


def test_cages_are_diced_for_the_whole_frame_and_what_is_seen_beyond() -> None:
    camera = Camera("/eye", np.eye(4), Projection.PERSPECTIVE, (-1.0, 1.0, -0.5, 0.5), (0.1, 10.0))

    def window(x: int, y: int, width: int, height: int) -> Window:
        return projected(camera, Frame((20, 10), PixelWindow(x, y, width, height))).window

    whole = window(0, 0, 20, 10)
    assert whole == pytest.approx((-1.1, 1.1, -0.55, 0.55))
    assert window(3, 2, 5, 5) == whole
    assert window(-2, -3, 30, 18) == pytest.approx((-1.3, 1.9, -1.05, 0.85))


def test_what_is_asked_for_by_its_path_is_there_whatever_the_mask() -> None:
    settings = RenderSettings(mask=("/a",), camera="eye", render_settings="/s", product="/s/p")
    assert settings.composition.mask == ("/a", "/s", "/s/p")
    assert RenderSettings(render_settings="/s").composition.mask is None
