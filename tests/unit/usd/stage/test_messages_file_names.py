"""Files in messages go by the user's names, wherever the stage lies and however it was named."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from pxr import Usd

from primray.diagnostics import Diagnostics
from primray.errors import PrimrayError
from primray.usd import open_stage
from primray.usd.stage.messages import FileNames

HEAD = '#usda 1.0\n(\n    defaultPrim = "a"\n)\n'
BROKEN = f'{HEAD}def Xform "a"\n{{\n    double radius = = 3\n}}\n'
REFERRING = f'{HEAD}def "a" (references = @b.usda@)\n{{\n}}\n'
PARSE_ERROR = "Expected } at 'double radius = = 3' in </a>"


def texts(source: object) -> list[str]:
    """Of all diagnostics, or of the error."""
    diagnostics = Diagnostics()
    try:
        open_stage(source, diagnostics)  # type: ignore[arg-type]
    except PrimrayError as error:
        return [error.message]
    return [d.message for d in diagnostics]


def write(folder: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)


# The stage is shots/shot.usda.
SAID = {
    "a broken root": ({"shots/shot.usda": BROKEN}, f"USD cannot open it: shot.usda:7:5: {PARSE_ERROR}"),
    "a broken sublayer": (
        {"shots/shot.usda": "#usda 1.0\n(\n subLayers = [@sets/bad.usda@]\n)\n", "shots/sets/bad.usda": BROKEN},
        f"Could not load sublayer @sets/bad.usda@ of layer @shot.usda@ -- sets/bad.usda:7:5: {PARSE_ERROR}; skipping.",
    ),
    "a broken reference beside": (
        {"shots/shot.usda": f'{HEAD}def "a" (references = @../sets/bad.usda@)\n{{\n}}\n', "sets/bad.usda": BROKEN},
        "Could not open asset @../sets/bad.usda@ for reference introduced by @shot.usda@</a> -- "
        f"../sets/bad.usda:7:5: {PARSE_ERROR}.",
    ),
    "a missing payload": (
        {"shots/shot.usda": f'{HEAD}def "a" (payload = @no.usda@)\n{{\n}}\n'},
        "Could not open asset @no.usda@ for payload introduced by @shot.usda@</a>.",
    ),
    "an unknown format": (
        {"shots/shot.usda": f'{HEAD}def "a" (references = @x.xyz@)\n{{\n}}\n', "shots/x.xyz": "x"},
        "Could not open asset @x.xyz@ for reference introduced by @shot.usda@</a> -- Cannot determine file format for @x.xyz@.",
    ),
    "a cycle": (
        {"shots/shot.usda": REFERRING, "shots/b.usda": REFERRING.replace("b.usda", "shot.usda")},
        "Cycle detected: @shot.usda@</a> references: @b.usda@</a> which references: @shot.usda@</a> which CANNOT reference: "
        "@b.usda@</a>",
    ),
    "other units": (
        {"shots/shot.usda": REFERRING, "shots/b.usda": HEAD.replace(")", "    metersPerUnit = 3\n)") + 'def "a"\n{\n}\n'},
        "metersPerUnit is 3.0 in b.usda, 0.01 in the stage.",
    ),
}


@pytest.mark.parametrize("given", ["absolute", "relative", "through a link", "opened"])
@pytest.mark.parametrize("name", SAID)
def test_the_same_words_wherever_it_lies(name: str, given: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files, said = SAID[name]
    (tmp_path / "real").mkdir()
    write(tmp_path / "real", files)
    (tmp_path / "link").symlink_to("real")
    monkeypatch.chdir(tmp_path / "real")
    path = {"relative": "shots/shot.usda", "through a link": str(tmp_path / "link/shots/shot.usda")}.get(
        given, str(tmp_path / "real/shots/shot.usda")
    )
    if given == "opened" and name == "a broken root":
        pytest.skip("skipped: there is no such stage")
    found = texts(Usd.Stage.Open(path) if given == "opened" else path)
    assert said in found
    assert not any(str(tmp_path) in text or "anon:" in text for text in found)


def test_layers_in_memory_have_their_own_names() -> None:
    stage = Usd.Stage.CreateInMemory("made.usda")
    stage.DefinePrim("/a").GetReferences().AddReference("no.usda")
    [said] = texts(stage)
    assert said == "Could not open asset @no.usda@ for reference introduced by @made.usda@</a>."


def test_only_whole_paths_are_names(tmp_path: Path) -> None:
    names = FileNames(str(tmp_path / "a/shot.usda"))
    parent = tmp_path.name
    assert names.in_text(f"@{tmp_path}/a/x.usda@ </a/x.usda> {tmp_path}/b.png") == "@x.usda@ </a/x.usda> ../b.png"
    assert names.in_text(f"/other{tmp_path}/a/x.usda") == f"/other{tmp_path}/a/x.usda"
    assert names.in_text(f"{tmp_path.parent}/c.png") == "../../c.png"
    assert names.in_text(f"{tmp_path}/a.png and /{parent}/c") == f"../a.png and /{parent}/c"
    assert FileNames("shot.usda").in_text(f"{os.getcwd()}/x.usda") == "x.usda"
