"""No output of a command takes the place of a file that it reads, whichever option names it."""

from __future__ import annotations

import os
import re
from inspect import signature
from pathlib import Path
from typing import Any

import pytest
import typer

from primray.cli import run
from primray.cli.app import app
from primray.cli.kept_inputs import READ, WRITTEN, check_outputs
from primray.errors import SettingsError

SAYS_WRITTEN = re.compile(r"\b(write|draw|writes|trace)\b", re.IGNORECASE)


def test_every_option_that_writes_a_file_is_known() -> None:
    unknown: dict[str, str] = {}
    for command in app.registered_commands:
        assert command.callback is not None
        for name, parameter in signature(command.callback, eval_str=True).parameters.items():
            for info in getattr(parameter.annotation, "__metadata__", ()):
                is_file = isinstance(info, typer.models.OptionInfo) and info.metavar == "FILE"
                if is_file and SAYS_WRITTEN.search(info.help or "") and name not in {*WRITTEN, *READ}:
                    unknown[name] = info.help or ""
    assert not unknown


FOLDERS = ("output_dir", "texture_cache", "source", "keep", "folder", "inputs")
OTHERS = ("resume", "label_table", "flags", "base")  # files that are read and written by design; what names no file


def test_every_option_and_argument_that_names_a_file_is_known() -> None:
    unknown = set()
    for command in app.registered_commands:
        assert command.callback is not None
        for name, parameter in signature(command.callback, eval_str=True).parameters.items():
            for info in getattr(parameter.annotation, "__metadata__", ()):
                is_argument = isinstance(info, typer.models.ArgumentInfo)
                if is_argument or any(word in (getattr(info, "metavar", None) or "") for word in ("FILE", "DIR")):
                    unknown |= {name} - {*READ, *WRITTEN, *FOLDERS, *OTHERS}
    assert not unknown


@pytest.mark.parametrize(
    "line",
    [
        ["explain", "shot.usda", "--pixel", "1", "1", "--report", "./shot.usda"],
        ["explain", "shot.usda", "--pixel", "1", "1", "--layer", "link.usda"],
        ["render", "shot.usda", "-o", "a.png", "--report", "shot.usda"],
        ["render", "shot.usda", "-o", "a.png", "--no-adaptive", "--report=shot.usda"],
        ["render", "shot.usda", "-o", "a.png", "--profile", "shot.usda"],
        ["relight", "shot.exr", "--report", "shot.exr"],
        ["relight", "shot.exr", "--layer", "shot.usda", "--stage", "shot.usda"],
        ["relight", "shot.exr", "--fit", "photo.exr", "-o", "photo.exr"],
        ["pin", "shot.usda", "--lock", "shot.usda"],
        ["render", "shot.usda", "--dome", "photo.exr", "-o", "photo.exr"],
        ["render", "shot.usda", "--background", "photo.exr", "-o", "photo.exr"],
        ["explain", "shot.usda", "--pixel", "1", "1", "--session-layer", "photo.exr", "--layer", "photo.exr"],
        ["lidar", "shot.usda", "--pattern", "photo.exr", "-o", "photo.exr"],
        ["sensor", "shot.exr", "-o", "shot.exr"],
        ["compare", "shot.exr", "photo.exr", "--report", "photo.exr"],
    ],
)
def test_inputs_are_kept(line: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("shot.usda", "shot.exr", "photo.exr"):
        Path(name).write_text(name)
    Path("link.usda").symlink_to("shot.usda")
    assert run(line) == 2
    assert "output-folder: the output would overwrite a file that the command reads" in capsys.readouterr().err
    assert [Path(name).read_text() for name in ("shot.usda", "shot.exr", "photo.exr")] == ["shot.usda", "shot.exr", "photo.exr"]


def test_two_outputs_have_two_names() -> None:
    with pytest.raises(SettingsError, match="named twice") as caught:
        check_outputs({"scene": "shot.usda", "report": "a/../x.json", "layer": "x.json"})
    assert caught.value.code == "output-name"
    check_outputs({"scene": "shot.usda", "outputs": ["a.exr", "a.png"], "report": None, "layer": "x.json"})
    check_outputs({"scene": "shot.usda", "report": os.devnull, "layer": os.devnull})
