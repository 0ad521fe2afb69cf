"""contrib/openjd: the template as OpenJD's own program reads and runs it, and its script with a stand-in for primray."""

from __future__ import annotations

import signal
import subprocess
import time
from pathlib import Path

import pytest

import primray

from .openjd import ROOT, check_parameters, document, openjd, parameters, run_script
from .shot import write_shot

TEMPLATE = ROOT / "contrib/openjd/usd-render.yaml"


def test_openjd_accepts_and_runs_it(tmp_path: Path) -> None:
    openjd("check", TEMPLATE)
    scene = ROOT / "scenes/analytic/furnace_half.usda"
    asked = [f"Scene={scene}", "Frames=1-2", f"OutputFolder={tmp_path / 'it is'}", "Width=32", "Height=32", "MaxSamples=16"]
    openjd("run", TEMPLATE, *parameters(*asked))
    assert sorted(path.name for path in (tmp_path / "it is").iterdir()) == ["beauty.0001.exr", "beauty.0002.exr"]


def test_a_shot_with_outputs_variants_and_products(tmp_path: Path) -> None:
    """One small job of each kind, run by openjd: what the pictures hold is what was asked for."""
    scene = write_shot(tmp_path)
    asked = [f"Scene={scene}", "Frames=2", "Width=32", "MaxSamples=4", "Variants=/World/car:color=red"]
    outputs = ["Aovs=depth", "LightGroups=key", "Cryptomattes=object", "ExtraArguments=--metadata 'note=two words' --half none"]
    openjd("run", TEMPLATE, *parameters(*asked, *outputs, f"OutputFolder={tmp_path / 'whole'}"))
    picture = primray.read_image(tmp_path / "whole/beauty.0002.exr")
    assert set(picture.aovs) == {"depth", "crypto_object", "C.*<L.'key'>"}
    red, _, blue = picture.pixels[picture.pixels.shape[0] // 2, 16, :3]
    assert red > 2 * blue
    assert b"two words" in (tmp_path / "whole/beauty.0002.exr").read_bytes()
    openjd("run", TEMPLATE, *parameters(*asked, "Products=all", f"OutputFolder={tmp_path / 'products'}"))
    assert [path.name for path in (tmp_path / "products").iterdir()] == ["car.0002.exr"]


def test_its_parameters_are_described_and_used() -> None:
    check_parameters(TEMPLATE)
    (task,) = document(TEMPLATE)["steps"][0]["parameterSpace"]["taskParameterDefinitions"]
    assert task == {"name": "Frame", "type": "INT", "range": "{{Param.Frames}}"}


def run_whole(folder: Path, stand_in: str, **values: str) -> subprocess.Popen[str]:
    return run_script(TEMPLATE, 0, folder, stand_in, Task_Param_Frame="7", **values)


def test_the_script_passes_what_was_asked_for(tmp_path: Path) -> None:
    shown = """printf '[%s]' "$@"; echo; echo '{"type": "progress", "fraction": 0.425}'; echo 'other'"""
    name = {"Scene": 'it\'s "a" $(scene).usda', "OutputFolder": "out put"}
    process = run_whole(tmp_path, shown, **name, Camera="/cam", Width="640", TargetError="0.01", MaxSamples="8", Threads="2")
    out, _ = process.communicate(timeout=20)
    assert process.returncode == 0
    arguments = '[render][it\'s "a" $(scene).usda][-o][out put/beauty.####.exr][--frames][7][--json]'
    options = "[--camera][/cam][--res][640][0][--target-error][0.01][--spp][8][--threads][2]"
    assert sorted(out.splitlines()) == sorted([arguments + options, "openjd_progress: 42", "other"])
    assert (tmp_path / "out put").is_dir()


def test_outputs_variants_and_further_arguments(tmp_path: Path) -> None:
    asked = {"Aovs": "depth,C<RD>L", "LightGroups": "key, fill", "Cryptomattes": "object,material", "Denoise": "true"}
    more = """--view 'Un-tone-mapped' "a $b `c`" it\\'s --strict"""
    variants = "/World/car:color=red, /World/car:size=big"
    process = run_whole(
        tmp_path, """printf '[%s]' "$@"; echo""", Scene="a.usda", **asked, Variants=variants, ExtraArguments=more
    )
    out, _ = process.communicate(timeout=20)
    assert process.returncode == 0, out
    outputs = "[--aov][depth,C<RD>L][--aov][crypto_object][--aov][crypto_material][--aov][C.*<L.'key'>][--aov][C.*<L.'fill'>]"
    chosen = "[--variant][/World/car:color=red][--variant][/World/car:size=big][--denoise]"
    further = "[--view][Un-tone-mapped][a $b `c`][it's][--strict]"
    assert out == f"[render][a.usda][-o][pictures/beauty.####.exr][--frames][7][--json]{outputs}{chosen}{further}\n"


@pytest.mark.parametrize(
    ("products", "outputs"),
    [
        ("", "[-o][pictures/beauty.####.exr]"),
        ("all", "[--all-products][--output-dir][pictures]"),
        ("beauty, /Render/id", "[--output-dir][pictures][--product][beauty][--product][/Render/id]"),
    ],
)
def test_products_are_written_under_their_own_names(products: str, outputs: str, tmp_path: Path) -> None:
    process = run_whole(tmp_path, """printf '[%s]' "$@"; echo""", Scene="a.usda", Products=products)
    assert process.communicate(timeout=20)[0] == f"[render][a.usda]{outputs}[--frames][7][--json]\n"


@pytest.mark.parametrize("template", [TEMPLATE, ROOT / "contrib/openjd/parts/template.yaml"], ids=["frames", "parts"])
@pytest.mark.parametrize(
    ("name", "frames", "is_accepted"),
    [
        ("one.exr", "1-3", False),
        ("one.exr", "1,5", False),
        ("take#2/one.exr", "1-3", False),
        ("one.exr", "7", True),
        ("one.exr", " -7 ", True),
        ("a.$F4.exr", "1-3", True),
        ("a.<F>.exr", "1-3", True),
        ("a.%04d.exr", "1-3", True),
    ],
)
def test_a_name_for_several_frames_has_a_place_for_the_number(
    template: Path, name: str, frames: str, is_accepted: bool, tmp_path: Path
) -> None:
    asked = {"OutputName": name, "Frames": frames, "Task_Param_Frame": "7", "Task_Param_Part": "1"}
    process = run_script(template, 0, tmp_path, "echo rendered", Scene="a.usda", **asked)
    said = process.communicate(timeout=20)[0]
    assert (process.returncode, "rendered" in said) == ((0, True) if is_accepted else (2, False)), said
    assert is_accepted or said.startswith(f"openjd_fail: OutputName {name} has no placeholder for the frame's number")


def test_frames_of_products_without_a_place_are_all_there(tmp_path: Path) -> None:
    scene = write_shot(tmp_path)
    scene.write_text(scene.read_text().replace("car.$F4.exr", "car.exr"))
    asked = [f"Scene={scene}", "Frames=1-2", "Width=16", "MaxSamples=2", "Products=all", f"OutputFolder={tmp_path / 'out'}"]
    openjd("run", TEMPLATE, *parameters(*asked))
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["car.0001.exr", "car.0002.exr"]


def test_a_quote_that_is_not_closed_is_refused(tmp_path: Path) -> None:
    process = run_whole(tmp_path, "exit 9", Scene="a.usda", ExtraArguments="--view 'Raw")
    assert process.communicate(timeout=20)[0] == "openjd_fail: ExtraArguments has a quote that is not closed: --view 'Raw\n"
    assert process.returncode == 2


@pytest.mark.parametrize(
    ("code", "ends", "says"), [(0, 0, ""), (5, 0, "openjd_status: ended above"), (3, 3, "openjd_fail: primray ended with 3")]
)
def test_how_it_ends(tmp_path: Path, code: int, ends: int, says: str) -> None:
    process = run_whole(
        tmp_path, f"[[ $* == *--res* || $* == *--target* || $* == *--spp* ]] && exit 9; exit {code}", Scene="a.usda"
    )
    out, _ = process.communicate(timeout=20)
    assert process.returncode == ends
    assert says in out


def test_a_task_that_is_canceled_lets_the_renderer_save(tmp_path: Path) -> None:
    saving = """trap 'sleep 0.3; echo saved; exit 130' TERM; echo started; while :; do sleep 0.05; done"""
    process = run_whole(tmp_path, saving, Scene="a.usda")
    assert process.stdout is not None
    assert process.stdout.readline() == "started\n"
    begun = time.monotonic()
    process.send_signal(signal.SIGTERM)
    out, _ = process.communicate(timeout=20)
    assert time.monotonic() - begun < 10
    assert "saved" in out
    assert process.returncode == 130
