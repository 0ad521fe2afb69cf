"""Names of files with places that are filled in: tiles, frames; layers of files; nodes of time; nodes with several files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from pxr import Usd
from tests.unit.usd.material_text import Codes, material

from primray.description import Pattern, SceneDescription, TextureFile, TextureInput
from primray.description.shading import pattern_files
from primray.settings import RenderSettings
from primray.usd import translate
from primray.usd.materials.materialx.filename_tokens import Frames, frames_of, with_frame

_OF_THE_STAGE = ("camera-automatic", "primvar-missing", "default-light")
EMISSION = "color3f inputs:emission_color.connect = </m/t.outputs:out>"


def unlit(node: str, inputs: str) -> str:
    text = f'def Shader "t" {{\n uniform token info:id = "{node}"\n {inputs}\n color3f outputs:out\n}}\n'
    return material(EMISSION, text, shader="ND_surface_unlit")


def translated(folder: Path, text: str, frame: float | None = None, head: str = "") -> tuple[SceneDescription, Codes]:
    path = folder / "a.usda"
    path.write_text(f"#usda 1.0\n{head}\n{text}")
    description, found = translate(Usd.Stage.Open(str(path)), RenderSettings(time_code=frame))
    return description, [(d.code, d.message) for d in found if d.code not in _OF_THE_STAGE]


def write(folder: Path, *names: str) -> None:
    for name in names:
        oiio.ImageBuf(np.ones((1, 1, 3), np.float32)).write(str(folder / name), "uint8")


def file_of(description: SceneDescription) -> TextureFile:
    made = dict(description.surfaces[0].inputs)["emissive_color"]
    assert isinstance(made, TextureInput)
    return made.file


@pytest.mark.parametrize(
    ("names", "said"),
    [(("t_u1_v1.png", "t_u2_v1.png", "t_u1_v2.png"), "t_<UVTILE>.png"), (("t_u1_v1.png", "t_u10_v10.png"), "t<UVTILE>.png")],
)
def test_tiles_by_mudbox_names(names: tuple[str, ...], said: str, tmp_path: Path) -> None:
    write(tmp_path, *names)
    description, found = translated(tmp_path, unlit("ND_image_color3", f"asset inputs:file = @./{said}@"))
    numbers = {"u1_v1": 1001, "u2_v1": 1002, "u1_v2": 1011, "u10_v10": 1100}
    expected = {(numbers[name[2:-4]], str(tmp_path / name)) for name in names}
    assert set(file_of(description).tiles) == expected
    assert found == []
    _, found = translated(tmp_path, unlit("ND_image_color3", "asset inputs:file = @./none_<UVTILE>.png@"))
    assert [code for code, _ in found] == ["asset-missing"]


@pytest.mark.parametrize(("frame", "name"), [(7, "s.007.png"), (7.75, "s.007.png"), (12, "s.012.png")])
def test_the_file_of_a_frame(frame: float, name: str, tmp_path: Path) -> None:
    write(tmp_path, "s.007.png", "s.012.png")
    node = unlit("ND_image_color3", "asset inputs:file = @./s.{03frame}.png@")
    description, found = translated(tmp_path, node, frame)
    assert (file_of(description).path, found) == (str(tmp_path / name), [])


def test_a_frame_beyond_the_range_ends_as_the_node_says(tmp_path: Path) -> None:
    write(tmp_path, "s.1.png", "s.3.png")
    said = 'asset inputs:file = @./s.{frame}.png@\n string inputs:framerange = "1-3"\n color3f inputs:default = (1, 0, 0)'
    description, _ = translated(tmp_path, unlit("ND_image_color3", said), 9.0)
    assert (description.surfaces[0].inputs, description.surfaces[0].emissive_color) == ((), (1, 0, 0))
    said += '\n string inputs:frameendaction = "clamp"'
    assert file_of(translated(tmp_path, unlit("ND_image_color3", said), 9.0)[0]).path == str(tmp_path / "s.3.png")
    said += "\n int inputs:frameoffset = -8"
    assert file_of(translated(tmp_path, unlit("ND_image_color3", said), 9.0)[0]).path == str(tmp_path / "s.1.png")


def test_ends_of_a_range() -> None:
    first, last = frames_of("10-12") or (0, 0)
    shown = {end: [Frames(first, last, 0, end).number(f) for f in range(7, 17)] for end in ("clamp", "periodic", "mirror")}
    assert shown["clamp"] == [10, 10, 10, 10, 11, 12, 12, 12, 12, 12]
    assert shown["periodic"] == [10, 11, 12, 10, 11, 12, 10, 11, 12, 10]
    assert shown["mirror"] == [12, 11, 10, 10, 11, 12, 12, 11, 10, 10]
    assert Frames(first, last, 2, "constant").number(11) is None
    assert (frames_of("x"), with_frame("a.{04frame}.{frame}.png", 7)) == (None, "a.0007.7.png")


def test_each_projection_has_its_own_file_and_layer(tmp_path: Path) -> None:
    write(tmp_path, "x.png", "y.png", "z.png")
    said = "\n".join(f'asset inputs:file{a} = @./{a}.png@\n string inputs:layer{a} = "of {a}"' for a in "xyz")
    description, found = translated(tmp_path, unlit("ND_triplanarprojection_color3", said))
    pattern = description.surfaces[0].pattern
    assert isinstance(pattern, Pattern)
    assert {(Path(f.path).name, f.layer) for f in pattern_files(pattern)} == {(f"{a}.png", f"of {a}") for a in "xyz"}
    assert found == []


def test_a_layer_of_a_plain_image_needs_no_pattern(tmp_path: Path) -> None:
    write(tmp_path, "x.png")
    description, _ = translated(
        tmp_path, unlit("ND_image_color3", 'asset inputs:file = @./x.png@\n string inputs:layer = "diff"')
    )
    assert file_of(description).layer == "diff"
    assert description.surfaces[0].pattern is None


TIME = """
def Material "m" {
    token outputs:surface.connect = </m/s.outputs:surface>
    def Shader "s" { uniform token info:id = "ND_surface_unlit"
        float inputs:emission.connect = </m/t.outputs:out>
        color3f inputs:emission_color = (1, 1, 1)
        token outputs:surface
    }
    def Shader "t" { uniform token info:id = "ND_%s_float"
        float outputs:out
    }
}
def Sphere "ball" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    rel material:binding = </m>
}
"""
RATE = "(\n timeCodesPerSecond = 10\n)"


@pytest.mark.parametrize(("kind", "fps"), [("time", 10.0), ("frame", None)])
def test_seconds_are_those_of_the_stage(kind: str, fps: float | None, tmp_path: Path) -> None:
    description, found = translated(tmp_path, TIME % kind, 5.0, RATE)
    pattern = description.surfaces[0].pattern
    assert pattern is not None
    node = next(node for node in pattern.nodes if node.category == kind)
    assert dict(node.inputs).get("fps") == (None if fps is None else (fps,))
    assert found == []


def test_time_without_a_frame_or_with_an_open_shutter_is_reported(tmp_path: Path) -> None:
    assert [code for code, _ in translated(tmp_path, TIME % "time", None, RATE)[1]] == ["shader-parameter"]
    camera = 'def Camera "c" {\n double shutter:open = 0\n double shutter:close = 0.5\n}\n'
    moving = 'def Sphere "moving" {\n double3 xformOp:translate.timeSamples = { 1: (0, 0, 0), 9: (9, 0, 0) }\n'
    moving += ' uniform token[] xformOpOrder = ["xformOp:translate"]\n}\n'
    _, found = translated(tmp_path, TIME % "time" + camera + moving, 5.0, RATE)
    assert "material-input" in [code for code, _ in found]


def test_names_of_files_that_nodes_hand_on(tmp_path: Path) -> None:
    write(tmp_path, "x.png")
    told = {}
    for kind, name in (
        ("ND_constant_filename", "value"), ("ND_dot_filename", "in"), ("ND_UsdPrimvarReader_filename", "fallback"),
        ("UsdPrimvarReader_string", "fallback"), ("ND_geompropvalueuniform_filename", "default"),
    ):  # fmt: skip
        said = f"string inputs:{name} = '{tmp_path}/x.png'" if "string" in kind else f"asset inputs:{name} = @./x.png@"
        said += "" if name in ("value", "in") else '\n string inputs:varname = "label"\n string inputs:geomprop = "label"'
        text = f'def Shader "f" {{\n uniform token info:id = "{kind}"\n {said}\n asset outputs:out\n}}\n'
        nodes = 'def Shader "t" {\n uniform token info:id = "ND_image_color3"\n'
        nodes += "asset inputs:file.connect = </m/f.outputs:out>\n color3f outputs:out\n}\n"
        description, found = translated(tmp_path, material(EMISSION, nodes + text, shader="ND_surface_unlit"))
        assert file_of(description).path == str(tmp_path / "x.png")
        told[kind] = [message for code, message in found if code == "shader-ignored"]
    assert all(not messages for kind, messages in told.items() if kind in ("ND_constant_filename", "ND_dot_filename"))
    primvars = [messages for kind, messages in told.items() if kind not in ("ND_constant_filename", "ND_dot_filename")]
    assert all(len(m) == 1 and "'label'" in m[0] and "x.png'" in m[0] for m in primvars)
