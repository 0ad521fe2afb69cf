"""`primray sensor`: a picture as a camera's sensor reads it, with its noise, as a raw file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ...errors import SettingsError

if TYPE_CHECKING:
    from ...sensor.model import SensorModel


def sensor(
    picture: Annotated[str | None, typer.Argument(metavar="[PICTURE]", help="A rendered EXR.", show_default=False)] = None,
    outputs: Annotated[
        list[str] | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="Raw file: .dng, or the numbers as .png (16 bits), .tif, .npy.",
            show_default="none",
        ),
    ] = None,
    model: Annotated[
        str | None,
        typer.Option("--model", "-m", metavar="FILE", help="The sensor, as JSON.", show_default="30,000 electrons, 14 bits"),
    ] = None,
    changes: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="NAME=VALUE",
            help="A field of the sensor, such as read_noise=2; may be repeated.",
            show_default=False,
        ),
    ] = None,
    frame: Annotated[int, typer.Option("--frame", metavar="N", help="Which frame's noise to draw.")] = 0,
    electrons: Annotated[
        float | None,
        typer.Option(
            "--electrons", metavar="N", help="Print the RMSE of a picture with an error of N electrons.", show_default=False
        ),
    ] = None,
    report: Annotated[
        str | None, typer.Option(metavar="FILE", help="Write model and findings as JSON.", show_default=False)
    ] = None,
    verbose: Annotated[bool, typer.Option("--verbose", "-V", help="Print tracebacks of errors.")] = False,
) -> None:
    """Write what a sensor reads of a picture: shot noise, read noise, a colour filter array, saturation, whole numbers."""
    from ...images.image import write_text
    from ...images.output_path import check_folder
    from ...images.reading import read_image
    from ..console import dumps

    chosen = _model(model, changes or [])
    if electrons is not None:
        print(f"--target-error {chosen.error_of(electrons):.6g} --metric rmse")
    if picture is None:
        if electrons is None:
            raise SettingsError("name a picture, or --electrons for the error to render with", code="sensor")
        return
    if report is not None:
        check_folder(Path(report))
    if frame < 0:
        raise SettingsError("the frame must be 0 or more", where="--frame", code="sensor")
    raw = chosen.expose(read_image(picture), frame)
    for path in outputs or ():
        raw.save(path)
    clipped = float((raw.values == chosen.white_level).mean())
    facts: dict[str, Any] = {
        "picture": picture,
        "model": chosen.as_json(),
        "frame": frame,
        "electrons_per_unit": chosen.electrons_per_unit,
        "gain": chosen.gain,
        "render_share": raw.render_share,
        "saturated_share": clipped,
        "negative_share": raw.negative_share,
    }
    if report is not None:
        write_text(Path(report), dumps(facts, indent=2) + "\n")
    print("\n".join(_lines(facts)))


def _model(file: str | None, changes: list[str]) -> SensorModel:
    import json

    from ...sensor.model import SensorModel

    values = {} if file is None else SensorModel.read(file).as_json()
    for text in changes:
        name, equals, value = text.partition("=")
        if not equals:
            raise SettingsError(f"--set takes NAME=VALUE, not {text!r}", where="--set", code="sensor")
        try:
            values[name] = json.loads(value)
        except ValueError:
            values[name] = value
    return SensorModel.of(values)


def _lines(facts: dict[str, Any]) -> list[str]:
    from ...sensor.model import SMALL_SHARE

    lines = [f"a value of 1 is {facts['electrons_per_unit']:.5g} electrons, {facts['gain']:.4g} numbers each"]
    share = facts["render_share"]
    if share is None:
        lines.append("the picture says no errors: how much of the noise is the render's is not known")
    else:
        advice = "" if share <= SMALL_SHARE else ": render with more samples for noise that is the sensor's alone"
        lines.append(f"the render's own noise is {share:.2%} of the sensor's variance{advice}")
    if facts["saturated_share"]:
        lines.append(f"{facts['saturated_share']:.2%} of the pixels are saturated")
    if facts["negative_share"]:
        lines.append(f"{facts['negative_share']:.2%} of the pixels have negative colours behind the filters, read as none")
    return lines
