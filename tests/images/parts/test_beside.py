"""Outputs beside a picture made of parts: AOVs, Cryptomattes, labels and the denoised picture of one render, exactly."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from pxr import Usd
from tests.images.test_volumes import CAMERA, SKY
from tests.unit.usd.volumes.volume_text import grid, volume_text, write

import primray
from primray.checkpoints import aov_data
from primray.checkpoints.merge import merge
from primray.denoising.denoiser import has_denoiser
from primray.errors import CheckpointError, SettingsError
from primray.images import cryptomatte

FEATURES = Path(__file__).resolve().parents[3] / "scenes" / "features"
FIELD = str(FEATURES / "point-instancer" / "scene.usda")
GLASS = str(FEATURES / "glass" / "scene.usda")
VOLUMES = ("volume_opacity", "volume_depth", "volume_direct", "guide_albedo")
MATTES = ("crypto_object", "crypto_material", "crypto_asset")
ASKED = ("depth", "C<RD>[LO]", "albedo", "position", "prim", "samples", *MATTES, "C<R[GS]>.*")
HERE: dict[str, Any] = {"resolution": (48, 32), "progress": False, "seed": 3}

needs_package = pytest.mark.skipif(not has_denoiser(), reason="primray[denoise] is not installed")


def _part(file: Path, first: int, end: int, stage: Any = FIELD, **values: Any) -> Path:
    primray.render(stage, sample_range=(first, end), checkpointing=primray.Checkpointing(file), **{**HERE, **values})
    return file


def _are_alike(a: primray.Image, b: primray.Image) -> None:
    assert a.report["pixels_sha256"] == b.report["pixels_sha256"]
    assert list(a.aovs) == list(b.aovs)
    for name, aov in a.aovs.items():
        other = b.aovs[name]
        assert (aov.channels, aov.source, aov.stored, aov.samples) == (
            other.channels,
            other.source,
            other.stored,
            other.samples,
        )
        assert (dict(aov.ids), dict(aov.metadata)) == (dict(other.ids), dict(other.metadata)), name
        assert aov.values.tobytes() == other.values.tobytes(), name
        assert (aov.errors is None) == (other.errors is None)
        if aov.errors is not None and other.errors is not None:
            assert aov.errors.tobytes() == other.errors.tobytes(), name
    assert not [row for row in a.report["diagnostics"] if row["code"] == "aovs-not-merged"]


@pytest.mark.filterwarnings("ignore")
def test_volumes_in_parts_are_those_of_one_render(tmp_path: Path) -> None:
    write(tmp_path, grid(0.25), grid((0.1, 0.2, 0.3), name="emission", kind="vec3s"))
    stage = tmp_path / "smoke.usda"
    stage.write_text(f"#usda 1.0\n{SKY}{CAMERA}{volume_text({'density': '', 'emission': ''})}")
    asked: dict[str, Any] = {"stage": str(stage), "aovs": (*VOLUMES, *MATTES), "aov_errors": True}
    one = primray.render(asked["stage"], spp=12, **HERE, aovs=asked["aovs"], aov_errors=True)
    files = [_part(tmp_path / f"{a}.prc", a, b, **asked) for a, b in ((4, 8), (0, 4), (8, 12))]
    _are_alike(merge(files).image, one)
    _are_alike(primray.render(asked["stage"], spp=12, **HERE, aovs=asked["aovs"], aov_errors=True, threads=1), one)


def test_merged_ones_are_those_of_one_render(tmp_path: Path) -> None:
    asked: dict[str, Any] = {"aovs": ASKED, "aov_errors": True}
    one = primray.render(FIELD, spp=12, **HERE, **asked)
    cuts = ((4, 8), (0, 4), (8, 12))
    files = [_part(tmp_path / f"{a}.prc", a, b, **asked) for a, b in cuts]
    _are_alike(merge(files).image, one)
    # Of what was merged before, too.
    merge(files[:2]).save_checkpoint(tmp_path / "two.prc")
    merged = merge([files[2], tmp_path / "two.prc"]).image
    _are_alike(merged, one)
    # And in the file.
    a, b = (image.save(tmp_path / f"{n}.exr") for n, image in enumerate((merged, one)))
    again = primray.read_image(a)
    _are_alike(_with_report(again, one), _with_report(primray.read_image(b), one))


def _with_report(image: primray.Image, of: primray.Image) -> primray.Image:
    return primray.Image(image.pixels, of.report, aovs=image.aovs)


def test_masks_are_of_the_samples_that_are_there(tmp_path: Path) -> None:
    """Without the first part what others do not hold is told."""
    [late] = [_part(tmp_path / "late.prc", 4, 8, aovs=ASKED)]
    merged = merge([late]).image
    assert list(merged.aovs) == ["C<RD>[LO]", "samples", *MATTES, "C<R[GS]>.*"]
    alone = primray.render(FIELD, sample_range=(4, 8), aovs=MATTES, **HERE)
    for name in MATTES:
        assert merged.aovs[name].values.tobytes() == alone.aovs[name].values.tobytes()
    [told] = [row for row in merged.report["diagnostics"] if row["code"] == "aovs-not-merged"]
    assert told["message"].startswith("albedo, depth, position, prim are not")


def test_a_part_that_keeps_nonsense_is_damaged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = cryptomatte.covered_names

    def beyond(*arguments: Any) -> Any:
        counts, number, shares, names = real(*arguments)
        return counts, number + 1000, shares, names

    monkeypatch.setattr(aov_data, "covered_names", beyond)
    file = _part(tmp_path / "a.prc", 0, 4, aovs=MATTES)
    with pytest.raises(CheckpointError, match="damaged"):
        merge([file])


LABELLED = """#usda 1.0
def Sphere "ball" (prepend apiSchemas = ["SemanticsLabelsAPI:kind"]) {
    token[] semantics:labels:kind = ["ball"]
}
"""


def test_labels_have_their_boxes(tmp_path: Path) -> None:
    stage = Usd.Stage.CreateInMemory()
    assert stage.GetRootLayer().ImportFromString(LABELLED)
    one = primray.render(stage, spp=4, aovs=["labels:kind"], **HERE)
    files = [_part(tmp_path / f"{a}.prc", a, a + 2, stage, aovs=["labels:kind"]) for a in (0, 2)]
    merged = merge(files).image
    _are_alike(merged, one)
    assert merged.report["labels"] == one.report["labels"]
    assert merged.report["labels"]["boxes"]["labels:kind"]


@needs_package
def test_denoised_after_the_merge_is_denoised_at_once(tmp_path: Path) -> None:
    one = primray.render(GLASS, spp=8, denoise=True, **HERE)
    files = [_part(tmp_path / f"{a}.prc", a, a + 4, GLASS, denoise=True) for a in (0, 4)]
    merged = merge(files).image
    assert one.denoised is not None
    assert merged.denoised is not None
    assert merged.denoised.pixels.tobytes() == one.denoised.pixels.tobytes()
    assert merged.report["denoised"]["error"] == one.report["denoised"]["error"]
    assert not [row for row in merged.report["diagnostics"] if row["code"] == "aovs-not-merged"]


@needs_package
def test_processes_make_them_as_one_does() -> None:
    asked: dict[str, Any] = {"spp": 16, "aovs": ("crypto_object", "albedo", "C<T.>.*[LO]"), "denoise": True, **HERE}
    one, many = primray.render(GLASS, **asked), primray.render(GLASS, executor=primray.LocalProcesses(2), **asked)
    assert many.report["distribution"]["parts"] > 1
    _are_alike(many, one)
    assert one.denoised is not None
    assert many.denoised is not None
    assert many.denoised.pixels.tobytes() == one.denoised.pixels.tobytes()
    with pytest.raises(SettingsError, match="not at the denoised one's"):
        primray.render(GLASS, executor=primray.LocalProcesses(2), target_error=0.1, stop_at="denoised", **HERE)
