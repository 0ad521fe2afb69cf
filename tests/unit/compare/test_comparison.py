"""Verdicts on images whose noise is known: Gaussian, log-normal and rare spikes, and pictures that are odd in some way."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest
from tests.measured import Sample, gaussian, log_normal, spikes, synthetic

import primray
from primray.compare.comparison import Comparison, Verdict, compare
from primray.compare.difference import Relation, difference
from primray.compare.difference_tests import blocks, log_p_of, threshold, tiles
from primray.errors import SettingsError
from primray.images.image import Image
from primray.images.reading import MeasuredImage

RAMP = np.ones((48, 64, 3)) * np.linspace(0.2, 1, 64)[None, :, None]
NOISE: dict[str, Sample] = {"gaussian": gaussian, "log-normal": log_normal, "spikes": spikes}


def pair(
    truth_a: np.ndarray, truth_b: np.ndarray, samples: int, noise: Sample = gaussian, seed: int = 1
) -> tuple[MeasuredImage, MeasuredImage]:
    rng = np.random.default_rng(seed)
    return synthetic(truth_a, noise, samples, rng, seed=1), synthetic(truth_b, noise, samples, rng, seed=2)


def found(comparison: Comparison) -> set[str]:
    findings = [comparison.finding, *(tile.finding for tile in comparison.tiles)]
    return {finding.kind for finding in findings if finding is not None}


# What the bound on false alarms rests on.


def test_the_six_values_of_a_pixel_are_strictly_sub_gaussian() -> None:
    u, v = np.meshgrid(np.linspace(0, 3, 31), np.linspace(0, 3, 31), indexing="ij")
    for d in np.linspace(0, 3, 16):
        variance = (d**2 + 2 * (u**2 + v**2)) / 3
        for s in np.linspace(0.05, 4, 40):
            moment = (np.cosh(s * d) + np.cosh(s * (u + v)) + np.cosh(s * (u - v))) / 3
            assert (moment <= np.exp(s**2 * variance / 2) * (1 + 1e-12)).all()


def test_delyons_inequality() -> None:
    x = np.linspace(-30, 30, 60001)
    assert (np.exp(x - x**2 / 6) <= 1 + x + x**2 / 3 + 1e-12).all()


def test_threshold_and_probability_agree() -> None:
    x = threshold(0.01, 7)
    assert 7 * np.exp(log_p_of(np.array(x), np.array(1.0))) == pytest.approx(0.01)
    assert log_p_of(np.zeros(2), np.zeros(2)).tolist() == [0, 0]


# False alarms.


@pytest.mark.parametrize("samples", [(16, 16), (8, 128)], ids=["as many", "unequal"])
@pytest.mark.parametrize("noise", NOISE)
def test_no_more_false_alarms_than_asked_for(noise: str, samples: tuple[int, int]) -> None:
    """Of 20 pairs at a rate of 0.02 more than 4 come once in 2000 such tests; the bound makes them rarer still."""
    rng = np.random.default_rng(5)
    truth = RAMP[:24, :32]
    alarms = 0
    for _ in range(20):
        a, b = (synthetic(truth, NOISE[noise], n, rng, seed=k) for k, n in enumerate(samples))
        alarms += compare(a, b, alpha=0.02, tolerance=0, tile=16).verdict is Verdict.CHANGED
    assert alarms <= 4


def test_all_tests_together_have_the_rate_asked_for() -> None:
    """Some 3,000 of them for each pair; more than 8 alarms in 20 at a rate of 0.1 come once in 20,000 times."""
    alarms = [compare(*pair(RAMP, RAMP, 16, seed=k), alpha=0.1, tolerance=0).verdict for k in range(20)]
    assert alarms.count(Verdict.CHANGED) <= 8


def test_rounding_to_floats_is_noise_too() -> None:
    """Means that two replicates agree on to the last bits of a double are rounded at random all the same."""
    rng = np.random.default_rng(2)
    near = np.array([0.1, np.nextafter(np.float32(0.1), np.float32(1))], "f4")

    def image(seed: int) -> MeasuredImage:
        pixels = near[rng.integers(0, 2, (96, 96, 3))]
        return MeasuredImage(pixels, None, np.zeros_like(pixels), {"samples_per_pixel": "4 4", "settings.seed": seed})

    for k in range(5):
        assert compare(image(2 * k), image(2 * k + 1), tolerance=0, alpha=0.05).verdict is Verdict.UNCHANGED


def spiky(rng: np.random.Generator, samples: int, rate: float, height: float, size: int) -> MeasuredImage:
    """Gray 0.5 with little noise, and in a sample now and then a bright path."""

    def mean() -> np.ndarray:
        hits = rng.binomial(samples // 2, rate, (size, size)) / (samples // 2) - rate
        return 0.5 + 0.05 * rng.standard_normal((size, size)) / np.sqrt(samples / 2) + height * hits

    a, b = (np.repeat(mean()[..., None], 3, axis=2) for _ in range(2))
    header = {"samples_per_pixel": f"{samples} {samples}", "settings.seed": samples}
    return MeasuredImage(((a + b) / 2).astype("f4"), None, (np.abs(a - b) / 2).astype("f4"), header)


@pytest.mark.parametrize(
    ("samples", "rate", "height", "size"),
    [
        # Found by 16 samples in no pixel of a tile, and by 4096: the fine image knows how noisy the coarse one is.
        ((16, 4096), 1e-5, 1e4, 32),
        ((4096, 16), 1e-5, 1e4, 32),
        # In many pixels of the coarse image: weights that knew a pixel's own noise would leave them out on one side.
        ((8, 1024), 3e-3, 10, 128),
    ],
)
def test_rare_bright_paths_are_no_change(samples: tuple[int, int], rate: float, height: float, size: int) -> None:
    rng = np.random.default_rng(3)
    for _ in range(20 if size < 100 else 4):
        a, b = (spiky(rng, n, rate, height, size) for n in samples)
        assert compare(a, b, alpha=0.01, tolerance=0).verdict is not Verdict.CHANGED


# Changes.


def brighter(truth: np.ndarray) -> np.ndarray:
    return truth * 1.02


def darker_patch(truth: np.ndarray) -> np.ndarray:
    out = truth.copy()
    out[19:27, 41:49] *= 0.9
    return out


def moved(truth: np.ndarray) -> np.ndarray:
    return np.roll(truth, 1, axis=1)


def repainted(truth: np.ndarray) -> np.ndarray:
    """Stripes of two pixels and no change of the mean."""
    return truth * (1 + 0.1 * np.where(np.arange(64) // 2 % 2, 1, -1)[None, :, None])


def without_a_speck(truth: np.ndarray) -> np.ndarray:
    out = truth.copy()
    out[20:23, 40:43] = 0
    return out


@pytest.mark.parametrize(
    ("change", "kind"),
    [
        (brighter, "brightness"),
        (darker_patch, "shift"),
        (moved, "moved-x"),
        (repainted, "texture-fine"),
        (without_a_speck, "spot"),
    ],
    ids=lambda value: getattr(value, "__name__", value),
)
def test_changes(change: Any, kind: str) -> None:
    truth = RAMP if change is not moved else RAMP * (1 + 0.1 * np.sin(np.arange(64) * 0.4))[None, :, None]
    many = compare(*pair(truth, change(truth), 1024))
    assert many.verdict is Verdict.CHANGED
    assert kind in found(many)
    few = compare(*pair(truth, change(truth), 4))
    assert few.verdict is Verdict.UNDECIDED
    assert few.needs is not None
    assert few.needs.factor is not None
    assert few.needs.factor > 1


def test_where_and_how_large() -> None:
    comparison = compare(*pair(RAMP, darker_patch(RAMP), 1024))
    changed = [tile for tile in comparison.tiles if tile.verdict is Verdict.CHANGED]
    assert [tile.box for tile in changed] == [(32, 0, 64, 32)]
    finding = changed[0].finding
    assert finding is not None
    assert finding.signed == pytest.approx(-0.1, rel=0.5)
    whole = compare(*pair(RAMP, brighter(RAMP), 1024))
    assert whole.relative_error is not None
    assert whole.relative == pytest.approx(0.0187, abs=4 * whole.relative_error)  # 2 % of the mean over the root mean square


def test_a_motion_is_in_pixels() -> None:
    waves = np.ones((48, 64, 3)) * (1 + 0.3 * np.sin(np.arange(48) * 2 * np.pi / 16))[:, None, None]
    finding = compare(*pair(waves, np.roll(waves, -1, axis=0), 4096)).finding
    assert finding is not None
    assert finding.kind == "moved-y"
    assert finding.signed == pytest.approx(-1, abs=0.1)


def test_one_channel_alone() -> None:
    comparison = compare(*pair(RAMP, RAMP * [1, 1, 1.03], 1024))
    assert comparison.verdict is Verdict.CHANGED
    assert comparison.finding is not None
    assert comparison.finding.channel == "B"


def test_a_change_below_the_tolerance_is_none() -> None:
    images = pair(RAMP, RAMP * 1.01, 4096)
    tolerant = compare(*images, tolerance=0.03)
    assert tolerant.verdict is Verdict.UNCHANGED
    assert tolerant.finding is not None
    assert compare(*images, tolerance=0).verdict is Verdict.CHANGED
    assert compare(*images, tolerance=0.005).verdict is Verdict.CHANGED


def test_the_samples_asked_for_decide() -> None:
    """And half as many do not."""
    first = compare(*pair(RAMP, RAMP, 64), tolerance=0.02)
    assert first.needs is not None
    assert first.needs.a is not None
    assert first.needs.a == first.needs.b
    needed = 2 * round((64 + first.needs.a) / 2)
    assert compare(*pair(RAMP, RAMP, needed, seed=2), tolerance=0.02).verdict is Verdict.UNCHANGED
    assert compare(*pair(RAMP, RAMP, 2 * (needed // 4), seed=3), tolerance=0.02).verdict is Verdict.UNDECIDED


def test_the_samples_that_one_image_alone_needs() -> None:
    rng = np.random.default_rng(4)
    fine = synthetic(RAMP, gaussian, 8192, rng, seed=1)
    first = compare(fine, synthetic(RAMP, gaussian, 64, rng, seed=2), tolerance=0.02)
    assert first.verdict is Verdict.UNDECIDED
    assert first.needs is not None
    assert first.needs.a_alone is None
    assert first.needs.b_alone is not None
    needed = 2 * round((64 + first.needs.b_alone) / 2)
    assert compare(fine, synthetic(RAMP, gaussian, needed, rng, seed=2), tolerance=0.02).verdict is Verdict.UNCHANGED


# Images that are related, incomplete or odd.


def test_the_same_bits_are_unchanged_whatever_the_noise() -> None:
    image, _ = pair(RAMP, RAMP, 4)
    for tolerance in (0.0, 1e-9, 0.01):
        comparison = compare(image, image, tolerance=tolerance)
        assert comparison.verdict is Verdict.UNCHANGED
        assert comparison.identical
        unsaid = replace(image, metadata={})
        assert compare(unsaid, unsaid, tolerance=tolerance).verdict is Verdict.UNCHANGED


def test_repeated_random_numbers_show_a_small_change() -> None:
    """The noise is shared: a patch that is brighter by 5 % is found at 4 samples, where the rest is the same bit for bit."""
    image, _ = pair(RAMP, RAMP, 4)
    factor = np.ones_like(RAMP)
    factor[8:16, 40:48] = 1.05
    other = replace(image, pixels=(image.pixels * factor).astype("f4"))
    comparison = compare(image, other)
    assert comparison.of.relation is Relation.REPEATED
    assert comparison.verdict is Verdict.CHANGED
    assert [tile.verdict for tile in comparison.tiles].count(Verdict.CHANGED) == 1
    assert comparison.count(Verdict.UNDECIDED) == 0


def test_rounding_of_repeated_random_numbers_is_no_change() -> None:
    image, _ = pair(RAMP, RAMP, 4)
    rng = np.random.default_rng(0)
    other = replace(image, pixels=image.pixels * (1 + rng.choice([-1e-7, 0, 1e-7], image.pixels.shape)).astype("f4"))
    assert compare(image, other).verdict is Verdict.UNCHANGED


def test_the_same_seed_with_independent_noise_is_not_taken_as_repeated() -> None:
    a, b = pair(RAMP, RAMP, 16)
    b = replace(b, metadata=a.metadata)
    assert difference(a, b).relation is Relation.EXCHANGEABLE


def test_an_exact_reference() -> None:
    exact = MeasuredImage(RAMP.astype("f4"), None, None)
    rendered, _ = pair(RAMP, RAMP, 4096)
    comparison = compare(exact, rendered, tolerance=0.02)
    assert comparison.verdict is Verdict.UNCHANGED
    assert comparison.notes == ("A has no error channels: it is assumed exact",)
    assert compare(replace(exact, pixels=exact.pixels * np.float32(1.03)), rendered).verdict is Verdict.CHANGED


def test_pixels_without_an_estimate_leave_their_tile_undecided() -> None:
    a, b = pair(RAMP, RAMP, 8192)
    assert b.stderr is not None
    stderr = b.stderr.copy()
    stderr[:32, :32] = np.inf
    pixels = b.pixels.copy()
    pixels[:32, :32] = 0
    comparison = compare(a, replace(b, stderr=stderr, pixels=pixels), tolerance=0.05)
    assert comparison.unjudged_pixels == 32 * 32
    assert [tile.verdict.value for tile in comparison.tiles] == ["undecided", "unchanged", "unchanged", "unchanged"]
    assert comparison.needs is not None
    assert comparison.needs.factor is None


def test_a_pixel_that_is_finite_in_one_image_only_is_a_change() -> None:
    a, b = pair(RAMP, RAMP, 4)
    pixels = b.pixels.copy()
    pixels[40, 3] = np.nan
    comparison = compare(a, replace(b, pixels=pixels))
    assert comparison.verdict is Verdict.CHANGED
    assert found(comparison) == {"not-finite"}
    both = compare(replace(a, pixels=pixels), replace(b, pixels=pixels))
    assert both.verdict is Verdict.UNDECIDED
    assert both.unjudged_pixels == 1


def test_alpha_alone() -> None:
    a, b = pair(RAMP, RAMP, 8192)
    alpha = np.ones((48, 64), "f4")
    hole = alpha.copy()
    hole[10:20, 10:20] = 0
    comparison = compare(replace(a, alpha=alpha), replace(b, alpha=hole), tolerance=0.05)
    assert comparison.verdict is Verdict.CHANGED
    assert {tile.finding.channel for tile in comparison.tiles if tile.finding} == {"A"}
    assert compare(replace(a, alpha=alpha), replace(b, alpha=alpha), tolerance=0.05).verdict is Verdict.UNCHANGED


def test_black_is_unchanged() -> None:
    black = MeasuredImage(np.zeros((32, 32, 3), "f4"), None, np.zeros((32, 32, 3), "f4"), {"samples_per_pixel": "4 4"})
    assert compare(black, black).verdict is Verdict.UNCHANGED
    lit = replace(black, pixels=np.full((32, 32, 3), 0.1, "f4"))
    assert compare(black, lit).verdict is Verdict.CHANGED


@pytest.mark.parametrize("shape", [(1, 1), (1, 3000), (3000, 1), (33, 7)])
def test_odd_shapes(shape: tuple[int, int]) -> None:
    truth = np.ones((*shape, 3))
    a, b = pair(truth, truth, 16)
    assert compare(a, b).verdict is Verdict.UNDECIDED
    a, b = pair(truth, truth * 2, 4096)
    assert compare(a, b).verdict is (Verdict.CHANGED if truth.size > 3 else Verdict.UNDECIDED)


@pytest.mark.parametrize(
    ("length", "size"), [(1, 32), (33, 32), (48, 32), (64, 32), (1080, 32), (100, 16), (101, 24), (50, 17)]
)
def test_tiles_cover_the_picture_without_slivers(length: int, size: int) -> None:
    grid = tiles((length, 5), size)
    heights = [grid.box(y, 0)[3] - grid.box(y, 0)[1] for y in range(len(grid.rows))]
    assert sum(heights) == length
    assert max(heights) <= size
    assert min(heights) >= min(length, size / 4)
    inner = [16, 8, 4] if size == 32 else [8, 4] if size % 8 == 0 else []
    assert all((grid.rows % block == 0).all() for block in inner)
    assert blocks((10, 10), 4).sum(np.ones((10, 10))).tolist() == [[16, 16, 8], [16, 16, 8], [8, 8, 4]]


@pytest.mark.parametrize(
    ("changes", "code"),
    [({"alpha": 0.0}, "alpha"), ({"alpha": 1.0}, "alpha"), ({"alpha": float("nan")}, "alpha"), ({"tile": 4}, "tile")]
    + [({"tolerance": bad}, "tolerance") for bad in (-0.1, float("nan"), float("inf"))],
)
def test_impossible_criteria(changes: dict[str, Any], code: str) -> None:
    with pytest.raises(SettingsError) as error:
        compare(*pair(RAMP, RAMP, 4), **changes)
    assert error.value.code == code


def test_images_that_cannot_be_compared() -> None:
    a, b = pair(RAMP, RAMP, 4)
    with pytest.raises(SettingsError, match="64 x 48 and 63 x 48"):
        compare(a, replace(b, pixels=b.pixels[:, 1:], stderr=None))


def test_pictures_of_two_kinds_are_named_as_what_they_are(tmp_path: Path) -> None:
    """A view is no scene-linear picture, whichever comes first; halves and floats are one kind."""
    pixels = np.random.default_rng(0).random((16, 24, 4), np.float32)
    pixels[..., 3] = 1
    image = Image(pixels, errors=np.full((16, 24, 3), 1e-3, np.float32))
    files = {name: image.save(tmp_path / f"a.{name}") for name in ("exr", "png", "jpg", "tif", "hdr")}
    for name in ("png", "jpg", "tif"):
        for pair in ((files["exr"], files[name]), (files[name], files["exr"])):
            with pytest.raises(SettingsError, match="display values") as refused:
                primray.compare(*pair)
            assert refused.value.code == "image-display"
            assert refused.value.where == str(files[name])
    half = image.save(tmp_path / "half.exr", half=["rgba"])
    found = primray.compare(files["exr"], half)
    assert found.verdict is Verdict.UNCHANGED
    assert any("stored as float" in note for note in found.notes)
    opaque = oiio.ImageBuf(str(files["exr"]))
    assert oiio.ImageBufAlgo.channels(opaque, ("R", "G", "B")).write(str(tmp_path / "rgb.exr"))
    assert any("alpha is not compared" in note for note in primray.compare(files["exr"], tmp_path / "rgb.exr").notes)
