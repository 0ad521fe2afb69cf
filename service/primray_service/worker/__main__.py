"""A worker that is started as a program: enters its sandbox, does its slow imports, and serves (serving.py).

Before its first chunk it renders a stage of one cube, which does whatever happens once in a process: libraries are loaded,
their plug-ins and configurations read, threads started, so that the first picture of a job is not late.
"""

from __future__ import annotations

import sys
from pathlib import Path

from ..sandbox import enter
from .channel import claim_stdout
from .serving import NICE, give_way, open_channel, serve

STAGE = '#usda 1.0\ndef Cube "cube" {\n}\n'


def main(arguments: list[str]) -> None:
    (kind,) = arguments
    messages = claim_stdout()
    give_way(NICE[kind])
    entered = enter((messages.fileno(),))
    channel = open_channel(entered, messages)
    warm_up(kind, entered.out / "tmp")
    serve(kind, entered, channel)


def warm_up(kind: str, folder: Path) -> None:
    """Warm up; `folder` is for files that are removed afterwards."""
    from primray import usd
    from primray.composition import Composition
    from primray.diagnostics import Diagnostics

    stage = folder / "warm.usda"
    stage.write_text(STAGE)
    if kind == "check":
        from . import check  # noqa: F401

        usd.open_stage(str(stage), Diagnostics(), Composition())
    else:
        _render(stage, folder)
    stage.unlink()


def _render(stage: Path, folder: Path) -> None:
    from primray import core
    from primray.render import render
    from primray.settings import RenderSettings

    from . import render_task  # noqa: F401

    core.build_digest()
    image = render(str(stage), RenderSettings(resolution=(16, 16), spp=2, threads=1))
    for name in ("warm.exr", "warm.png"):
        image.save(folder / name).unlink()


main(sys.argv[1:])
