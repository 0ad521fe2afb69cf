"""Pictures without standard errors: judged by their values, and said to be."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest

import primray
from primray import Verdict
from primray.compare.comparison import DISPLAY_NOTE, LINEAR_NOTE
from primray.compare.comparison_report import as_json, lines
from primray.compare.flip import has_flip
from primray.errors import SettingsError

GREY = np.full((48, 64, 3), 0.5, np.float32)


def changed_patch(by: float) -> np.ndarray:
    """Half of the first tile is brighter."""
    picture = GREY.copy()
    picture[:16, :32] += np.float32(by)
    return picture


def write_png(path: Path, picture: np.ndarray) -> Path:
    height, width, channels = picture.shape
    output = oiio.ImageBuf(oiio.ImageSpec(width, height, channels, "uint8"))
    output.set_pixels(oiio.ROI(0, width, 0, height, 0, 1, 0, channels), np.ascontiguousarray(picture, np.float32))
    assert output.write(str(path)), output.geterror()
    return path


def test_arrays_are_judged_by_the_root_mean_square_of_their_relative_difference() -> None:
    found = primray.compare(GREY, changed_patch(0.1), tolerance=0.01)
    assert (found.verdict, found.by, found.relative_error) == (Verdict.CHANGED, "values", None)
    assert [tile.verdict.value for tile in found.tiles] == ["changed", "unchanged", "unchanged", "unchanged"]
    finding = found.tiles[0].finding
    assert finding is not None
    # The mean of both is 0.525 in this tile on average; the floor adds a tenth of the picture's level.
    scale = np.sqrt((0.55**2 + 0.5**2) / 2 + 0.05**2)
    assert finding.relative == pytest.approx(0.1 / np.sqrt(2) / scale, rel=1e-5)
    assert found.notes == (LINEAR_NOTE,)
    assert primray.compare(GREY, changed_patch(0.001), tolerance=0.01).verdict is Verdict.UNCHANGED
    assert primray.compare(GREY, changed_patch(1e-5), tolerance=0).verdict is Verdict.CHANGED
    assert primray.compare(GREY, GREY).identical


def test_what_is_no_number_on_one_side_is_a_change_and_on_both_is_counted() -> None:
    hole = GREY.copy()
    hole[40, 3] = np.nan
    found = primray.compare(GREY, hole, tolerance=0.9)
    assert found.verdict is Verdict.CHANGED
    assert {tile.finding.kind for tile in found.tiles if tile.finding} == {"not-finite"}
    assert "NaN" in "\n".join(lines(found, "a", "b"))
    assert as_json(found)["image"]["kind"] == "not-finite"
    both = primray.compare(hole, hole)
    assert (both.verdict, both.unjudged_pixels) == (Verdict.UNCHANGED, 1)


def test_png_pairs_are_display_referred_and_said_to_be(tmp_path: Path) -> None:
    a, b = write_png(tmp_path / "a.png", GREY), write_png(tmp_path / "b.png", changed_patch(0.1))
    found = primray.compare(a, b)
    assert isinstance(found, primray.Comparison)
    assert (found.verdict, found.by) == (Verdict.CHANGED, "display")
    finding = found.tiles[0].finding
    assert finding is not None
    step = (round(0.6 * 255) - round(0.5 * 255)) / 255
    assert finding.relative == pytest.approx(step / np.sqrt(2), abs=1e-6)  # a share of white, not of the grey
    text = "\n".join(lines(found, "a.png", "b.png"))
    assert "of white" in text
    assert "standard error " not in text
    assert "false alarm" not in text
    assert DISPLAY_NOTE in text
    facts = as_json(found)
    assert (facts["by"], facts["relative_mean_difference_error"], facts["image"]["p"]) == ("display", None, None)
    if has_flip():
        assert found.flip is not None
        assert "FLIP: mean 0.0" in text
        assert "(LDR, " in text
        assert facts["flip"]["exposures"] is None
        errors = found.flip.errors
        assert errors[:12, :28].min() > 0.01  # FLIP sees it where it is,
        assert errors[40:, 40:].max() < 0.01  # and not elsewhere
    again = primray.compare(a, a)
    assert isinstance(again, primray.Comparison)
    assert (again.identical, again.notes) == (True, ())


def test_arrays_of_whole_numbers_are_display_values(tmp_path: Path) -> None:
    a, b = (np.rint(picture * 255).astype(np.uint8) for picture in (GREY, changed_patch(0.1)))
    np.save(tmp_path / "a.npy", a)
    found = primray.compare(tmp_path / "a.npy", b)
    assert found.by == "display"
    assert found.verdict is Verdict.CHANGED
    with pytest.raises(SettingsError, match="display values"):
        primray.compare(a, GREY)


@pytest.mark.parametrize("shape", [(48, 64), (48, 64, 1), (48, 64, 4)])
def test_shapes_of_arrays(shape: tuple[int, ...]) -> None:
    one = np.full(shape, 0.5, np.float64)
    other = one.copy()
    other[20:30, 20:30] *= 2
    assert primray.compare(one, other).verdict is Verdict.CHANGED
    assert primray.compare(one, one.copy()).identical


def test_an_array_beside_a_picture_with_errors_is_taken_as_exact() -> None:
    rng = np.random.default_rng(0)
    noisy = GREY + 0.01 * rng.standard_normal(GREY.shape, np.float32)
    image = primray.Image(
        np.concatenate([noisy, np.ones((48, 64, 1), np.float32)], axis=2),
        errors=np.full(GREY.shape, 0.01, np.float32),
        metadata={"samples_per_pixel": "16 16"},
    )
    found = primray.compare(GREY, image, tolerance=0.2)
    assert (found.by, found.verdict) == ("errors", Verdict.UNCHANGED)
    assert "A has no error channels: it is assumed exact" in found.notes


@pytest.mark.parametrize(
    "array", [np.zeros(5), np.zeros((4, 4, 2)), np.zeros((0, 4)), np.zeros((4, 4), np.int32), np.zeros((4, 4), complex)]
)
def test_arrays_that_are_no_pictures(array: np.ndarray) -> None:
    with pytest.raises(SettingsError) as error:
        primray.compare(array, array)
    assert error.value.code == "image-array"


def test_files_that_are_no_arrays(tmp_path: Path) -> None:
    (tmp_path / "text.npy").write_text("no array")
    np.save(tmp_path / "objects.npy", np.array([{}]), allow_pickle=True)
    for name, code in (("text.npy", "image-unreadable"), ("objects.npy", "image-unreadable"), ("none.npy", "image-missing")):
        with pytest.raises(SettingsError) as error:
            primray.compare(tmp_path / name, GREY)
        assert (error.value.code, error.value.where) == (code, str(tmp_path / name))


def test_what_is_no_picture() -> None:
    nothing: Any = 3
    with pytest.raises(SettingsError, match="not int"):
        primray.compare(nothing, GREY)
