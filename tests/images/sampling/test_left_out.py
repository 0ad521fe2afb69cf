"""A clamp of indirect light, and caustics that are off: closed forms, what is taken away, partitions, bits, refusals."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pxr import Usd
from tests.images.aovs.seen import stage_of

import primray
from primray import Image
from primray.checkpoints.checkpointing import Checkpointing
from primray.checkpoints.merge import merge
from primray.cli import run
from primray.color.color_space import REC709, luminance_weights
from primray.core import passes
from primray.errors import CheckpointError, SettingsError
from primray.images.reading import read_measured

SCENES = Path(__file__).resolve().parents[3] / "scenes"
CLOSED = SCENES / "analytic" / "closed_sphere.usda"
LUMINANCE = np.array(luminance_weights(REC709))
# Unlike each other in how light reaches a sample: photons and splits, media and walks, fibres, a lens that takes light, a dome.
FEATURES = ("glass", "interiors", "hair", "lens-flaws", "dome-texture", "opacity-texture", "light-rect", "motion-lights")
PARTS = ("C[LO]", "C<RD>[LO]", "C<RD>.+[LO]", "C<R[GS]>.*[LO]", "C<T.>.*[LO]", "CV.*[LO]")


def rendered(stage: Any, **values: Any) -> Image:
    return primray.render(stage, **{"progress": False, "resolution": (24, 0), "spp": 16, "threads": 2, "seed": 5, **values})


def feature(name: str) -> Path:
    return SCENES / "features" / name / "scene.usda"


def luminance(image: Image) -> float:
    return float((image.pixels[..., :3].astype(np.float64) @ LUMINANCE).mean())


def assert_adds_up(image: Image, *names: str) -> None:
    total = sum(image.aovs[name].values.astype(np.float64) for name in names)
    assert np.array_equal(np.asarray(total).astype(np.float32), image.pixels[..., :3])


MIRRORS = """
def Material "mirror"
{
    token outputs:surface.connect = </mirror/s.outputs:surface>
    def Shader "s"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (1, 1, 1)
        float inputs:metallic = 1
        float inputs:roughness = ROUGHNESS
        token outputs:surface
    }
}
def Mesh "floor"
{
    point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
    color3f[] primvars:displayColor = [(0.5, 0.5, 0.5)]
}
def Mesh "wall" ( prepend apiSchemas = ["MaterialBindingAPI"] )
{
    point3f[] points = [(-4, -100, -1), (-4, 100, -1), (-4, 100, 60), (-4, -100, 60)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
    uniform bool doubleSided = 1
    rel material:binding = </mirror>
}
"""
# From the side where the wall is seen by the floor: straight over it, and once over the mirror, as much light each.
SUN = """
def DistantLight "sun"
{
    float inputs:intensity = 20
    float inputs:angle = 12
    float3 xformOp:rotateXYZ = (0, 40, 0)
    uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]
}
"""


def mirrored(roughness: str = "0") -> Usd.Stage:
    return stage_of(MIRRORS.replace("ROUGHNESS", roughness), place=(0, 0, 2), light=SUN)


def test_a_clamp_leaves_light_of_one_scattering_alone_and_bounds_the_rest() -> None:
    """In the sphere direct light gives radiance 0.5, all that comes after it 0.5 more: each sample has some, and keeps V."""
    image = rendered(CLOSED, resolution=(32, 32), clamp_indirect=0.001, spp=64)
    found = image.report["left_out"]["clamp_indirect"]
    assert np.allclose(image.pixels[..., :3], 0.501, atol=1e-5)
    assert abs(found["luminance"] - 0.499) < 4 * found["luminance_stderr"]
    assert 0 < found["luminance_stderr"] < 0.01
    assert abs(found["share"] - 0.499) < 4 * found["share_stderr"]
    assert found["pixels"] == 32 * 32


def test_a_clamp_is_of_the_values_of_the_picture() -> None:
    """A camera's exposure scales radiance and not the clamp."""
    stage = Usd.Stage.Open(str(CLOSED))
    stage.SetEditTarget(stage.GetSessionLayer())
    from pxr import UsdGeom

    UsdGeom.Camera.Get(stage, "/camera").CreateExposureAttr(3.0)
    image = rendered(stage, resolution=(16, 16), clamp_indirect=0.001, spp=16)
    assert np.allclose(image.pixels[..., :3], 8 * 0.5 + 0.001, atol=1e-4)


