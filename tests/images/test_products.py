"""Several products of one stage in one render: their cameras, sizes and names, by the library and by the command line."""

from __future__ import annotations

import json
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pxr import Usd

import primray
from primray.cli import run
from primray.images.reading import read_measured
from primray.settings import RenderSettings

SCENE = Path(__file__).parents[2] / "scenes/features/render-products/scene.usda"
FRONT, SIDE, ELSEWHERE = "/Render/front", "/Render/side", "/Render/elsewhere"
FEW = RenderSettings(spp=2, threads=1)


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def files() -> list[str]:
    return sorted(str(path) for path in Path().rglob("*") if path.is_file())


@pytest.mark.conforms("RenderSettings.products", "RenderProduct.productName", "RenderSettingsBase.resolution")
def test_every_product_has_its_camera_size_and_name() -> None:
    made = list(primray.render_products(SCENE, FEW))
    assert [(p.path, p.file_name, image.resolution) for p, image in made] == [
        (FRONT, "front.exr", (96, 64)),
        (SIDE, "side.png", (48, 48)),
        (ELSEWHERE, "front_2.exr", (24, 16)),
    ]
    assert [image.camera.path for _, image in made if image.camera] == ["/front", "/side", "/front"]
    # White sky on nothing but the two faces: each is seen in its own colour.
    front, side = (image.pixels[image.resolution[1] // 2, image.resolution[0] // 2, :3] for _, image in made[:2])
    assert np.allclose(front, (0.8, 0.1, 0.1), atol=1e-5)
    assert np.allclose(side, (0.1, 0.8, 0.1), atol=1e-5)


def test_products_have_the_bits_of_renders_by_themselves() -> None:
    ((_, image),) = primray.render_products(SCENE, FEW, ["side"])
    alone = primray.render(SCENE, RenderSettings(spp=2, threads=1, camera="/side", resolution=(48, 48)))
    assert np.array_equal(image.pixels, alone.pixels)


def test_all_products_from_the_command_line(capsys: pytest.CaptureFixture[str]) -> None:
    Path("out").mkdir()
    assert run(["render", str(SCENE), "--all-products", "--output-dir", "out", "--spp", "2", "--json"]) == 0
    assert files() == ["out/front.exr", "out/front_2.exr", "out/side.png"]
    assert read_measured("out/front_2.exr").resolution == (24, 16)
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    reports = [line for line in lines if line["type"] == "report"]
    assert [report["settings"]["product"] for report in reports] == [FRONT, SIDE, ELSEWHERE]
    assert [report["stages_s"]["open"] > 0 for report in reports] == [True, False, False]


@pytest.mark.parametrize("flags", [[], ["--make-output-path"]])
def test_one_report_of_each_frame_has_all_of_its_renders(flags: list[str]) -> None:
    folder = "reports" if flags else "."
    asked = ["--report", f"{folder}/r.####.json", "--frames", "1:2", "--spp", "2", *flags]
    assert run(["render", str(SCENE), "--all-products", *asked]) == 0
    for frame in (1, 2):
        renders = json.loads(Path(folder, f"r.000{frame}.json").read_text())["renders"]
        assert [report["settings"]["time_code"] for report in renders] == [frame] * 3
        names = [f"front.000{frame}.exr", f"side.000{frame}.png", f"front_2.000{frame}.exr"]
        assert [report["outputs"] for report in renders] == [[name] for name in names]


def test_frames_of_a_product_are_numbered() -> None:
    assert run(["render", str(SCENE), "--product", "side", "--frames", "1:2", "--spp", "2"]) == 0
    assert files() == ["side.0001.png", "side.0002.png"]


def test_without_flags_the_first_product_is_rendered_under_the_stages_name() -> None:
    assert run(["render", str(SCENE), "--spp", "2", "--res", "12", "8"]) == 0
    assert files() == ["scene.exr"]


@pytest.mark.parametrize(
    ("flags", "code", "words"),
    [
        (["--product", "none"], "unknown-product", FRONT),
        (["--product", ""], "unknown-product", FRONT),
        (["--all-products", "--product", "side"], "product-output", "give one"),
        (["--all-products", "-o", "a.exr"], "product-output", "-o"),
        (["--all-products", "--report", "none/a.json"], "output-folder", "none"),
        (["--all-products", "--report", "a.json", "--frames", "1:2"], "frames", "a.json"),
        (["--product", "side", "--checkpoint", "a.prc"], "product-output", "products have no checkpoints"),
        (["--all-products", "--output-dir", "file/missing"], "output-folder", "missing"),
    ],
)
def test_what_cannot_be_had_is_said_before_rendering(
    flags: list[str], code: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("file").touch()  # no folder can be made below it
    assert run(["render", str(SCENE), *flags]) == 2
    said = capsys.readouterr().err
    assert code in said
    assert words in said
    assert files() == ["file"]


def test_a_name_with_a_frame_needs_frames(capsys: pytest.CaptureFixture[str]) -> None:
    stage = Usd.Stage.Open(str(SCENE))
    stage.GetPrimAtPath(FRONT).GetAttribute("productName").Set("a/b/shot.$F4.exr")
    stage.GetRootLayer().Export("numbered.usda")
    assert run(["render", "numbered.usda", "--product", "front", "--spp", "2"]) == 2
    assert "--frames" in capsys.readouterr().err
    assert run(["render", "numbered.usda", "--product", "front", "--spp", "2", "-f", "7"]) == 0
    assert files() == ["a/b/shot.0007.exr", "numbered.usda"]


@pytest.mark.parametrize("flags", [["--all-products"], ["-o", "front.exr", "-o", "side.png", "--report", "r.json"]])
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_an_interrupt_before_the_first_sample_replaces_no_file(
    flags: list[str], number: signal.Signals, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from primray.sampling.sampling import Sampling

    begin, before = Sampling.begin, {"front.exr": b"earlier", "side.png": b"earlier"}

    def interrupted(*arguments: Any) -> Any:
        signal.raise_signal(number)
        return begin(*arguments)

    for name, data in before.items():
        Path(name).write_bytes(data)
    monkeypatch.setattr(Sampling, "begin", staticmethod(interrupted))
    handlers = {each: signal.getsignal(each) for each in (signal.SIGTERM, signal.SIGINT)}
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell may have left it ignored
    try:
        assert run(["render", str(SCENE), "--spp", "2", *flags]) == 130
    finally:
        for each, handler in handlers.items():
            signal.signal(each, handler)
    assert {name: Path(name).read_bytes() for name in files()} == before
    assert "no picture was written" in capsys.readouterr().err
