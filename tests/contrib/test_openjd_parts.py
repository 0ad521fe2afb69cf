"""contrib/openjd/parts: as OpenJD's own program reads and runs it, and its scripts with a stand-in for primray."""

from __future__ import annotations

from pathlib import Path

import pytest

import primray
from primray import RenderSettings

from .openjd import ROOT, check_parameters, document, openjd, parameters, run_script

TEMPLATE = ROOT / "contrib/openjd/parts/template.yaml"
SCENE = ROOT / "scenes/analytic/furnace_half.usda"
SHOWN = """printf '[%s]' "$@"; echo"""


def test_a_frame_that_was_cut_has_the_bits_of_one_render(tmp_path: Path) -> None:
    openjd("check", TEMPLATE)
    asked = [
        f"Scene={SCENE}",
        "Frames=2",
        f"OutputFolder={tmp_path / 'it is'}",
        "Aovs=depth",
        "Cryptomattes=object",
        "Width=32",
        "Height=32",
        "Samples=10",
        "Parts=2",
    ]
    openjd("run", TEMPLATE, "--step", "Merge", "--run-dependencies", *parameters(*asked))
    assert sorted(path.name for path in (tmp_path / "it is").iterdir()) == ["beauty.0002.exr"]
    direct = primray.render(SCENE, RenderSettings(resolution=(32, 32), spp=10, time_code=2.0))
    merged = primray.read_image(tmp_path / "it is/beauty.0002.exr")
    assert (merged.pixels == direct.pixels).all()
    assert set(merged.aovs) == {"depth", "crypto_object"}


def test_its_parameters_are_described_and_used() -> None:
    check_parameters(TEMPLATE)
    render, merge = document(TEMPLATE)["steps"]
    frame, part = render["parameterSpace"]["taskParameterDefinitions"]
    assert merge["parameterSpace"]["taskParameterDefinitions"] == [frame]
    assert (frame["range"], part["range"]) == ("{{Param.Frames}}", "1-{{Param.Parts}}")
    assert merge["dependencies"] == [{"dependsOn": render["name"]}]


@pytest.mark.parametrize(("samples", "parts"), [(2, 1), (14, 3), (1024, 8), (6, 3), (10, 5)])
def test_the_parts_are_all_samples_once(samples: int, parts: int, tmp_path: Path) -> None:
    ends = [0]
    for part in range(1, parts + 1):
        process = run_script(
            TEMPLATE, 0, tmp_path, SHOWN, Scene="a.usda", Samples=str(samples), Parts=str(parts), Task_Param_Part=str(part),
            Task_Param_Frame="7",
        )  # fmt: skip
        out, _ = process.communicate(timeout=20)
        begin, end = map(int, out.partition("[--sample-range][")[2].partition("]")[0].split(":"))
        assert begin == ends[-1]
        assert begin < end
        assert end % 2 == 0
        ends.append(end)
    assert ends[-1] == samples


@pytest.mark.parametrize(("samples", "parts"), [("15", "3"), ("4", "3")])
def test_samples_that_cannot_be_divided_are_told(samples: str, parts: str, tmp_path: Path) -> None:
    values = {"Samples": samples, "Parts": parts, "Task_Param_Part": "1", "Task_Param_Frame": "7"}
    process = run_script(TEMPLATE, 0, tmp_path, "exit 0", Scene="a.usda", **values)
    out, _ = process.communicate(timeout=20)
    assert process.returncode == 2
    assert out == f"openjd_fail: Samples has to be even and at least twice Parts: {samples}, {parts}\n"


def test_the_scripts_pass_what_was_asked_for(tmp_path: Path) -> None:
    values = {"OutputFolder": "out put", "Parts": "2", "Task_Param_Frame": "7"}
    scene = {"Scene": 'it\'s "a" $(scene).usda', "Camera": "/cam", "Width": "640", "Samples": "8", "Threads": "2"}
    point = "out put/parts/beauty______exr.7.2-of-2.prc"
    begin = f'[render][it\'s "a" $(scene).usda][-o][{tmp_path}/part.exr][--frames][7][--sample-range][4:8][--json][--aov][none]'
    for resumed in ("", f"[--resume][{point}]"):
        out, _ = run_script(TEMPLATE, 0, tmp_path, SHOWN, **values, **scene, Task_Param_Part="2").communicate(timeout=20)
        assert out == f"{begin}[--camera][/cam][--res][640][0][--threads][2][--checkpoint][{point}]{resumed}\n"
        (tmp_path / point).touch()
    asked = {"Aovs": "depth", "LightGroups": "key", "Variants": "/a:b=c", "ExtraArguments": "--strict"}
    out, _ = run_script(TEMPLATE, 0, tmp_path, SHOWN, **values, **scene, **asked, Task_Param_Part="2").communicate(timeout=20)
    assert "[--json][--aov][depth][--aov][C.*<L.'key'>][--variant][/a:b=c][--camera]" in out
    assert out.endswith("[--strict]\n")
    out, _ = run_script(TEMPLATE, 1, tmp_path, SHOWN, **values).communicate(timeout=20)
    assert out == f"[merge][{point.replace('2-of', '1-of')}][{point}][-o][out put/beauty.####.exr]\n"
    assert not (tmp_path / "out put/parts").exists()


@pytest.mark.parametrize("step", [0, 1])
def test_a_failure_is_told_and_leaves_the_parts(step: int, tmp_path: Path) -> None:
    (tmp_path / "pictures/parts").mkdir(parents=True)
    part = tmp_path / "pictures/parts/beauty______exr.7.1-of-1.prc"
    part.touch()
    values = {"Scene": "a.usda", "Parts": "1", "Task_Param_Part": "1", "Task_Param_Frame": "7"}
    process = run_script(TEMPLATE, step, tmp_path, "exit 3", **values)
    out, _ = process.communicate(timeout=20)
    assert process.returncode == 3
    assert "openjd_fail: primray ended with 3" in out
    assert part.exists()
