"""`primray doctor`: checks of this machine, and reasons why a stage comes out slow, grey, dark or empty."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from ...settings import RenderSettings
from .. import option_values
from ..flags import CONTENTS, FRAMES, LIGHTING, REFUSAL, SIZE, SURFACES, VIEWPOINT, frames_in, in_order, setting_values


@in_order(
    *("scene", "pilot_seconds", *VIEWPOINT, *SIZE, *FRAMES, "max_depth", "threads", "rendering_color_space"),
    *(*LIGHTING, *CONTENTS, *SURFACES, "lens_flaws", "json", "verbose", *REFUSAL),
)
def doctor(
    scene: Annotated[
        str | None,
        typer.Argument(
            metavar="[SCENE]", help="The USD stage to examine; without it, only the machine is checked.", show_default=False
        ),
    ] = None,
    pilot_seconds: float = 3.0,
    json: bool = False,
    verbose: bool = False,
    **given: Any,
) -> None:
    """Check this machine; with a SCENE, render for a few seconds and explain why it is slow, grey, dark or empty."""
    if scene is None:
        _machine(json)
        return
    time_code = option_values.one_frame_of(frames_in(given, scene), "doctor")
    settings = RenderSettings(**setting_values(given), time_code=time_code)
    _stage(scene, settings, pilot_seconds, json, verbose)


def _machine(as_json: bool) -> None:
    from ...diagnosis.machine import check_machine
    from ..console import print_line

    found = check_machine()
    if as_json:
        print_line({"type": "machine", "checks": [check.as_json() for check in found]})
    else:
        for check in found:
            text = check.found.replace("\n", f"\n{'':9}")
            print(f"{check.name:8} {'' if check.works else 'FAILED: '}{text}")
    if not all(check.works for check in found):
        raise typer.Exit(1)


def _stage(scene: str, settings: RenderSettings, seconds: float, as_json: bool, verbose: bool) -> None:
    from ...diagnosis.doctor import diagnose, lines
    from ..console import print_line

    facts = diagnose(scene, settings, seconds).as_json()
    if as_json:
        print_line(facts)
    else:
        print("\n".join(lines(facts, verbose)))
