"""Files of other formats: the command line and the library say what they are and what converts them, in the same words."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest

import primray
from primray.cli import run
from primray.errors import StageOpenError
from primray.file_formats import advice_for

CONVERTER = "uvx --python 3.12 usd-convert-asset -i {0} -o {1} --preview-surface"
HEADS = {
    "a.glb": b"glTF\x02\0\0\0",
    "a.gltf": b'{"asset": {"version": "2.0"}}',
    "a.fbx": b"Kaydara FBX Binary  \0",
    "a.obj": b"v 0 0 0\n",
    "a.stl": b"solid a\n",
    "a.ply": b"ply\nformat ascii 1.0\n",
    "a.abc": b"Ogawa\xff\0\1",
    "a.blend": b"BLENDER-v405",
    "a.ma": b"//Maya ASCII 2026 scene",
    "a.hip": b"\0\0",
    "a.vdb": b" BDV",
}


@pytest.mark.parametrize("name", HEADS)
def test_the_command_line_and_the_library_say_what_to_do(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / name
    path.write_bytes(HEADS[name])
    advice = advice_for(name)
    assert advice is not None
    for arguments in (["render", str(path), "-o", str(tmp_path / "a.exr")], ["inspect", str(path)]):
        assert run(arguments) == 3
        assert capsys.readouterr().err == f"error: stage-format: {advice} [{path}]\n"
    with pytest.raises(StageOpenError) as error:
        primray.render(path)
    assert (error.value.code, error.value.message, error.value.where) == ("stage-format", advice, str(path))


@pytest.mark.parametrize("suffix", ["glb", "gltf", "fbx", "obj", "stl", "ply"])
def test_the_converter_has_the_names_as_a_shell_takes_them(suffix: str) -> None:
    advice = advice_for(f"models/it's.{suffix}")
    assert advice is not None
    quoted = [shlex.quote(name) for name in (f"it's.{suffix}", "it's.usdz")]
    assert advice.endswith(f"To convert it, in its folder: {CONVERTER.format(*quoted)}")
    assert advice_for(f"-x.{suffix}", b"") == advice.replace(quoted[0], f"./-x.{suffix}").replace(quoted[1], "./-x.usdz")


def test_blender_s_script_is_python_and_one_word() -> None:
    for name in ("it's.abc", "it's.blend"):
        advice = advice_for(name)
        assert advice is not None
        words = shlex.split(advice.partition("folder: ")[2])
        assert words[:2] == ["blender", "--background"]
        compile(words[-1], name, "exec")
        assert 'usd_export(filepath="it\'s.usdc")' in words[-1]
        assert (words[2] == name) is name.endswith("blend")


@pytest.mark.parametrize(
    ("name", "head", "called"),
    [
        ("a.usd", b"glTF\x02", "glTF"),
        ("", b"glTF\x02", "glTF"),
        ("a.obj", b"ply\n", "PLY"),
        ("a.GLB", b"", "glTF"),
        ("a.json", b'{"scene": 0, "asset": {}}', "glTF"),
    ],
)
def test_bytes_count_for_more_than_names(name: str, head: bytes, called: str) -> None:
    advice = advice_for(name, head)
    assert advice is not None
    assert advice.startswith(f"It is {called}, not USD.")


@pytest.mark.parametrize(("name", "head"), [("a.usda", b"#usda 1.0"), ("a.txt", b"text"), ("", b""), ("a.json", b'{"a": 1}')])
def test_other_files_have_no_advice(name: str, head: bytes) -> None:
    assert advice_for(name, head) is None


def test_a_stage_that_refers_to_one_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "ball.glb").write_bytes(HEADS["a.glb"])
    path = tmp_path / "shot.usda"
    path.write_text('#usda 1.0\ndef "ball" (\n references = [@./ball.glb@, @./none.obj@]\n)\n{\n}\ndef Sphere "s"\n{\n}\n')
    assert run(["inspect", str(path)]) == 0
    said = capsys.readouterr()
    text = " ".join((said.out + said.err).split())
    assert f"ball.glb: {advice_for('ball.glb')}" in text
    assert "none.usdz" not in text
