"""Expressions that take the picture apart add up to it to the bit, on every stage of scenes/."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from primray import Image, render
from primray.settings import RenderSettings

SCENES = Path(__file__).resolve().parents[3] / "scenes"
STAGES = sorted(path for path in SCENES.rglob("*.usd*") if path.suffix in (".usda", ".usdc"))
BY_LOBE = ("C[LO]", "C<RD>[LO]", "C<RD>.+[LO]", "C<R[GS]>.*[LO]", "C<T.>.*[LO]", "CV.*[LO]")
BY_END = ("C.*L", "C.*O")
WHOLE = ("C.*",)


def rendered(stage: Path, width: int, spp: int) -> Image:
    aovs = (*BY_LOBE, *BY_END, *WHOLE)
    return render(stage, RenderSettings(resolution=(width, 0), spp=spp, seed=1, threads=2, aovs=aovs), progress=False)


def assert_parts_are_the_whole(image: Image) -> None:
    assert image.report["invalid_samples"] == 0
    picture = image.pixels[..., :3]
    for names in (BY_LOBE, BY_END, WHOLE):
        total = np.sum([image.aovs[name].values for name in names], axis=0, dtype=np.float64)
        assert np.array_equal(total.astype(np.float32), picture), names
    assert all((aov.values >= 0).all() for aov in image.aovs.values())


@pytest.mark.parametrize("stage", STAGES, ids=lambda path: path.relative_to(SCENES).as_posix())
def test_parts_are_the_whole(stage: Path) -> None:
    assert_parts_are_the_whole(rendered(stage, 16, 2))


@pytest.mark.long
@pytest.mark.parametrize("stage", STAGES, ids=lambda path: path.relative_to(SCENES).as_posix())
def test_parts_are_the_whole_of_more_samples(stage: Path) -> None:
    """Enough for pilots, and so for splits, guides and photons."""
    assert_parts_are_the_whole(rendered(stage, 48, 16))