@pytest.mark.parametrize("name", FEATURES)
def test_the_clamped_picture_and_what_was_taken_are_the_whole(name: str) -> None:
    """The same paths are followed with a clamp and without, so this holds pixel by pixel and not on average alone."""
    plain, clamped = rendered(feature(name)), rendered(feature(name), clamp_indirect=0.02)
    assert plain.report["rays"] == clamped.report["rays"]
    assert "left_out" not in plain.report
    found = clamped.report["left_out"]["clamp_indirect"]
    whole = luminance(clamped) + found["luminance"]
    assert whole == pytest.approx(luminance(plain), rel=1e-5)
    assert (clamped.pixels <= plain.pixels + 1e-5 * (1 + plain.pixels)).all()
    assert found["share"] == pytest.approx(found["luminance"] / whole, rel=1e-6)
    if found["luminance"] > 0:
        x, y, most = found["most"][0]
        lost = (plain.pixels[..., :3] - clamped.pixels[..., :3]).astype(np.float64) @ LUMINANCE
        assert most == pytest.approx(lost[y, x], rel=1e-3, abs=1e-5)
        assert most == pytest.approx(lost.max(), rel=1e-3, abs=1e-5)


def test_features_lose_light_to_a_clamp() -> None:
    assert rendered(feature("glass"), clamp_indirect=0.02).report["left_out"]["clamp_indirect"]["luminance"] > 0.001


def test_a_clamp_that_nothing_reaches_changes_nothing() -> None:
    plain, clamped = rendered(feature("glass")), rendered(feature("glass"), clamp_indirect=1e9)
    assert np.allclose(plain.pixels, clamped.pixels, rtol=1e-5, atol=1e-7)
    assert clamped.report["left_out"]["clamp_indirect"]["luminance"] == 0


@pytest.mark.parametrize("bias", [{"clamp_indirect": 0.02}, {"caustics": False}, {"clamp_indirect": 0.02, "caustics": False}])
@pytest.mark.parametrize("name", ["glass", "interiors", "lens-flaws"])
def test_parts_by_light_paths_are_the_picture(name: str, bias: dict[str, Any]) -> None:
    image = rendered(feature(name), aovs=(*PARTS, "C.*L", "C.*O", "C.*"), **bias)
    assert_adds_up(image, *PARTS)
    assert_adds_up(image, "C.*L", "C.*O")
    assert_adds_up(image, "C.*")
    assert all((aov.values >= 0).all() for aov in image.aovs.values())


def test_a_mirror_brings_no_second_sun_without_caustics() -> None:
    """The wall sends as much light to the floor as the sun does straight: half of all goes, none of the other half does."""
    whole, without = (rendered(mirrored(), spp=64, caustics=on) for on in (True, False))
    found = without.report["left_out"]["caustics"]
    direct = rendered(mirrored(), spp=64, max_depth=1)
    assert luminance(without) == pytest.approx(luminance(direct), rel=0.02)
    assert abs(found["luminance"] - luminance(direct)) < 4 * found["luminance_stderr"] + 0.02 * luminance(direct)
    assert luminance(whole) == pytest.approx(2 * luminance(direct), rel=0.05)
    assert 0.4 < found["share"] < 0.6
    assert not any(row["name"].startswith("caustics") for row in without.report["features"])


def test_what_caustics_would_have_brought_is_what_a_light_path_expression_says() -> None:
    path = "C.*[DV][GS]+[LO]"
    whole, without = (rendered(mirrored("0.3"), spp=256, caustics=on, aovs=(path,)) for on in (True, False))
    found = without.report["left_out"]["caustics"]
    assert not without.aovs[path].values.any()
    said = float((whole.aovs[path].values.astype(np.float64) @ LUMINANCE).mean())
    assert abs(found["luminance"] - said) < 5 * found["luminance_stderr"]
    assert luminance(without) + said == pytest.approx(luminance(whole), rel=0.03)


def test_a_mirror_that_is_seen_is_no_caustic() -> None:
    """Nor is a diffuse wall in it: only light that a diffuse surface gets over a specular one."""
    text = MIRRORS.replace("ROUGHNESS", "0")
    stage = stage_of(text, place=(0, 0, 2), turn=(0, 90, 0), light='def DomeLight "sky"\n{\n}\n')
    image = rendered(stage, caustics=False, aovs=("C<RS>B",))
    assert image.aovs["C<RS>B"].values.max() > 0.9


BIASED: dict[str, Any] = {"clamp_indirect": 0.05, "caustics": False}


@pytest.mark.parametrize("lanes", [1, 4, 8, 16])
def test_bits_are_the_same_for_any_lanes_and_threads(lanes: int, monkeypatch: pytest.MonkeyPatch) -> None:
    if not primray.core.module().has_lanes(lanes):
        pytest.skip(f"skipped: no {lanes} lanes in this build")
    expected = rendered(feature("glass"), aovs=("C<RD>.*",), **BIASED)
    monkeypatch.setattr(passes, "lanes", lambda: lanes)
    found = rendered(feature("glass"), aovs=("C<RD>.*",), threads=1 + lanes % 3, **BIASED)
    assert found.report["pixels_sha256"] == expected.report["pixels_sha256"]
    assert np.array_equal(found.aovs["C<RD>.*"].values, expected.aovs["C<RD>.*"].values)
    assert found.report["left_out"] == expected.report["left_out"]


