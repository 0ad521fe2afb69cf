"""What a stage asks of a render is what the render does: the same pixels, files and report as by the flags of the same name."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import primray
from primray.checkpoints import checkpointing
from primray.checkpoints.checkpoint import load
from primray.denoising.denoiser import has_denoiser
from primray.images.image import Image
from primray.render.in_parts import with_ends_of_stage
from primray.settings import RenderSettings

STAGE = """#usda 1.0
(
    upAxis = "Y"
)
def Sphere "ball"
{
    double3 xformOp:translate.timeSamples = { 0: (0, 0, 0), 1: (1, 0.5, 0), 2: (2, 0, 0) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Sphere "other"
{
    double3 xformOp:translate = (0, -2, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def DomeLight "sky"
{
}
def Camera "cam"
{
    double3 xformOp:translate = (0, 0, 9)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def RenderSettings "settings"
{
    int2 resolution = (12, 8)
    rel camera = </cam>
    rel products = </product>
%s
}
def RenderProduct "product"
{
    token productName = "made.png"
%s
}
"""


def stage_with(folder: Path, body: str, product: str = "") -> str:
    path = folder / "stage.usda"
    path.write_text(STAGE % (body, product))
    return str(path)


def rendered(folder: Path, body: str = "", **settings: Any) -> Image:
    return primray.render(stage_with(folder, body), progress=False, **settings)


@pytest.mark.parametrize(
    ("line", "flag"),
    [
        ("int primray:samples = 6", {"spp": 6}),
        ("int arnold:AA_samples = 3", {"spp": 9}),
        ("int primray:samples = 4\nint primray:maxDepth = 1", {"spp": 4, "max_depth": 1}),
        ('int primray:samples = 4\ntoken primray:filter = "gaussian"', {"spp": 4, "filter": "gaussian"}),
        ('int primray:samples = 4\ntoken primray:filter = "gaussian"\nfloat primray:filterWidth = 5', None),
        ("float primray:targetError = 0.05", {"target_error": 0.05}),
        ('float primray:targetError = 0.2\ntoken primray:errorMetric = "rmse"', {"target_error": 0.2, "error_metric": "rmse"}),
    ],
)
def test_the_picture_is_that_of_the_flags(line: str, flag: dict[str, Any] | None, tmp_path: Path) -> None:
    flag = flag or {"spp": 4, "filter": "gaussian", "filter_width": 5}
    asked, flagged = rendered(tmp_path, line).report, rendered(tmp_path, **flag).report
    assert asked["pixels_sha256"] == flagged["pixels_sha256"]
    assert asked["settings"] == flagged["settings"]
    assert [row["attribute"] for row in asked["stage_settings"]] == [words.split()[1] for words in line.splitlines()]
    assert flagged["stage_settings"] == []
    # Another flag takes its place.
    other: dict[str, Any] = {"spp": 2, "max_depth": 3, "filter": "box"}
    assert rendered(tmp_path, line, **other).report["pixels_sha256"] == rendered(tmp_path, **other).report["pixels_sha256"]


def test_a_time_limit_of_the_stage_ends_the_render(tmp_path: Path) -> None:
    report = rendered(tmp_path, "float primray:timeLimit = 0.05").report
    assert (report["stop"]["reason"], report["settings"]["time_limit_s"]) == ("time-limit", pytest.approx(0.05))


@pytest.mark.parametrize("there", [True, False])
def test_denoising_is_done_where_it_can_be(there: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if there and not has_denoiser():
        pytest.skip("no denoiser is installed")
    if not there:
        monkeypatch.setattr("primray.denoising.denoiser.has_denoiser", lambda: False)
    body = "int primray:samples = 4\nbool primray:denoise = 1"
    with pytest.warns(primray.RenderWarning) if not there else pytest.MonkeyPatch.context():
        image = rendered(tmp_path, body)
    told = [row["message"] for row in image.report["diagnostics"] if row["attribute"] == "primray:denoise"]
    assert ((image.denoised is not None), len(told)) == (there, 0 if there else 1)
    assert rendered(tmp_path, body, denoise=False).denoised is None


def test_pictures_are_shown_as_the_product_asks(tmp_path: Path) -> None:
    stage = stage_with(tmp_path, 'string primray:view = "Raw"\nfloat primray:exposure = 1', "float primray:exposure = -1")
    [(product, image)] = primray.render_products(stage, spp=2, progress=False)
    saved = read_png(product.save(image, tmp_path))
    expected = image.to_uint8(view="Raw", exposure=-1.0)
    assert np.array_equal(saved, expected)
    assert not np.array_equal(saved, image.to_uint8(view="Un-tone-mapped"))
    assert np.array_equal(
        read_png(image.save(tmp_path / "own.png", view="Un-tone-mapped", exposure=0)),
        image.to_uint8(view="Un-tone-mapped", exposure=0),
    )


def read_png(path: Path) -> Any:
    import OpenImageIO as oiio

    straight = oiio.ImageSpec()
    straight.attribute("oiio:UnassociatedAlpha", 1)
    pixels: Any = oiio.ImageBuf(str(path), 0, 0, straight).get_pixels(oiio.UINT8)
    return np.concatenate([pixels, np.full((*pixels.shape[:2], 4 - pixels.shape[2]), 255, np.uint8)], axis=2)


def test_a_view_that_there_is_not_is_reported_and_the_default_is_shown(tmp_path: Path) -> None:
    with pytest.warns(primray.RenderWarning, match="no view 'Nonsense'"):
        image = rendered(tmp_path, 'string primray:view = "Nonsense"', spp=2)
    assert np.array_equal(image.to_uint8(), rendered(tmp_path, spp=2).to_uint8())
    with pytest.raises(primray.PrimrayError, match="Nonsense"):
        rendered(tmp_path, 'string primray:view = "Nonsense"', spp=2, strict=True)


def test_checkpoints_come_as_often_as_the_stage_asks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found: list[float] = []

    class Watched(checkpointing.Saver):
        def __init__(self, about: Any, every_s: float, *rest: Any) -> None:
            found.append(every_s)
            super().__init__(about, every_s, *rest)

    monkeypatch.setattr(checkpointing, "Saver", Watched)
    for number, (body, every_s) in enumerate([("", None), ("float primray:checkpointInterval = 7", None), ("", 3.0)]):
        saved = primray.Checkpointing(tmp_path / f"{number}.prc", every_s)
        rendered(tmp_path, body, spp=2, checkpointing=saved)
    assert found == [60.0, 7.0, 3.0]


def test_frames_in_parts_know_their_end(tmp_path: Path) -> None:
    stage = stage_with(tmp_path, "int karma:global:pathtracedsamples = 6\nint primray:maxDepth = 2")
    settings, notes = with_ends_of_stage(stage, RenderSettings())
    assert (settings.spp, settings.max_depth) == (6, None)  # the depth each part reads itself
    assert ["is read as 6 samples" in note.message for note in notes] == [True]
    assert with_ends_of_stage(stage, RenderSettings(time_limit_s=1))[0] == RenderSettings(time_limit_s=1)
    whole = primray.render(stage, progress=False)
    image = primray.render(stage, executor=primray.LocalProcesses(1), progress=False)
    assert image.report["pixels_sha256"] == whole.report["pixels_sha256"]
    assert image.report["settings"]["spp"] == 6


def test_inspect_shows_what_the_stage_asks_for(tmp_path: Path) -> None:
    stage = stage_with(tmp_path, 'int primray:samples = 6\nstring primray:view = "Raw"', "int primray:maxDepth = 2")
    outputs = primray.inspect(stage)["outputs"]
    assert [(row["setting"], row["value"]) for row in outputs["render_settings"][0]["asks"]] == [("spp", 6)]
    assert outputs["render_settings"][0]["view"]["view"] == "Raw"
    assert [row["prim"] for row in outputs["products"][0]["asks"]] == ["/settings", "/product"]
    assert [row["setting"] for row in outputs["settings_taken"]] == ["spp", "max_depth"]
    assert [row["setting"] for row in primray.inspect(stage, spp=3)["outputs"]["settings_taken"]] == ["max_depth"]


def test_the_record_keeps_the_view_through_a_checkpoint(tmp_path: Path) -> None:
    stage = stage_with(tmp_path, 'string primray:view = "Raw"')
    file = tmp_path / "a.prc"
    primray.render(stage, spp=2, progress=False, checkpointing=primray.Checkpointing(file))
    assert load(file).about.file.view.view == "Raw"
