"""Every file of a stage, wherever it is named; which paths lead there only on this machine."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest

from primray.errors import StageOpenError
from primray.usd import dependencies, write_usdz


def write(file: Path, text: str) -> str:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text if text.startswith("#usda") or not file.suffix.startswith(".usd") else f"#usda 1.0\n{text}")
    return str(file)


def names(found: tuple[str, ...], below: Path) -> list[str]:
    return [str(Path(file).relative_to(below)) for file in found]


@pytest.fixture
def show(tmp_path: Path) -> Path:
    write(
        tmp_path / "lib/tree.usda",
        '(defaultPrim = "T")\ndef "T" {\n asset a = @./bark.<UDIM>.png@\n asset b = @../ies/x.ies@\n}\n',
    )
    for name in (
        "lib/bark.1001.png",
        "lib/bark.1012.png",
        "ies/x.ies",
        "lib/not_named.png",
        "shot/hidden.usda",
    ):
        write(tmp_path / name, "content" if not name.endswith(".usda") else "")
    write(tmp_path / "lib/computed.usda", '(defaultPrim = "B")\ndef "B" {\n}\n')
    write(tmp_path / "shot/sub.usda", "")
    write(
        tmp_path / "shot/shot.usda",
        """(subLayers = [@./sub.usda@]
            expressionVariables = { string WHICH = "computed" })
        def "A" (references = @../lib/tree.usda@) {
            asset lost = @./lost.png@
            variantSet "v" = { "off" { } "on" ( payload = @./hidden.usda@ ) { } }
        }
        def "B" (references = @`"../lib/${WHICH}.usda"`@) {
        }
        """,
    )
    return tmp_path


def test_what_is_named_anywhere_is_found(show: Path) -> None:
    found = dependencies(str(show / "shot/shot.usda"))
    assert names(found.files, show) == [
        "shot/shot.usda",
        "ies/x.ies",
        "lib/bark.1001.png",
        "lib/bark.1012.png",
        "lib/computed.usda",
        "lib/tree.usda",
        "shot/hidden.usda",
        "shot/sub.usda",
    ]
    assert [Path(path).name for path in found.missing] == ["lost.png"]
    assert found.fixed == ()


def test_absolute_and_searched_paths_are_told(show: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    outside = write(show / "elsewhere/wood.png", "")
    root = write(show / "shot/fixed.usda", f'def "A" {{\n asset a = @{outside}@\n asset b = @sub.usda@\n}}\n')
    found = dependencies(root)
    assert found.fixed == ((root, outside),)
    assert outside in found.files


def test_a_package_leads_to_itself(show: Path, tmp_path: Path) -> None:
    outside = write(show / "elsewhere/wood.png", "wood")
    root = write(show / "shot/fixed.usda", f'(subLayers = [@../lib/tree.usda@])\ndef "A" {{\n asset a = @{outside}@\n}}\n')
    target = tmp_path / "out.usdz"
    write_usdz(root, str(target))
    found = dependencies(str(target))
    assert found.files == (str(target),)
    assert found.missing == found.fixed == ()
    with zipfile.ZipFile(target) as members:
        held = members.namelist()
        assert held[0] == "fixed.usda"
        assert {Path(name).name for name in held} >= {"wood.png", "tree.usda", "bark.1001.png", "bark.1012.png", "x.ies"}


def test_a_stage_that_cannot_be_read_is_said_so(tmp_path: Path) -> None:
    broken = write(tmp_path / "broken.usda", "#usda 1.0\ndef {")
    for path in (broken, str(tmp_path / "none.usda")):
        with pytest.raises(StageOpenError):
            dependencies(path)
    with pytest.raises(StageOpenError):
        write_usdz(broken, str(tmp_path / "out.usdz"))


PLACES = [
    ("t.<UDIM>.png", ["t.1001.png", "t.1010.png", "t.1100.png"], ["t.1101.png", "t.left.png"]),
    ("t.<UVTILE>.png", ["t.u1_v1.png", "t._u2_v1.png"], ["t.u0_v1.png", "t.1001.png"]),
    ("t.{frame}.png", ["t.7.png", "t.1001.png"], ["t.left.png"]),
    ("t.{04frame}.<UVTILE>.png", ["t.0007.u1_v1.png"], ["t.0007.png"]),
]


@pytest.mark.parametrize(("name", "there", "others"), PLACES)
@pytest.mark.parametrize("document", [False, True])
def test_names_with_places_stand_for_all_files_that_textures_read(
    name: str, there: list[str], others: list[str], document: bool, tmp_path: Path
) -> None:
    """USD itself knows <UDIM> alone; documents of MaterialX and layers are read by one rule."""
    for file in (*there, *others):
        write(tmp_path / "maps" / file, "")
    if document:
        value = name.replace("<", "&lt;").replace(">", "&gt;")
        image = f'<image name="i" type="color3"><input name="file" type="filename" value="maps/{value}"/></image>'
        write(tmp_path / "m.mtlx", f'<materialx version="1.39">{image}</materialx>')
    root = write(
        tmp_path / "a.usda",
        'def "A" (references = @m.mtlx@) {\n}\n' if document else f'def "A" {{\n asset a = @maps/{name}@\n}}\n',
    )
    found = dependencies(root)
    assert [Path(file).name for file in found.files if "maps" in file] == sorted(there)
    assert not [text for text in found.missing if "maps" in text]