def test_resumed_and_merged_renders_are_the_whole_one(tmp_path: Path) -> None:
    stage = str(feature("glass"))
    whole = rendered(stage, spp=32, adaptive=False, **BIASED)
    rendered(stage, spp=16, checkpointing=Checkpointing(tmp_path / "half.prc"), **BIASED)
    further = Checkpointing(tmp_path / "all.prc", resume=tmp_path / "half.prc")
    resumed = rendered(stage, spp=32, checkpointing=further, **BIASED)
    for first in (0, 16):
        part = Checkpointing(tmp_path / f"{first}.prc")
        rendered(stage, spp=None, sample_range=(first, first + 16), checkpointing=part, **BIASED)
    merged = merge([tmp_path / "0.prc", tmp_path / "16.prc"]).image
    in_parts = primray.render(stage, resolution=(24, 0), spp=32, seed=5, executor=primray.LocalProcesses(2), **BIASED)
    for image in (resumed, merged, in_parts):
        assert image.report["pixels_sha256"] == whole.report["pixels_sha256"]
        assert image.report["left_out"] == whole.report["left_out"]


@pytest.mark.parametrize("other", [{}, {"clamp_indirect": 0.06, "caustics": False}, {"clamp_indirect": 0.05}])
def test_what_leaves_out_other_light_is_neither_resumed_nor_merged(other: dict[str, Any], tmp_path: Path) -> None:
    stage = str(feature("light-rect"))
    for name, first, values in (("a", 0, BIASED), ("b", 16, other)):
        part = Checkpointing(tmp_path / f"{name}.prc")
        rendered(stage, spp=None, sample_range=(first, first + 16), checkpointing=part, **values)
    with pytest.raises(CheckpointError, match=r"clamp indirect|caustics"):
        merge([tmp_path / "a.prc", tmp_path / "b.prc"])
    further = Checkpointing(tmp_path / "c.prc", resume=tmp_path / "a.prc")
    with pytest.raises(CheckpointError, match=r"clamp indirect|caustics"):
        rendered(stage, spp=None, sample_range=(0, 32), checkpointing=further, **other)


def test_comparing_asks_for_the_same_bias(tmp_path: Path) -> None:
    plain, clamped, bare = (rendered(feature("light-rect"), **v) for v in ({}, {"clamp_indirect": 0.5}, {"caustics": False}))
    files = {name: str(image.save(tmp_path / f"{name}.exr")) for name, image in (("a", plain), ("b", clamped), ("c", bare))}
    for one, other, what in (("a", "b", "clamp indirect is off in .* and 0.5"), ("a", "c", "caustics is on in .* and off")):
        with pytest.raises(SettingsError, match=what) as error:
            primray.compare(files[one], files[other])
        assert error.value.code == "different-bias"
    assert primray.compare(files["a"], files["b"], allow_bias=True, tolerance=1.0) is not None
    assert primray.compare(files["b"], clamped).identical
    header = read_measured(files["b"]).metadata
    assert header["settings.clamp_indirect"] == 0.5
    assert "left_out.clamp_indirect.luminance" in header
    assert not any("clamp" in name or "left_out" in name or "caustics" in name for name in read_measured(files["a"]).metadata)


def test_commands_state_the_bias(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, report = str(tmp_path / "a.exr"), tmp_path / "a.json"
    line = ["render", str(feature("glass")), "-o", out, "-r", "24", "24", "--spp", "16"]
    assert run([*line, "--clamp-indirect", "0.02", "--caustics", "off", "--report", str(report)]) == 0
    said = capsys.readouterr().out
    assert "bias: the clamp of indirect light at 0.02 removed mean luminance" in said
    assert "bias: leaving out caustics removed mean luminance" in said
    found = json.loads(report.read_text())
    assert set(found["left_out"]) == {"clamp_indirect", "caustics"}
    assert (found["settings"]["clamp_indirect"], found["settings"]["caustics"]) == (0.02, False)
    plain = str(tmp_path / "b.exr")
    assert run(["render", *line[1:2], "-o", plain, *line[4:]]) == 0
    assert "bias:" not in capsys.readouterr().out
    assert run(["compare", out, plain]) == 2
    assert "different-bias" in capsys.readouterr().err
    assert run(["compare", out, plain, "--allow-bias", "--tolerance", "10"]) in (0, 1, 6)


@pytest.mark.parametrize("value", [0, -1, float("inf"), float("nan")])
def test_a_clamp_is_above_nothing(value: float) -> None:
    with pytest.raises(SettingsError, match="clamp") as error:
        primray.RenderSettings(clamp_indirect=value)
    assert error.value.where == "clamp_indirect"
