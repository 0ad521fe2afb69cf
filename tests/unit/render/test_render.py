"""The order of a render, its report, its limits and its interruptions, with a stand-in core."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

import primray
from primray import Filter, RenderSettings, render, render_frames
from primray.errors import LimitError, RenderCancelled, StageOpenError, UnsupportedError
from primray.images.image import pixels_sha256
from primray.render import check_memory
from primray.report.summary import summary

from ..conftest import FakePipeline, make_description, make_dome

REPORT_KEYS = {
    "stages_s",
    "samples",
    "samples_per_pixel",
    "rays",
    "rays_by_kind",
    "splits",
    "light_samples",
    "frame",
    "motion",
    "lane_occupancy",
    "invalid_samples",
    "error",
    "convergence",
    "stop",
    "sampling_s",
    "rays_per_s",
    "cpu_s",
    "cpu_total_s",
    "peak_rss_bytes",
    "interrupted",
    "isa",
    "lanes",
    "threads",
    "pixels_sha256",
    "color_space",
    "aovs",
    "scene",
    "features",
    "diagnostics",
    "settings",
    "stage_settings",
    "versions",
}


def test_a_path_is_opened_translated_built_and_rendered(pipeline: FakePipeline) -> None:
    image = render("a.usda", RenderSettings(spp=4))
    assert pipeline.calls == ["open a.usda", "translate None", "build", "render"]
    assert image.pixels.shape == (4, 8, 4)
    assert image.camera is not None


def test_what_opening_says_is_in_every_frames_report(pipeline: FakePipeline) -> None:
    pipeline.opening = [("texture-bad-texels", "/a", "opening")]
    pipeline.diagnostics = [("texture-bad-texels", "/b", "translating")]
    for image in render_frames("a.usda", [RenderSettings(), RenderSettings()]):
        assert [d["message"] for d in image.report["diagnostics"]] == ["opening", "translating"]


def test_the_report(pipeline: FakePipeline) -> None:
    pipeline.diagnostics = [("texture-bad-texels", "/dome", "some")]
    image = render("a.usda", RenderSettings(spp=4, filter=Filter.BOX))
    report = image.report
    assert set(report) == REPORT_KEYS
    assert list(report["stages_s"]) == ["open", "translate", "dice", "build", "render", "write"]
    assert report["pixels_sha256"] == pixels_sha256(image.pixels)
    assert report["samples"] == 8 * 4 * 4
    assert report["error"]["relmse"] == {"estimate": 0.01, "ci95": [0.009, 0.011]}
    assert set(report["error"]) == {"relmse", "rmse", "display"}
    assert report["convergence"] == [{"samples": 4, "seconds": 0.5, "relmse": 0.01, "ci95": [0.009, 0.011], "rmse": 0.01}]
    assert report["stop"] == {"reason": "samples", "target_met": None}
    assert report["samples_per_pixel"] == [4, 4]
    assert report["isa"] == "v4"
    assert report["lanes"] == 16
    assert report["peak_rss_bytes"] > 2**20
    assert report["versions"]["embree"] == "4.4.0"
    assert report["diagnostics"] == [
        {
            "severity": "warning",
            "kind": "out-of-range",
            "code": "texture-bad-texels",
            "prim_path": "/dome",
            "attribute": "",
            "message": "some",
        }
    ]


def test_samples_left_out_are_told(pipeline: FakePipeline) -> None:
    pipeline.invalid_samples = 3
    codes = [d["code"] for d in render("a.usda").report["diagnostics"]]
    assert codes == ["invalid-samples"]


def test_settings_are_resolved(pipeline: FakePipeline) -> None:
    settings = render("a.usda", RenderSettings(resolution=(8, 0), filter=Filter.BLACKMAN_HARRIS)).report["settings"]
    assert settings["camera"] == "/cam"
    assert settings["resolution"] == [8, 4]
    assert settings["spp"] == 64
    assert settings["filter"] == "blackman-harris"
    assert settings["filter_width"] == 3.0
    assert settings["threads"] >= 1
    assert render("a.usda").report["settings"]["filter_width"] == 1.0


def test_the_header_has_settings_and_versions_and_no_costs(pipeline: FakePipeline) -> None:
    first, second = render("a.usda"), render("a.usda")
    assert first.metadata == second.metadata
    assert first.metadata["settings.spp"] == 64
    assert first.metadata["settings.resolution"] == "8 4"
    assert first.metadata["settings.max_depth"] == "default"
    assert first.metadata["versions.embree"] == "4.4.0"
    assert not [name for name in first.metadata if name.startswith(("stages_s", "cpu", "peak"))]


def test_strict_refuses_before_building(pipeline: FakePipeline) -> None:
    pipeline.diagnostics = [("texture-bad-texels", "/dome", "some")]
    with pytest.raises(UnsupportedError, match="texture-bad-texels"):
        render("a.usda", RenderSettings(strict=True))
    assert "build" not in pipeline.calls


def test_what_building_says_is_in_the_report(pipeline: FakePipeline) -> None:
    pipeline.building = [("singular-transform", "/flat", "2 instances are left out")]
    assert [d["code"] for d in render("a.usda").report["diagnostics"]] == ["singular-transform"]
    with pytest.raises(UnsupportedError, match="singular-transform"):
        render("a.usda", RenderSettings(strict=True))


def test_memory_is_checked_before_building(pipeline: FakePipeline) -> None:
    pipeline.memory_bytes = 2**30
    with pytest.raises(LimitError, match="1024 MiB") as caught:
        render("a.usda", RenderSettings(max_memory_bytes=2**29))
    assert caught.value.exit_code == 4
    assert "build" not in pipeline.calls
    render("a.usda", RenderSettings(max_memory_bytes=2**30))


def test_a_checkpoints_copy_of_the_film_counts_as_memory() -> None:
    description = make_description(resolution=(1000, 1000))
    needed = summary(description).memory_bytes
    check_memory(description, RenderSettings(max_memory_bytes=needed), [])
    with pytest.raises(LimitError):
        check_memory(description, RenderSettings(max_memory_bytes=needed + 100_000_000), [], film_copies=1)
    check_memory(description, RenderSettings(max_memory_bytes=needed + 130_000_000), [], film_copies=1)


def test_errors_of_opening_pass_through(pipeline: FakePipeline) -> None:
    with pytest.raises(StageOpenError):
        render("missing.usda")


def test_interrupted(pipeline: FakePipeline) -> None:
    pipeline.interrupt = True
    with pytest.raises(KeyboardInterrupt):
        render("a.usda")
    assert render("a.usda", on_interrupt="partial").report["interrupted"] is True


def test_progress_can_stop(pipeline: FakePipeline) -> None:
    seen = []

    def progress(fraction: float, samples: int, rays: int) -> bool:
        seen.append((fraction, samples, rays))
        return False

    with pytest.raises(RenderCancelled):
        render("a.usda", progress=progress)
    assert seen == [(0.5, 100, 300)]


def test_progress_that_returns_nothing_goes_on(pipeline: FakePipeline) -> None:
    seen: list[float] = []
    assert not render("a.usda", progress=lambda fraction, samples, rays: seen.append(fraction)).report["interrupted"]
    assert seen == [0.5, 1.0]


def test_frames_open_the_stage_once(pipeline: FakePipeline) -> None:
    images = list(render_frames("a.usda", [RenderSettings(time_code=1.0), RenderSettings(time_code=2.0)]))
    assert pipeline.calls.count("open a.usda") == 1
    assert [image.report["settings"]["time_code"] for image in images] == [1.0, 2.0]
    assert images[1].report["stages_s"]["open"] == 0.0


def test_textures_reach_the_core_by_file(pipeline: FakePipeline, tmp_path: Path) -> None:
    path = str(tmp_path / "sky.exr")
    pixels = np.full((2, 4, 3), 0.5, np.float32)
    pixels[0, 0, 0] = np.nan
    oiio.ImageBuf(pixels).write(path)
    pipeline.description = make_description(lights=(make_dome(path),))
    report = render("a.usda").report
    [(file, [(tile, texture)])] = pipeline.textures.items()
    assert (file.path, tile, texture.pixels.shape) == (path, 0, (2, 4, 3))
    assert [d["code"] for d in report["diagnostics"]] == ["texture-bad-texels"]


def test_a_light_with_an_unreadable_texture_is_left_out(pipeline: FakePipeline) -> None:
    pipeline.description = make_description(lights=(make_dome("/nowhere/sky.exr"), make_dome()))
    report = render("a.usda").report
    assert [(d["code"], d["severity"]) for d in report["diagnostics"]] == [("texture-unreadable", "error")]
    assert "/nowhere/sky.exr" in report["diagnostics"][0]["message"]
    with pytest.raises(UnsupportedError):
        render("a.usda", RenderSettings(strict=True))


def test_lazy_names() -> None:
    assert primray.Image.__name__ == "Image"
    assert primray.Camera.__name__ == "Camera"
    with pytest.raises(AttributeError):
        _ = primray.Nonsense  # type: ignore[attr-defined]
