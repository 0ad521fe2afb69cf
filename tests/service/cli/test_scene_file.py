"""What is sent for a scene: as it is, or packed so that every path leads to the same file."""

from __future__ import annotations

import os
import zipfile
from pathlib import Path

import pytest

from primray import usd
from primray_service.cli.exits import CommandError
from primray_service.cli.scene_file import SceneFile, scene_file, with_images


def write(file: Path, text: str = "content") -> Path:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text)
    return file


def scene_of(file: Path, *asset_paths: str) -> Path:
    assets = "\n".join(f" asset a{n} = @{path}@" for n, path in enumerate(asset_paths))
    return write(file, f'#usda 1.0\n(defaultPrim = "A")\ndef "A" {{\n{assets}\n}}\n')


@pytest.fixture
def show(tmp_path: Path) -> Path:
    return tmp_path / "show"


@pytest.fixture
def scratch(tmp_path: Path) -> Path:
    folder = tmp_path / "scratch"
    folder.mkdir()
    return folder


def members(sent: SceneFile) -> list[str]:
    with zipfile.ZipFile(sent.path) as package:
        return package.namelist()


def unpacked(sent: SceneFile, folder: Path) -> Path:
    """The root layer as the server finds it."""
    assert sent.entry is not None
    with zipfile.ZipFile(sent.path) as package:
        package.extractall(folder)
    return folder / sent.entry


def test_a_file_that_refers_to_none_is_sent_as_it_is(show: Path, scratch: Path) -> None:
    scene = scene_of(show / "shot.usda")
    assert scene_file(scene, scratch) == SceneFile(scene, "shot.usda", None, 1, [])


def test_packages_are_sent_as_they_are(show: Path, scratch: Path) -> None:
    for name in ("a.usdz", "b.ZIP"):
        package = write(show / name, "not even a zip: the server says so")
        assert scene_file(package, scratch) == SceneFile(package, name)


def test_files_beside_and_below_are_packed(show: Path, scratch: Path, tmp_path: Path) -> None:
    write(show / "tex/wood.png", "wood")
    scene_of(show / "lib.usda", "./tex/wood.png")
    scene = write(show / "shot.usda", "#usda 1.0\n(subLayers = [@./lib.usda@])\n")
    write(show / "not_named.png")
    sent = scene_file(scene, scratch)
    assert (sent.name, sent.entry, sent.files, sent.notes) == ("shot.zip", "shot.usda", 3, [])
    assert set(sent.members or ()) == {"lib.usda", "shot.usda", "tex/wood.png"}
    assert not sent.path.exists()
    sent.write()
    assert members(sent) == ["lib.usda", "shot.usda", "tex/wood.png"]
    root = unpacked(sent, tmp_path / "server")
    assert usd.dependencies(str(root)).missing == ()
    assert root.read_bytes() == scene.read_bytes()


def test_files_above_keep_their_places_and_are_told(show: Path, scratch: Path, tmp_path: Path) -> None:
    write(show / "tex/wood.png", "wood")
    scene = scene_of(show / "shots/010/shot.usda", "../../tex/wood.png")
    sent = scene_file(scene, scratch)
    assert sent.entry == "shots/010/shot.usda"
    sent.write()
    assert members(sent) == ["shots/010/shot.usda", "tex/wood.png"]
    assert sent.notes == ["../../tex/wood.png: is outside the scene's folder; it is sent as well"]
    assert usd.dependencies(str(unpacked(sent, tmp_path / "server"))).missing == ()


def test_absolute_paths_are_rewritten_in_a_usdz(show: Path, scratch: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    wood = write(show / "elsewhere/wood.png", "wood")
    scene = scene_of(show / "shots/shot.usda", str(wood))
    monkeypatch.chdir(show)
    sent = scene_file(scene, scratch)
    assert (sent.name, sent.entry, sent.files) == ("shot.usdz", None, 2)
    assert sent.notes == [
        f"{wood} (in shots/shot.usda): is a path of this machine; the scene is sent as a usdz with rewritten paths"
    ]
    found = usd.dependencies(str(sent.path))
    assert found.files == (str(sent.path),)
    assert found.missing == found.fixed == ()
    assert scene.read_text().count(str(wood)) == 1  # the user's file is left alone


def test_missing_files_are_told_and_not_too_many(show: Path, scratch: Path) -> None:
    scene = scene_of(show / "shot.usda", *[f"./lost{n:02}.png" for n in range(14)])
    notes = scene_file(scene, scratch).notes
    assert len(notes) == 11
    assert notes[0].endswith("lost00.png: not found; the render will report it as missing")
    assert notes[-1] == "... and 4 more"


def test_images_of_settings_are_sent_with_whatever_is_sent(show: Path, scratch: Path, tmp_path: Path) -> None:
    """A stage alone becomes a package; an image of the scene is not sent twice, and no file takes another's place."""
    sky, plate = write(tmp_path / "sky.exr", "sky"), write(tmp_path / "b/sky.exr", "plate")
    images = {"dome": sky, "background": plate}
    alone = scene_of(show / "shot.usda")
    for scene in (alone, write(show / "model.usdz", "not even a zip")):
        sent, names = with_images(scene_file(scene, scratch), scratch, images)
        assert names == {"dome": "dome/sky.exr", "background": "background/sky.exr"}
        assert (sent.entry, sent.files) == (scene.name, 3)
        sent.write()
        assert members(sent) == sorted([scene.name, *names.values()])
        assert sent.path.parent == scratch
    write(show / "dome/sky.exr", "another")
    write(show / "tex/plate.exr", "plate")
    scene = scene_of(show / "other.usda", "./dome/sky.exr", "./tex/plate.exr")
    sent, names = with_images(scene_file(scene, scratch), scratch, {"dome": sky, "background": show / "tex/plate.exr"})
    assert names == {"dome": "dome_/sky.exr", "background": "tex/plate.exr"}
    assert sent.members is not None
    assert sent.members["dome/sky.exr"].read_text() == "another"
    assert len(sent.members) == 4
    as_it_is = scene_file(scene, scratch)
    assert with_images(as_it_is, scratch, {"background": show / "tex/plate.exr"})[0] is as_it_is
    with pytest.raises(CommandError) as refused:
        with_images(as_it_is, scratch, {"dome": tmp_path / "none.exr"})
    assert refused.value.where == str(tmp_path / "none.exr")


def package_of(scene: Path, scratch: Path) -> bytes:
    sent = scene_file(scene, scratch)
    sent.write()
    return sent.path.read_bytes()


@pytest.mark.parametrize("absolute", [False, True])
def test_equal_files_make_equal_packages(show: Path, scratch: Path, absolute: bool) -> None:
    """At other times, too: a package that the server has is not sent again."""
    wood = write(show / "tex/wood.png", "wood")
    scene_of(show / "lib.usda", str(wood) if absolute else "./tex/wood.png")
    scene = write(show / "shot.usda", "#usda 1.0\n(subLayers = [@./lib.usda@])\n")
    first = package_of(scene, scratch)
    for file in (scene, wood):
        os.utime(file, (1_500_000_000, 1_500_000_000))
    other = scratch / "other"
    other.mkdir()
    assert package_of(scene, other) == first


def test_what_cannot_be_read_is_said(show: Path, scratch: Path) -> None:
    with pytest.raises(CommandError, match="no such file") as caught:
        scene_file(show / "none.usda", scratch)
    assert caught.value.exit_code == 3
