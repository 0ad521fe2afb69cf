"""Thumbnails: whole processes, and where their pictures go; nothing is left behind by what fails."""

from __future__ import annotations

import configparser
import hashlib
import os
import shlex
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import OpenImageIO as oiio
import pytest
from pxr import Usd, UsdMedia
from tests.sanitized import limits_memory

from primray.cli import run, thumbnail_renders
from primray.cli.thumbnail_renders import _reduced, cache_files, uri_of
from primray.version import __version__

ROOT = Path(__file__).parents[4]
HEAD = '#usda 1.0\n(\n    defaultPrim = "s"\n)\n'
BALL = HEAD + 'def Sphere "s"\n{\n color3f[] primvars:displayColor = [(1, 0.5, 0)]\n}\n'
CAMERA = """def Camera "c"
{
    float horizontalAperture = 10
    float verticalAperture = 40
    double3 xformOp:translate = (0, 0, %d)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
FEW = ("--spp", "2", "--timeout", "600")

pytestmark = limits_memory


def read(path: Path) -> np.ndarray:
    buffer = oiio.ImageBuf(str(path))
    assert buffer.spec().format == oiio.UINT8
    return np.asarray(buffer.get_pixels(oiio.UINT8))


def files(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def test_pictures_beside_the_asset(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asset = tmp_path / "ball.usda"
    asset.write_text(BALL)
    assert run(["thumbnail", str(asset), "-s", "48", "-s", "20", *FEW]) == 0
    assert files(tmp_path) == {"ball.usda", "thumbs/ball.usda.48.png", "thumbs/ball.usda.20.png"}
    assert asset.read_text() == BALL
    assert capsys.readouterr().out.split() == [str(tmp_path / f"thumbs/ball.usda.{size}.png") for size in (48, 20)]
    for size in (48, 20):
        picture = read(tmp_path / f"thumbs/ball.usda.{size}.png")
        assert picture.shape == (size, size, 4)
        covered = picture[..., 3] > 128
        # The frame shows all of the ball, which is not small in it: its margin is 6 % of the frame on each side.
        assert not covered[0].any()
        assert not covered[:, 0].any()
        assert covered.any(axis=0).sum() > 0.8 * size
        assert (picture[covered][:, 0] > picture[covered][:, 2]).mean() > 0.9  # orange


def test_output_of_any_name_and_backgrounds(tmp_path: Path) -> None:
    asset = tmp_path / "ball.usda"
    asset.write_text(BALL)
    out = tmp_path / "out"
    assert run(["thumbnail", str(asset), str(out), "-s", "16", "--background", "neutral", *FEW]) == 0
    assert out.read_bytes().startswith(b"\x89PNG")
    picture = read(out)
    assert (picture[..., 3] == 255).all() if picture.shape[2] == 4 else True
    assert np.abs(picture[0, 0, :3].astype(int) - 0xC8).max() <= 1
    assert files(tmp_path) == {"ball.usda", "out"}


def test_the_camera_of_the_stage_gives_the_frame(tmp_path: Path) -> None:
    asset = tmp_path / "ball.usda"
    asset.write_text(BALL + CAMERA % 10)
    assert run(["thumbnail", str(asset), str(tmp_path / "a.png"), "-s", "40", *FEW]) == 0
    assert read(tmp_path / "a.png").shape[:2] == (40, 10)


def test_the_asset_names_its_picture(tmp_path: Path) -> None:
    asset = tmp_path / "ball.usda"
    asset.write_text(BALL)
    asset.chmod(0o640)
    assert run(["thumbnail", str(asset), "--author", "-s", "16", "-s", "8", *FEW]) == 0
    assert files(tmp_path) == {"ball.usda", "thumbs/ball.usda.16.png", "thumbs/ball.usda.8.png"}
    stage = Usd.Stage.Open(str(asset))
    found = UsdMedia.AssetPreviewsAPI(stage.GetDefaultPrim()).GetDefaultThumbnails().defaultImage
    assert Path(found.resolvedPath) == tmp_path / "thumbs/ball.usda.16.png"
    assert asset.stat().st_mode & 0o777 == 0o640


def test_the_cache_of_file_browsers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    asset = tmp_path / "a ball (1) \u00e9.usda"
    asset.write_text(BALL)
    assert run(["thumbnail", str(asset), "--cache", "-s", "128", *FEW]) == 0
    uri = uri_of(asset)
    assert uri.endswith("/a%20ball%20(1)%20%C3%A9.usda")
    name = hashlib.md5(uri.encode()).hexdigest()
    made = tmp_path / f"cache/thumbnails/normal/{name}.png"
    assert files(tmp_path / "cache") == {f"thumbnails/normal/{name}.png"}
    assert made.stat().st_mode & 0o777 == 0o600
    spec = oiio.ImageBuf(str(made)).spec()
    assert spec.getattribute("Thumb::URI") == uri
    assert spec.getattribute("Thumb::MTime") == str(int(asset.stat().st_mtime))
    chunk = b"tEXtThumb::URI\0" + uri.encode()
    assert chunk in made.read_bytes()


def test_the_cache_records_what_cannot_be_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    asset = tmp_path / "a.usda"
    asset.write_text(HEAD + 'def Xform "s" {}\n')
    command = ["thumbnail", str(asset), "--cache", "-s", "128", *FEW]
    assert run([*command, "--purposes", "guide"]) == 3  # another purpose may show something
    assert files(tmp_path / "cache") == set()
    assert run(command) == 3
    (name,) = files(tmp_path / "cache")
    assert name == f"thumbnails/fail/primray-{__version__}/{hashlib.md5(uri_of(asset).encode()).hexdigest()}.png"
    file = tmp_path / "cache" / name
    assert file.stat().st_mode & 0o777 == 0o600
    spec = oiio.ImageBuf(str(file)).spec()
    assert (spec.width, spec.height) == (1, 1)
    assert spec.getattribute("Thumb::URI") == uri_of(asset)
    assert spec.getattribute("Thumb::MTime") == str(int(asset.stat().st_mtime))

    rendered: list[object] = []
    monkeypatch.setattr(thumbnail_renders, "render_thumbnails", lambda *asked: rendered.append(asked))
    capsys.readouterr()
    assert run(command) == 3
    assert rendered == []
    said = capsys.readouterr().err
    assert "error: failed-before: it could not be made before (no" in said
    assert str(file) in said
    monkeypatch.undo()

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    asset.write_text(BALL)
    os.utime(asset, (1e9, 1e9))
    assert run(command) == 0
    assert [Path(each).parent.name for each in files(tmp_path / "cache")] == ["normal"]  # and no failure any more


def test_uris_are_glibs() -> None:
    """As g_filename_to_uri writes them, by whose MD5 file browsers look for thumbnails."""
    assert uri_of(Path("/a/!$&'()*+,-.:=@_~;?#[]%\".usd")) == "file:///a/!$&'()*+,-.:=@_~%3B%3F%23%5B%5D%25%22.usd"
    with pytest.raises(Exception, match="the sizes 128, 256, 512, 1024, not 100"):
        cache_files(Path("a.usd"), [100])


@pytest.mark.parametrize(
    ("text", "arguments", "code", "says"),
    [
        ("no stage", [], 3, "stage-open"),
        (HEAD, [], 3, "no-geometry|nothing-seen"),
        (BALL + CAMERA % -9, [], 3, "nothing-seen"),
        (BALL.replace(HEAD, "#usda 1.0\n"), ["--author"], 3, "asset-preview"),
        (BALL, ["--timeout", "0.05"], 4, "time-limit"),
        (BALL, ["--max-memory", "60M"], 4, "memory-limit"),
        (BALL, ["--size", "0"], 2, "thumbnail"),
        (BALL, ["--spp", "0"], 2, "thumbnail"),
        (BALL, ["--camera", "none"], 2, "unknown-camera"),
        (BALL, ["--background", "#12"], 2, ""),
        (BALL, ["--cache", "--size", "100"], 2, "thumbnail"),
        (BALL, ["--cache", "--author"], 2, "thumbnail"),
        (BALL, ["--frames", "1:2"], 2, "frames"),
    ],
)
def test_what_fails_leaves_nothing(
    text: str, arguments: list[str], code: int, says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    asset = tmp_path / "a.usda"
    asset.write_text(text)
    assert run(["thumbnail", str(asset), *FEW, *arguments]) == code
    said = capsys.readouterr()
    assert any(f"error: {each}" in said.err for each in says.split("|"))
    assert said.out == ""
    assert files(tmp_path) == {"a.usda"}
    assert asset.read_text() == text


def test_an_asset_that_is_not_there_and_an_output_without_a_folder(tmp_path: Path) -> None:
    assert run(["thumbnail", str(tmp_path / "none.usda")]) == 3
    (tmp_path / "a.usda").write_text(BALL)
    assert run(["thumbnail", str(tmp_path / "a.usda"), str(tmp_path / "no/out.png")]) == 2
    assert run(["thumbnail", str(tmp_path / "a.usda"), str(tmp_path / "o.png"), "-s", "8", "-s", "9"]) == 2


def test_a_folder_is_no_asset_and_a_thumbnail_no_jpeg(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asset = tmp_path / "ball.usda"
    asset.write_text(BALL)
    assert run(["thumbnail", str(tmp_path)]) == 3
    assert "it is a folder: `primray sheet FOLDER`" in capsys.readouterr().err
    assert run(["thumbnail", str(asset), str(tmp_path / "ball.JPG")]) == 2
    assert "thumbnails are PNG files" in capsys.readouterr().err
    assert files(tmp_path) == {"ball.usda"}


def test_a_process_that_crashes_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    (tmp_path / "a.usda").write_text(BALL)
    monkeypatch.setattr(thumbnail_renders, "_MAIN", "import os, sys; {limit}; os.kill(os.getpid(), 11)")
    assert run(["thumbnail", str(tmp_path / "a.usda")]) == 1
    assert "its process ended with -11" in capsys.readouterr().err
    assert files(tmp_path) == {"a.usda"}


def test_smaller_sizes_are_means_weighted_by_coverage() -> None:
    shown = np.zeros((4, 8, 4), np.uint8)
    shown[:, ::2] = (200, 100, 0, 255)  # every other column is transparent
    small = _reduced(shown, 4)
    assert small.shape == (2, 4, 4)
    assert (np.abs(small.astype(int) - (200, 100, 0, 128)) <= 1).all()


def test_the_entry_for_file_browsers_is_a_command_line(tmp_path: Path) -> None:
    entry = configparser.ConfigParser(interpolation=None)
    entry.optionxform = str  # type: ignore[assignment, method-assign]
    entry.read(ROOT / "contrib/thumbnailer/primray.thumbnailer")
    section = entry["Thumbnailer Entry"]
    asset, out = tmp_path / "a ball.usda", tmp_path / "no-suffix"
    asset.write_text(BALL)
    places = {"%s": "32", "%i": str(asset), "%o": str(out)}
    words = [places.get(word, word) for word in shlex.split(section["Exec"])]
    assert words[0] == section["TryExec"] == "primray"
    at = words.index("--timeout") + 1
    assert float(words[at]) <= 30  # browsers wait for it
    words[at] = "600"  # how fast this machine is is another question
    assert run(words[1:]) == 0
    assert read(out).shape[:2] == (32, 32)
    names = {"mime": "http://www.freedesktop.org/standards/shared-mime-info"}
    types = ElementTree.parse(ROOT / "contrib/thumbnailer/primray-usd.xml").findall("mime:mime-type", names)
    assert {each.get("type") for each in types} == set(section["MimeType"].rstrip(";").split(";"))
    globs = {
        each.get("pattern")
        for each in ElementTree.parse(ROOT / "contrib/thumbnailer/primray-usd.xml").iter()
        if each.get("pattern")
    }
    assert globs == {"*.usd", "*.usda", "*.usdc", "*.usdz"}
