"""Command lines that are read without Typer: the same as Typer reads, or left to it."""

from __future__ import annotations

import inspect
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command

from primray.cli.app import app, with_options
from primray.cli.commands.render import render
from primray.cli.quick import TABLE, render_arguments

LINES = [
    "render s.usd",
    "render s.usd x.exr",
    "render s.usd -o x.exr -o y.png --spp 16 --res 640 360",
    "render -j 2 --seed 7 s.usd --frames 1:10x2 x.####.exr --json --verbose",
    "render s.usd --pixel-samples 4 -w 100 -c /cam --time-limit 2.5 --target-error 1e-3 --max-depth 3",
    "render s.usd -V --no-default-light --no-translated-shaders --aov depth --aov normal --report r.json --checkpoint c.ckpt",
    "render s.usd --frame 7",
    "render s.usd --spp=16 --filter=gaussian --mask=/a=b --frames=1:3 -o x.####.exr",
    "render s.usd --filter box --filter-width 1 --exposure 1.5 --error-metric display --adaptive --dicing-rate 2 --strict",
    "render s.usd --no-adaptive --view Raw --display sRGB --look none --rendering-color-space lin_ap1_scene --max-memory 4G",
    "render s.usd --variant /a:v=x --variant /b:v=y --no-payloads --purposes default,render --session-layer s.usda",
    "render s.usd -rs /r --product a --product b --all-products --output-dir out --load /a --load /b",
    "render s.usd --auto-camera usdrecord",
    "render s.usd --stereo --diffusion 0.1 --diffusion-glare=0.3 --diffusion-starburst 0",
    "render s.usd --shutter 0 0.5 --motion-error 0.25",
    "render s.usd --disable-motionblur",
    "render s.usd --region 0 0.25 0.5 1",
    "render s.usd --aov albedo --aov-errors",
    "render s.usd --denoise --stop-at denoised --target-error 0.01 --bit-depth 16 --half rgba --half depth",
    "render s.usd --ray head:6379 --target-error 0.01",
    "render s.usd --sample-range 0:4 --checkpoint-every 5 --resume c.ckpt",
]
LEFT_TO_TYPER = [
    "",
    "inspect s.usd",
    "render",
    "render --help",
    "render s.usd --spp=",
    "render s.usd --json=yes",
    "render s.usd --res=640 360",
    "render s.usd --filter Box",
    "render s.usd --new-option 1",
    "render s.usd --spp many",
    "render s.usd --spp -1",
    "render s.usd --spp",
    "render s.usd -o",
    "render s.usd -o --json",
    "render s.usd --res 640",
    "render s.usd -j2",
    "render s.usd --exposure -1",
    "render -- s.usd",
    "render a b c",
    "render --json",
    "render s.usd --time-limit nan",
    "render s.usd --shutter -0.5 0.5",
]


def _typer() -> Any:
    commands: Any = get_command(app)
    return commands.get_command(None, "render")


@pytest.mark.parametrize("line", LINES)
def test_values_are_those_that_typer_reads(line: str) -> None:
    arguments = render_arguments(line.split())
    parameters = inspect.signature(with_options("render", render)).parameters
    defaults = {name: p.default for name, p in parameters.items() if p.default is not p.empty}
    assert arguments is not None
    params = _typer().make_context("render", line.split()[1:]).params
    lists = {p.name for p in _typer().params if getattr(p, "multiple", False)}
    # A list comes as a tuple from the parser; Typer hands on a list, or None for an empty one.
    read = {name: (list(value) or None) if name in lists and value is not None else value for name, value in params.items()}
    assert defaults | arguments == read


@pytest.mark.parametrize("line", LEFT_TO_TYPER)
def test_what_is_wrong_or_unusual_is_typers(line: str) -> None:
    assert render_arguments(line.split()) is None


def test_every_option_is_in_the_table_with_all_its_flags() -> None:
    options = {p.name: sorted((*p.opts, *p.secondary_opts)) for p in _typer().params if p.opts[0].startswith("-")}
    assert {name: sorted(flags) for name, (_, flags) in TABLE.items()} == {n: f for n, f in options.items() if n != "help"}


def test_empty_words_are_typers() -> None:
    assert render_arguments(["render", ""]) is None
    assert render_arguments(["render", "s.usd", "-o", ""]) is None


HEAVY = [
    "PyOpenColorIO",
    "argparse",
    "click",
    "importlib.metadata",
    "primray.cli.app",
    "primray.cli.commands.compare",
    "primray.checkpoints.checkpoint_file",
    "primray.compare.comparison",
    "pydantic",
    "rich",
    "typer",
]


def test_a_render_imports_nothing_that_it_does_not_use(tmp_path: Path) -> None:
    """A picture of one sample, from the first line of the console script to its last."""
    (tmp_path / "s.usda").write_text('#usda 1.0\ndef Sphere "s" {}\n')
    ends = f"import atexit, sys; atexit.register(lambda: print([m for m in {HEAVY} if m in sys.modules]))"
    line = [sys.executable, "-c", f"{ends}; from primray.cli import main; main()", "render", "s.usda", "-o", "x.exr"]
    done = subprocess.run([*line, "--spp", "1", "--res", "8", "8"], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"
    assert (tmp_path / "x.exr").exists()


def _cpu_s(arguments: list[str], folder: Path) -> float:
    """The least of three, user and system: what else the machine does counts little."""
    least = float("inf")
    for _ in range(3):
        before = os.times()
        subprocess.run([sys.executable, *arguments], cwd=folder, capture_output=True, check=True)
        after = os.times()
        spent = (after.children_user + after.children_system) - (before.children_user + before.children_system)
        least = min(least, spent)
    return least


@pytest.mark.long
def test_starting_takes_little_more_than_what_it_must_import(tmp_path: Path) -> None:
    (tmp_path / "s.usda").write_text('#usda 1.0\ndef Sphere "s" {}\n')
    must = "import numpy, OpenImageIO; from pxr import Sdf, Tf, Usd, UsdGeom, UsdLux, UsdRender, UsdShade, UsdSkel, UsdUtils"
    floor = _cpu_s(["-c", must], tmp_path)
    line = ["-c", "from primray.cli import main; main()", "render", "s.usda", "-o", "x.exr", "--spp", "1", "--res", "8", "8"]
    assert _cpu_s(line, tmp_path) < 2.2 * floor
