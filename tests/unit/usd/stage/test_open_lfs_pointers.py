"""A Git LFS pointer in place of a layer, texture or photometric file is called what it is, with what to do about it."""

from __future__ import annotations

from pathlib import Path

import pytest
from pxr import Usd

from primray.description import TextureFile
from primray.diagnostics import Diagnostics
from primray.errors import AssetError, StageOpenError
from primray.settings import RenderSettings
from primray.textures.texture import load_texture
from primray.usd import open_stage, translate

POINTER = f"version https://git-lfs.github.com/spec/v1\noid sha256:{'4d7a' * 16}\nsize 12345\n"
SAID = "Git LFS pointer, not the file: run git lfs pull"
LAYERS = ["p.usda", "p.usd", "p.usdc", "p.usdz"]


def pointer(folder: Path, name: str) -> str:
    (folder / name).write_text(POINTER)
    return str(folder / name)


@pytest.mark.parametrize("name", LAYERS)
def test_a_root_layer(tmp_path: Path, name: str) -> None:
    with pytest.raises(StageOpenError, match=SAID) as caught:
        open_stage(pointer(tmp_path, name), Diagnostics())
    assert caught.value.where == str(tmp_path / name)


@pytest.mark.parametrize("name", LAYERS)
@pytest.mark.parametrize("arc", ["references = @./NAME@", "payload = @./NAME@</x>", "SUBLAYER"])
def test_a_layer_that_another_brings(tmp_path: Path, name: str, arc: str) -> None:
    pointer(tmp_path, name)
    top = tmp_path / "top.usda"
    header = f"(\n    subLayers = [@./{name}@, @./absent.usda@]\n)\n" if arc == "SUBLAYER" else ""
    arc = "" if header else f"({arc.replace('NAME', name)})"
    top.write_text(f'#usda 1.0\n{header}def "a" {arc}\n{{\n}}\n')
    diagnostics = Diagnostics()
    open_stage(top, diagnostics)
    told = [d.message for d in diagnostics if d.code == "composition-error"]
    assert len([message for message in told if f"{name}: it is a {SAID}" in message and str(tmp_path) not in message]) == 1
    assert not [message for message in told if "absent" in message and SAID in message]


@pytest.mark.parametrize("name", ["p.exr", "p.png", "p.hdr", "p.tga", "p.jpg", "p.tif"])
def test_a_texture(tmp_path: Path, name: str) -> None:
    with pytest.raises(AssetError, match=SAID) as caught:
        load_texture(TextureFile(pointer(tmp_path, name), "auto"))
    assert (caught.value.code, caught.value.where) == ("texture-unreadable", str(tmp_path / name))


def test_a_damaged_texture_is_none(tmp_path: Path) -> None:
    (tmp_path / "p.png").write_text("version 1\n")
    with pytest.raises(AssetError, match="Not a PNG") as caught:
        load_texture(TextureFile(str(tmp_path / "p.png"), "auto"))
    assert SAID not in caught.value.message


def test_a_photometric_file(tmp_path: Path) -> None:
    path = pointer(tmp_path, "p.ies")
    stage = Usd.Stage.CreateInMemory()
    stage.GetRootLayer().ImportFromString(
        '#usda 1.0\ndef SphereLight "l" (prepend apiSchemas = ["ShapingAPI"])\n'
        f"{{\n    asset inputs:shaping:ies:file = @{path}@\n}}\n"
    )
    [told] = [d for d in translate(stage, RenderSettings())[1] if d.prim_path == "/l"]
    assert (told.code, told.attribute) == ("light-input", "inputs:shaping:ies:file")
    assert SAID in told.message
