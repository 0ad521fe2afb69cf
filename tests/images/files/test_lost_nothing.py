"""What was sampled is written, whatever fails after it: views, metrics, denoising, AOVs, files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import PyOpenColorIO as ocio
import pytest

import primray
from primray.cli import run
from primray.color import ocio as color
from primray.color.color_space import REC709
from primray.errors import SettingsError
from primray.images.exposure import View
from primray.images.image import Image

STAGE = '#usda 1.0\ndef Sphere "ball" {}\ndef DomeLight "sky" {}\n'
QUICK = ["--res", "16", "12", "--spp", "4"]
LUT = "Version 1\nFrom 0.0 1.0\nLength 2\nComponents 1\n{\n0.0\n1.0\n}\n"
CONFIG = """ocio_profile_version: 2
search_path: luts
roles: {{scene_linear: {linear}, default: {linear}}}
displays:
  Wall:
    - !<View> {{name: Graded, colorspace: graded}}
    - !<View> {{name: Plain, colorspace: {linear}}}
active_displays: []
active_views: []
colorspaces:
  - !<ColorSpace> {{name: {linear}}}
  - !<ColorSpace> {{name: graded, from_scene_reference: !<FileTransform> {{src: {lut}}}}}
"""


@pytest.fixture
def stage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "luts").mkdir()
    (tmp_path / "luts/good.spi1d").write_text(LUT)
    (tmp_path / "luts/bad.spi1d").write_text("Version 1\nnonsense\n")
    (tmp_path / "luts/text.cube").write_text("LUT_3D_SIZE 2\n0 0 zero\n")
    (tmp_path / "s.usda").write_text(STAGE)
    return tmp_path / "s.usda"


def use(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, lut: str, linear: str = "lin_rec709") -> None:
    path = tmp_path / f"{lut}-{linear}.ocio"
    path.write_text(CONFIG.format(lut=lut, linear=linear))
    monkeypatch.setenv("OCIO", str(path))


FAILING = ["missing.spi1d", "bad.spi1d", "text.cube"]


@pytest.mark.parametrize("lut", FAILING)
def test_an_exr_needs_no_view(lut: str, stage: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    use(monkeypatch, stage.parent, lut)
    assert run(["render", "s.usda", "-o", "a.exr", "--report", "a.json", *QUICK]) == 0
    report = json.loads(Path("a.json").read_text())
    assert report["error"]["display"] is None
    assert report["error"]["relmse"]["estimate"] > 0
    assert "display-error-unknown" in [row["code"] for row in report["diagnostics"]]


@pytest.mark.parametrize("lut", FAILING)
@pytest.mark.parametrize("asked", [["-o", "a.png"], ["-o", "a.exr", "-o", "a.jpg"], ["-o", "a.exr", "--metric", "display"]])
def test_a_view_that_is_asked_for_is_made_before_sampling(
    asked: list[str], lut: str, stage: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    use(monkeypatch, stage.parent, lut)
    assert run(["render", "s.usda", *asked, *QUICK]) == 2
    assert "ocio-config: the OCIO configuration cannot show the view 'Graded' of 'Wall'" in capsys.readouterr().err
    assert not list(stage.parent.glob("a.*"))
    assert run(["render", "s.usda", "-o", "b.png", "--view", "Plain", *QUICK]) == 0  # another one serves


def test_doctor_tries_every_view(stage: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    use(monkeypatch, stage.parent, "missing.spi1d")
    assert run(["doctor"]) == 1
    out = capsys.readouterr().out
    assert "Graded of Wall fails" in out
    assert "Plain of Wall fails" not in out
    use(monkeypatch, stage.parent, "good.spi1d")
    assert run(["doctor"]) == 0


def test_a_scene_linear_role_is_an_assumption(stage: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    use(monkeypatch, stage.parent, "good.spi1d", "film linear")
    command = ["render", "s.usda", "-o", "a.png", "--report", "a.json", *QUICK]

    def codes() -> set[str]:
        return {row["code"] for row in json.loads(Path("a.json").read_text())["diagnostics"]}

    assert run(command) == 0
    assert "view-space-assumed" in codes()
    assert run([*command, "--strict"]) == 2
    assert run([*command, "--strict", "--rendering-color-space", "lin_ap1"]) == 0
    assert "view-space-assumed" not in codes()
    with pytest.raises(SettingsError, match="no known linear space"):  # textures are not converted by a guess
        color.convert(np.ones((1, 1, 3), np.float32), "graded", REC709)
    with pytest.warns(primray.RenderWarning, match="view-space-assumed"):
        Image(np.full((4, 4, 4), 0.5, np.float32)).save("b.png")


@pytest.mark.parametrize("error", [ocio.Exception, ocio.ExceptionMissingFile, RuntimeError, ValueError])
def test_whatever_opencolorio_raises_is_a_settings_error(error: type[Exception], monkeypatch: pytest.MonkeyPatch) -> None:
    class Raises:
        def __getattr__(self, name: str) -> Any:
            raise error("one line\nand another")

    with pytest.raises(SettingsError, match="one line; and another") as refused:
        color._processor(lambda config: Raises().anything, "do it")
    assert refused.value.code == "ocio-config"


@pytest.mark.parametrize("error", [SettingsError("the view is gone", code="ocio-config"), MemoryError(), ValueError("odd")])
@pytest.mark.parametrize("more", [[], ["--exposure", "auto"]])
def test_a_view_that_fails_at_the_end_costs_nothing_else(
    more: list[str], error: Exception, stage: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fails(self: View, *_: object) -> Any:
        raise error

    monkeypatch.setattr(View, "shown", fails)
    outputs = ["-o", "a.png", "-o", "a.exr", "-o", "b.tif", "-o", "c.hdr", "--report", "a.json"]
    assert run(["render", "s.usda", *outputs, *QUICK, *more]) == 1
    assert sorted(path.name for path in stage.parent.glob("[abc].*")) == ["a.exr", "a.json", "c.hdr"]
    assert json.loads(Path("a.json").read_text())["outputs"] == ["a.exr", "c.hdr"]
    assert run(["render", "s.usda", "-o", "only.png", *QUICK, *more]) == 1
    assert "the picture was saved as only.exr instead" in capsys.readouterr().err
    assert np.array_equal(primray.read_image("only.exr").pixels, primray.read_image("a.exr").pixels)
    before = Path("only.exr").read_bytes()
    assert run(["render", "s.usda", "-o", "only.png", *QUICK, *more, "--seed", "1"]) == 1
    assert Path("only.exr").read_bytes() == before  # a file that is there is never replaced by what nobody asked for


@pytest.mark.parametrize(
    ("where", "asked"),
    [
        ("primray.images.first_hit.aovs_and_planes_of", ["--aov", "depth"]),
        ("primray.images.cryptomatte.mattes_of", ["--aov", "crypto_object"]),
        ("primray.images.light_path_aovs.light_paths_of_film", ["--aov", "C<RD>L"]),
        ("primray.images.glare.with_diffusion", ["--diffusion", "0.1"]),
    ],
)
def test_what_is_made_at_the_end_may_fail(
    where: str, asked: list[str], stage: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fails(*_: object) -> Any:
        raise MemoryError("no room")

    monkeypatch.setattr(where, fails)
    assert run(["render", "s.usda", "-o", "a.exr", *QUICK, *asked]) == 1
    assert "picture-unfinished" in capsys.readouterr().err
    assert primray.read_image("a.exr").pixels[..., 3].max() == 1


def test_the_places_of_all_frames_are_looked_at_before_the_first(stage: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (stage.parent / "a.0002.exr").mkdir()
    assert run(["render", "s.usda", "-o", "a.####.exr", "--frames", "1:2", *QUICK]) == 2
    assert "its folder is not writable [a.0002.exr]" in capsys.readouterr().err
    assert not (stage.parent / "a.0001.exr").exists()


def test_the_left_eye_is_kept_where_the_right_one_fails(stage: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = primray.render("s.usda", resolution=(16, 12), spp=2, progress=False)

    def frames(*_: object, **__: object) -> Any:
        yield made
        raise SettingsError("the right eye is blind")

    monkeypatch.setattr("primray.incremental.scene.quiet_frames", frames)
    assert run(["render", "s.usda", "--stereo", "-o", "pair.exr", "-o", "pair.png", *QUICK]) == 2
    assert sorted(path.name for path in stage.parent.glob("pair*")) == ["pair_left.exr", "pair_left.png"]
