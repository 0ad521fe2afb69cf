"""`primray` from its arguments to its files, streams and exit codes, with a stand-in core."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from primray.cli import run

from ..conftest import FakePipeline


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def files() -> list[str]:
    return sorted(os.listdir())


def report_of(file: str) -> Any:
    return json.loads(Path(file).read_text())


def test_the_default_output_is_named_after_the_stage(pipeline: FakePipeline) -> None:
    assert run(["render", "somewhere/shot.usda"]) == 0
    assert files() == ["shot.exr"]


def test_usdrecords_positional_output(pipeline: FakePipeline) -> None:
    assert run(["render", "shot.usda", "a.png"]) == 0
    assert files() == ["a.png"]


def test_several_outputs_and_a_report(pipeline: FakePipeline) -> None:
    assert run(["render", "shot.usda", "-o", "a.exr", "-o", "a.jpg", "--report", "a.json"]) == 0
    assert files() == ["a.exr", "a.jpg", "a.json"]
    report = report_of("a.json")
    assert report["outputs"] == ["a.exr", "a.jpg"]
    assert report["stages_s"]["write"] > 0


def test_every_flag_reaches_the_settings(pipeline: FakePipeline) -> None:
    flags = "-cam /World/cam -r 16 8 -f 3 -p 5 --max-depth 2 --filter gaussian --filter-width 2.5 -j 2 --seed 9 --max-memory 4G"
    stop = "--target-error 0.02 --error-metric rmse --time-limit 7.5 --no-adaptive"
    more = "--view Raw --exposure 1.5 --purposes default,proxy --no-default-light --strict --report r.json -o a.png -o a.exr"
    more += " --no-translated-shaders"
    more += " --fail-on missing --allow motion"
    more += " --aov depth,normal --aov st --default-wrap mirror --render-context universal --auto-camera usdrecord"
    chosen = "--variant /a:s=x --variant /a:t= --load /p --load /q --mask /a,/b --session-layer over.usda --render-settings /s"
    chosen += " --render-pass p --deep-tolerance 0.005 --deep-samples 64"
    chosen += " --texture-memory 400M --texture-cache tiles --texture-cache-size 1G"
    chosen += " --shutter -0.25 0.5 --motion-error 0.2 --no-motion-blur --region 0 0.25 0.5 1"
    chosen += " --lens mechanical-vignetting=2,0.5 --lens natural-vignetting=1"
    chosen += " --diffusion 0 --diffusion-glare 0.1 --diffusion-bloom-width 0.02"
    chosen += " --diffusion-starburst 0.4 --diffusion-starburst-width 0.001"
    looks = ["--rendering-color-space", "lin_rec709_scene", "--display", "sRGB - Display"]
    assert run(["render", "shot.usda", *flags.split(), *more.split(), *chosen.split(), *stop.split(), *looks]) == 0
    assert report_of("r.json")["settings"] == {
        "camera": "/cam",  # as resolved by translation
        "auto_camera": "usdrecord",
        "render_settings": "/s",
        "render_pass": "/Render/p",
        "product": None,
        "resolution": [16, 8],
        "resolution_scale": 1.0,
        "time_code": 3.0,
        "spp": 5,
        "target_error": 0.02,
        "error_metric": "rmse",
        "time_limit_s": 7.5,
        "adaptive": False,
        "denoise": False,
        "stop_at": "picture",
        "sample_range": None,
        "dicing_rate": 4.0,
        "motion_blur": False,
        "shutter": [-0.25, 0.5],
        "motion_error": 0.2,
        "region": [0.0, 0.25, 0.5, 1.0],
        "diffusion": 0.0,
        "diffusion_glare": 0.1,
        "diffusion_bloom_width": 0.02,
        "diffusion_starburst": 0.4,
        "diffusion_starburst_width": 0.001,
        "max_depth": 2,
        "filter": "gaussian",
        "filter_width": 2.5,
        "threads": 2,
        "seed": 9,
        "default_light": False,
        "translated_shaders": False,
        "default_wrap": "mirror",
        "render_context": "universal",
        "rendering_color_space": "lin_rec709_scene",
        "purposes": ["default", "proxy"],
        "aovs": ["depth", "normal", "st"],
        "aov_errors": False,
        "deep_tolerance": 0.005,
        "deep_samples": 64,
        "strict": True,
        "fail_on": ["missing"],
        "allow": ["motion"],
        "max_memory_bytes": 4 * 2**30,
        "texture_memory_bytes": 400 * 2**20,
        "texture_cache": "tiles",
        "texture_cache_bytes": 2**30,
        "lens_flaws": ["mechanical-vignetting=2,0.5", "natural-vignetting=1"],
        "variants": ["/a:s=x", "/a:t="],
        "load": ["/p", "/q"],
        "mask": ["/a", "/b"],
        "session_layer": "over.usda",
    }


def test_image_width(pipeline: FakePipeline) -> None:
    assert run(["render", "shot.usda", "-w", "20", "--report", "r.json"]) == 0
    assert report_of("r.json")["settings"]["resolution"] == [20, 10]


def test_frame_and_frames_are_one_flag(pipeline: FakePipeline) -> None:
    assert run(["render", "shot.usda", "--frame", "1-5x2", "-o", "a.####.exr"]) == 0
    assert files() == ["a.0001.exr", "a.0003.exr", "a.0005.exr"]


@pytest.mark.parametrize("command", ["inspect", "estimate"])
def test_a_look_at_one_frame_refuses_more(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run([command, "shot.usda", "--frames", "1-3", "--json"]) == 2
    assert json.loads(capsys.readouterr().out)["code"] == "frames"


def test_frames(pipeline: FakePipeline) -> None:
    assert run(["render", "shot.usda", "-f", "1:5x2", "-o", "a.####.exr", "--report", "r.%02d.json"]) == 0
    assert files() == ["a.0001.exr", "a.0003.exr", "a.0005.exr", "r.01.json", "r.03.json", "r.05.json"]
    assert pipeline.calls.count("open shot.usda") == 1


def test_json_lines(pipeline: FakePipeline, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["render", "shot.usda", "--json"]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [line["type"] for line in lines] == ["progress", "progress", "report"]
    assert lines[0]["fraction"] == 0.5
    assert lines[1]["eta_s"] == 0.0
    assert lines[2]["pixels_sha256"]


def test_diagnostics_are_grouped_on_stderr(pipeline: FakePipeline, capsys: pytest.CaptureFixture[str]) -> None:
    pipeline.diagnostics = [("texture-bad-texels", f"/dome{index}", "some") for index in range(5)]
    assert run(["render", "shot.usda"]) == 0
    captured = capsys.readouterr()
    assert "warning: texture-bad-texels (out-of-range): some (5 times)" in captured.err
    assert "/dome0, /dome1, /dome2 and 2 more" in captured.err
    assert captured.out.startswith("shot.exr: 8 x 4, 64 samples")


@pytest.mark.parametrize(
    ("arguments", "code", "exit_code"),
    [
        (["--spp", "0"], "settings-error", 2),
        (["--res", "0", "0"], "settings-error", 2),
        (["--filter-width", "nan"], "settings-error", 2),
        (["--exposure", "inf"], "settings-error", 2),
        (["-c", "low"], "camera", 2),
        (["--res", "4", "4", "-w", "4"], "resolution", 2),
        (["--frames", "x"], "frames", 2),
        (["--frames", "1:2", "-o", "a.exr"], "frames", 2),
        (["--max-memory", "lots"], "max-memory", 2),
        (["--view", "Filmic"], "unknown-view", 2),
        (["-o", "a.gif"], "unknown-extension", 2),
        (["-o", "no/such/a.exr"], "output-folder", 2),
        (["--report", "no/such/r.json"], "output-folder", 2),
        (["--res", "99999", "99999"], "limit", 4),
        (["--max-memory", "1K"], "max-memory", 2),
    ],
)
def test_errors_are_one_line_before_anything_is_rendered(
    arguments: list[str], code: str, exit_code: int, pipeline: FakePipeline, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["render", "shot.usda", *arguments]) == exit_code
    captured = capsys.readouterr()
    assert captured.err.startswith(f"error: {code}: ")
    assert captured.err.count("\n") == 1
    assert "render" not in pipeline.calls
    assert files() == []


def test_a_missing_scene(pipeline: FakePipeline, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["render", "missing.usda", "--json"]) == 3
    captured = capsys.readouterr()
    assert captured.err == "error: stage-open: there is no such file [missing.usda]\n"
    line = json.loads(captured.out)
    assert (line["type"], line["code"], line["exit_code"]) == ("error", "stage-open", 3)


@pytest.mark.parametrize(
    "arguments", [["render"], ["render", "a.usda", "--nonsense"], ["nonsense"], ["render", "a", "--spp", "x"]]
)
def test_usage_errors(arguments: list[str]) -> None:
    assert run(arguments) == 2


def test_an_interrupted_render_leaves_a_picture_and_130(pipeline: FakePipeline, capsys: pytest.CaptureFixture[str]) -> None:
    pipeline.interrupt = True
    assert run(["render", "shot.usda", "-f", "1:3", "-o", "a.#.exr", "--report", "r.#.json"]) == 130
    assert files() == ["a.1.exr", "r.1.json"]
    assert report_of("r.1.json")["interrupted"] is True
    assert "interrupted" in capsys.readouterr().err


def test_an_interrupt_outside_the_render(
    pipeline: FakePipeline, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("primray.core.build", interrupted)
    assert run(["render", "shot.usda"]) == 130
    assert files() == []


def test_a_defect_is_one_line_and_a_traceback_on_request(
    pipeline: FakePipeline, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken(*_: Any, **__: Any) -> None:
        raise ZeroDivisionError("by zero")

    monkeypatch.setattr("primray.core.build", broken)
    assert run(["render", "shot.usda"]) == 1
    assert capsys.readouterr().err.startswith("error: internal: ZeroDivisionError: by zero")
    assert run(["render", "shot.usda", "-V"]) == 1
    assert "Traceback" in capsys.readouterr().err


def test_inspect(pipeline: FakePipeline, capsys: pytest.CaptureFixture[str]) -> None:
    pipeline.diagnostics = [("texture-bad-texels", "/dome", "some")]
    assert run(["inspect", "shot.usda", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["camera"]["path"] == "/cam"
    assert facts["cameras"] == ["/cam", "/other"]
    assert facts["lights"][0]["type"] == "dome"
    assert facts["counts"] == {"memory_bytes": 2**20, "triangles": 12}
    assert facts["stage"]["layers"] == ["shot.usda", "car.usda"]
    assert facts["textures"] == [{"path": "/no/such.png", "size": None}]
    assert run(["inspect", "shot.usda", "--variant", "/World/car:color=blue"]) == 0
    assert pipeline.composition.variants == ("/World/car:color=blue",)
    out = capsys.readouterr().out
    for text in [
        "/cam (perspective), 8 x 4",
        "also /other",
        "/dome (dome)",
        "1.0 MiB",
        "texture-bad-texels",
        "/World/car:color=red (blue, red)",
        "1 loaded, 1 not loaded",
        "1 to 9, 24 codes a second, samples from 1 to 8",
        "default 2 shapes, proxy 1 shape",
        "/i: 7 of 1 prototypes",
        "/m: cards",
        "/no/such.png: cannot be read",
        "/smoke (2 instances), from (0, 0, 0) to (1, 4, 0.75): density 7 voxels in 1 x 2 x 3 of 0.5 x 2 x 0.25, 1.0 MiB",
    ]:
        assert text in out
    assert "render" not in pipeline.calls


def test_doctor(pipeline: FakePipeline, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["doctor"]) == 0
    assert "v4, 16 lanes, Embree 4.4.0" in capsys.readouterr().out
    monkeypatch.setenv("OCIO", "/nowhere.ocio")
    assert run(["doctor"]) == 1
    assert "colour   FAILED" in capsys.readouterr().out


def test_version_starts_quickly() -> None:
    """Nothing heavy is imported for it: time itself would be a flaky test."""
    code = "import sys, primray.cli as cli; code = cli.run(['--version']); print(code, [m for m in HEAVY if m in sys.modules])"
    heavy = ["numpy", "pxr", "OpenImageIO", "PyOpenColorIO", "rich.progress", "primray.core"]
    done = subprocess.run([sys.executable, "-c", f"HEAVY = {heavy}; {code}"], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "0 []"
    for name in ("primray", "embree", "usd", "python"):
        assert f"{name} " in done.stdout
