"""Command lines with habits of other tools, and what they do."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from primray.cli import run
from primray.cli.foreign_command_lines import translate_foreign_flags
from primray.errors import SettingsError


@pytest.mark.parametrize(
    ("line", "plain"),
    [
        ("render s.usda", "render s.usda"),
        ("render s.usda --verbose", "render s.usda --verbose"),
        ("render --verbose s.usda", "render --verbose s.usda"),
        ("render s.usda --verbose 3 -o a.exr", "render s.usda --verbose -o a.exr"),
        ("render s.usda --verbose 2 -o a.exr", "render s.usda -o a.exr"),
        ("render s.usda --verbose=5", "render s.usda --verbose"),
        ("render -V CeT9 s.usda", "render -V s.usda"),
        ("render -Va2 s.usda", "render s.usda"),
        ("render -V5ae s.usda", "render --verbose s.usda"),
        ("render -V --json s.usda", "render -V --json s.usda"),
        ("render --verbose --no-mplay s.usda", "render --verbose s.usda"),
        ("render -r 640 360 s.usda", "render -r 640 360 s.usda"),
        ("render -rs /r s.usda -r 1 1", "render -rs /r s.usda -r 1 1"),
        ("render s.usda -- --renderer", "render s.usda -- --renderer"),
        ("render s.usda -r", "render s.usda -r"),
        ("compare --core a b", "compare --core a b"),
        ("--version", "--version"),
        ("", ""),
    ],
)
def test_what_the_parsers_read(line: str, plain: str) -> None:
    assert translate_foreign_flags(line.split()) == plain.split()


@pytest.mark.parametrize(
    "line", ["-RKarma", "-vx", "--renderer=Karma", "-V --renderer Karma", "-r --renderer", "--verbose=loud"]
)
def test_spellings_of_what_is_refused(line: str) -> None:
    with pytest.raises(SettingsError):
        translate_foreign_flags(["render", "s.usda", *line.split()])


SCENE = '#usda 1.0\ndef Sphere "s" {}\ndef Camera "one" {}\ndef "a" {\n def Camera "two" {}\n}\n'


@pytest.fixture
def scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    Path("s.usda").write_text(SCENE)
    return "s.usda"


def test_the_list_of_cameras(scene: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["render", scene, "--list-cameras"]) == 0
    assert capsys.readouterr().out == "/one\n/a/two\n"
    assert run(["render", scene, "--list-cameras", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"type": "cameras", "scene": "s.usda", "cameras": ["/one", "/a/two"]}
    assert [path.name for path in Path().iterdir()] == ["s.usda"]


@pytest.mark.parametrize(
    ("flags", "resolution"),
    [
        ("-w 100", [100, 50]),
        ("-w 100 --res-scale 50", [50, 25]),
        ("--res 64 32 -S 25", [16, 8]),
        ("-S 200 --res 0 10", [40, 20]),
        ("-S 0.1 -w 100", [1, 1]),
        ("-S 10", [96, 48]),
    ],
)
def test_the_resolutions_scale(scene: str, flags: str, resolution: list[int], capsys: pytest.CaptureFixture[str]) -> None:
    Path("s.usda").write_text(SCENE.replace('"one" {}', '"one" {\n float verticalAperture = 10.4775\n}'))
    assert run(["inspect", scene, "-c", "/one", "--json", *flags.split()]) == 0
    assert json.loads(capsys.readouterr().out)["camera"]["resolution"] == resolution


@pytest.mark.parametrize("scale", ["0", "nan", "1e300"])
def test_what_is_no_scale(scene: str, scale: str) -> None:
    assert run(["render", scene, "--res-scale", scale]) == 2


def test_a_scaled_picture_says_which_resolution_it_has(scene: str) -> None:
    assert run(["render", scene, "--res", "16", "8", "-S", "50", "--spp", "1", "--report", "r.json"]) == 0
    settings = json.loads(Path("r.json").read_text())["settings"]
    assert (settings["resolution"], settings["resolution_scale"]) == ([8, 4], 1.0)


def test_too_large_a_scale(scene: str) -> None:
    assert run(["inspect", scene, "--res", "1000", "1000", "-S", "100000"]) == 4
