"""`primray render -o tev://...`: pictures refine in tev while they are rendered, and end as the EXR has them."""

from __future__ import annotations

import socket
from pathlib import Path

import numpy as np
import pytest
from tests.tev_server import FakeTev, fake_tev

from primray.cli import output_targets, run
from primray.images.image import CHANNELS, ERROR_CHANNELS, Image
from primray.images.reading import read_measured
from primray.images.tev import TevPicture

SCENE = '#usda 1.0\ndef Sphere "s" {}\n'
SMALL = ["--res", "64", "48", "--spp", "512"]


@pytest.fixture(autouse=True)
def _a_scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(output_targets, "EVERY_S", 1e-6)
    monkeypatch.setattr(output_targets, "MOST_SHARE", 1.0)
    Path("s.usda").write_text(SCENE)


def assert_same(tev: FakeTev, name: str, file: str) -> None:
    kept = read_measured(file)
    assert kept.stderr is not None
    assert (tev.picture(name, CHANNELS[:3]) == kept.pixels).all()
    assert (tev.picture(name, ("A",))[..., 0] == kept.alpha).all()
    assert np.array_equal(tev.picture(name, ERROR_CHANNELS), kept.stderr)


def test_a_picture_refines_and_is_the_files(capsys: pytest.CaptureFixture[str]) -> None:
    with fake_tev() as tev:
        assert run(["render", "s.usda", "-o", f"tev://127.0.0.1:{tev.port}", "-o", "s.exr", *SMALL[:-1], "4096"]) == 0
    assert f"tev://127.0.0.1:{tev.port}/s, s.exr: 64 x 48" in capsys.readouterr().out
    assert tev.created == ["s"]
    assert len(set(tev.sums)) > 1  # before the last one, too
    assert_same(tev, "s", "s.exr")


def test_it_changes_no_bit_and_leaves_no_file() -> None:
    with fake_tev() as tev:
        assert run(["render", "s.usda", f"tev://127.0.0.1:{tev.port}/a.exr", *SMALL]) == 0
    assert [path.name for path in Path().iterdir()] == ["s.usda"]
    assert run(["render", "s.usda", "plain.exr", *SMALL]) == 0
    assert_same(tev, "a.exr", "plain.exr")


def test_every_frame_has_a_picture() -> None:
    with fake_tev() as tev:
        output = f"tev://127.0.0.1:{tev.port}"
        assert run(["render", "s.usda", "-o", output, "-o", f"{output}/take#1/b.##", "-f", "1:2", *SMALL]) == 0
        assert run(["render", "s.usda", "-o", f"{output}/one", "-f", "1:2", *SMALL]) == 2  # both would be one picture
    assert sorted(set(tev.created)) == ["s.0001", "s.0002", "take#1/b.01", "take#1/b.02"]
    assert len(tev.created) == 4


PAIR = """#usda 1.0
def Sphere "s" {}
def Camera "c_left" {
    uniform token stereoRole = "left"
    double3 xformOp:translate = (0, 0, 9)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Camera "c_right" {
    uniform token stereoRole = "right"
    double3 xformOp:translate = (1, 0, 9)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""


def test_both_eyes() -> None:
    Path("s.usda").write_text(PAIR)
    with fake_tev() as tev:
        output = f"tev://127.0.0.1:{tev.port}/a.exr"
        assert run(["render", "s.usda", "--stereo", "-o", output, "--camera", "/c_left", *SMALL]) == 0
    assert sorted(tev.created) == ["a_left.exr", "a_right.exr"]


def test_merged_parts() -> None:
    for part in ("0:64", "64:128"):
        flags = ["--sample-range", part, "--checkpoint", f"{part}.prc", "-o", f"{part}.exr"]
        assert run(["render", "s.usda", "--res", "64", "48", *flags]) == 0
    with fake_tev() as tev:
        outputs = ["-o", f"tev://127.0.0.1:{tev.port}/all", "-o", "all.exr"]
        assert run(["merge", "0:64.prc", "64:128.prc", *outputs]) == 0
    assert_same(tev, "all", "all.exr")


def test_nobody_listens_is_told_before(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        output = f"tev://127.0.0.1:{listener.getsockname()[1]}"
    assert run(["render", "s.usda", "-o", output, "-o", "s.exr"]) == 2
    assert f"error: tev-unreachable: no tev is listening: Connection refused; start tev, or check its --host [{output}/s]" in (
        capsys.readouterr().err
    )
    assert not Path("s.exr").exists()


def test_one_that_goes_away_is_told_and_the_file_is_written(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    show = TevPicture.show
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def gone(shown: TevPicture, image: Image) -> None:
            listener.close()
            show(shown, image)

        monkeypatch.setattr(TevPicture, "show", gone)
        output = f"tev://127.0.0.1:{listener.getsockname()[1]}/s"
        assert run(["render", "s.usda", "-o", output, "-o", "s.exr", *SMALL[:-1], "4096"]) == 1
    said = capsys.readouterr().err
    assert said.count("warning: the unfinished picture could not be shown: write-failed: ") == 1
    assert said.count("error: write-failed: ") == 1
    assert Path("s.exr").exists()


def test_aovs_are_parts_of_files_alone(capsys: pytest.CaptureFixture[str]) -> None:
    with fake_tev() as tev:
        assert run(["render", "s.usda", "-o", f"tev://127.0.0.1:{tev.port}/a.exr", "--aov", "depth"]) == 2
    assert "aov-output" in capsys.readouterr().err
    assert not tev.created
