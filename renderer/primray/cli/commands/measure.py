"""`primray measure`: illuminance, cylindrical illuminance and daylight factors at points and on grids, with their intervals."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ...errors import SettingsError
from ...settings import RenderSettings
from ..flags import in_order, setting_values

if TYPE_CHECKING:
    from ...light_meter.luminance import LuminancePicture
    from ...light_meter.measuring import Measurement
    from ...light_meter.meters import LightMeter, MeterGrid, Vector

SUFFIXES = (".csv", ".json", ".html")
MOST_LINES = 40  # readings that are printed; files have all
CODE = "light-meter"


@in_order("scene")
def measure(
    scene: str,
    points: Annotated[
        list[str] | None,
        typer.Option(
            "--at",
            metavar="[NAME=]X,Y,Z",
            help="Measure at a point of the world, in scene units; may be repeated.",
            show_default="the stage's meters",
        ),
    ] = None,
    facing: Annotated[
        str | None,
        typer.Option("--facing", metavar="X,Y,Z", help="Which way the points of --at look.", show_default="up"),
    ] = None,
    grids: Annotated[
        list[str] | None,
        typer.Option(
            "--grid",
            metavar="[NAME=]CORNER/ACROSS/ALONG",
            help="Measure on a rectangle: a corner and two sides, each X,Y,Z, with the points of EN 12464-1; may be repeated.",
            show_default=False,
        ),
    ] = None,
    cylindrical: Annotated[
        bool, typer.Option("--cylindrical", help="Measure cylindrical illuminance at the points of --at and --grid.")
    ] = False,
    meters: Annotated[
        str | None,
        typer.Option("--meters", metavar="FILE", help="Read points and grids from a JSON file.", show_default=False),
    ] = None,
    target: Annotated[
        float, typer.Option("--target", metavar="SHARE", help="Half of each reading's 95 % interval, over its value.")
    ] = 0.02,
    of_mean: Annotated[
        bool, typer.Option("--of-mean", help="Ask that of the mean of each grid alone, not of each point.")
    ] = False,
    simultaneous: Annotated[
        bool, typer.Option("--simultaneous", help="Widen the intervals so that all of them hold together with 95 %.")
    ] = False,
    daylight_factor: Annotated[
        bool,
        typer.Option("--daylight-factor", help="Measure daylight factors under the CIE's overcast sky; other lights are off."),
    ] = False,
    glare: Annotated[
        bool,
        typer.Option(
            "--glare", help="Rate the glare (DGP, UGR) that an eye at each point of --at gets that looks where --facing says."
        ),
    ] = False,
    maintenance_factor: Annotated[
        float, typer.Option("--maintenance-factor", metavar="SHARE", help="Light that is left after ageing.")
    ] = 1.0,
    outputs: Annotated[
        list[str] | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="Write the readings: .csv, .json, or .html to read and print; may be repeated.",
            show_default="none",
        ),
    ] = None,
    luminance: Annotated[
        list[str] | None,
        typer.Option(
            "--luminance",
            metavar="CAMERA",
            help="Add a false-colour picture of luminance (cd/m2) as a camera sees it to the page of -o NAME.html; all: of all "
            "cameras; may be repeated.",
            show_default="none",
        ),
    ] = None,
    frame: Annotated[
        float | None, typer.Option("--frame", metavar="T", help="Time code.", show_default="the stage's default time")
    ] = None,
    spp: Any = None,
    time_limit_s: Any = None,
    max_depth: Any = None,
    threads: Any = None,
    seed: Any = 0,
    variants: Any = None,
    no_payloads: Any = False,
    load: Any = None,
    mask: Any = None,
    session_layer: Any = None,
    purposes: Any = None,
    json: Annotated[bool, typer.Option("--json", help="Print a JSON line to stdout instead of text.")] = False,
    verbose: Any = False,
) -> None:
    """Measure light on a stage, in lux with 95 % intervals, at its light meters or at points that are given."""
    from ...diagnostic_messages import print_diagnostics
    from ...images.image import write_text
    from ...images.output_path import check_folder
    from ...light_meter.measuring import measure as measured
    from ...render.prepare import open_once
    from ..console import dumps, print_line

    for path in outputs or ():
        if Path(path).suffix.lower() not in SUFFIXES:
            raise SettingsError(f"readings are written as {', '.join(SUFFIXES)}, not {path}", where=path, code=CODE)
        check_folder(Path(path))
    given = _given(points or [], facing, grids or [], meters, is_cylindrical=cylindrical)
    flags = {
        "spp": spp,
        "time_limit_s": time_limit_s,
        "max_depth": max_depth,
        "threads": threads,
        "seed": seed,
        "variants": variants,
        "no_payloads": no_payloads,
        "load": load,
        "mask": mask,
        "session_layer": session_layer,
        "purposes": purposes,
    }
    settings = RenderSettings(**setting_values(flags), time_code=frame)
    if luminance and not any(Path(path).suffix.lower() == ".html" for path in outputs or ()):
        sentence = "pictures of luminance are on the page: write it with -o NAME.html"
        raise SettingsError(sentence, where="--luminance", code=CODE)
    if glare:
        others = {
            "--grid": grids,
            "--cylindrical": cylindrical,
            "--daylight-factor": daylight_factor,
            "--of-mean": of_mean,
            "--simultaneous": simultaneous,
            "--maintenance-factor": maintenance_factor != 1,
            "--luminance": luminance,
        }
        for flag, is_set in others.items():
            if is_set:
                raise SettingsError(f"--glare and {flag} are two measurements: make them apart", where=flag, code=CODE)
        _rate_glare(scene, given, settings, target, outputs or [], json=json)
        return
    opened = open_once(scene, settings)
    pictures = []
    if luminance:
        from ...light_meter.luminance import luminance_pictures

        pictures = luminance_pictures(opened, luminance, replace(settings, spp=None, time_limit_s=None))
    found = measured(
        opened,
        given,
        settings,
        target=target,
        of_mean=of_mean,
        simultaneous=simultaneous,
        daylight_factor=daylight_factor,
        maintenance_factor=maintenance_factor,
    )
    print_diagnostics(found.report["diagnostics"], verbose=verbose)
    facts = {"stage": scene, **found.as_json()}
    for path in outputs or ():
        write_text(Path(path), _text_of(found, facts, pictures, Path(path).suffix.lower(), dumps))
    if json:
        print_line(facts)
    else:
        print("\n".join(_lines(found)))


def _given(
    points: list[str], facing: str | None, grids: list[str], file: str | None, *, is_cylindrical: bool
) -> list[LightMeter | MeterGrid] | None:
    """Return the meters of the command line; None where it has none, so that the stage's are read."""
    if not (points or grids or file):
        for flag, is_set in (("--facing", facing is not None), ("--cylindrical", is_cylindrical)):
            if is_set:
                raise SettingsError(f"{flag} is of the points of --at and --grid", where=flag, code=CODE)
        return None
    from ...light_meter.meters import LightMeter, MeterGrid, MeterKind, read_meters

    kind = MeterKind.CYLINDRICAL if is_cylindrical else MeterKind.ILLUMINANCE
    direction = None if facing is None else _vector(facing, "--facing")
    found: list[LightMeter | MeterGrid] = [] if file is None else read_meters(file)
    for number, text in enumerate(points, start=1):
        name, _, place = text.rpartition("=")
        found.append(LightMeter(name or f"point{number}", _vector(place, "--at"), direction, kind))
    for number, text in enumerate(grids, start=1):
        name, _, place = text.rpartition("=")
        parts = place.split("/")
        if len(parts) != 3:
            raise SettingsError(f"--grid takes [NAME=]CORNER/ACROSS/ALONG, not {text!r}", where="--grid", code=CODE)
        corner, across, along = (_vector(part, "--grid") for part in parts)
        found.append(MeterGrid(name or f"grid{number}", corner, across, along, direction=direction, kind=kind))
    return found


def _rate_glare(
    scene: str,
    given: list[LightMeter | MeterGrid] | None,
    settings: RenderSettings,
    target: float,
    outputs: list[str],
    *,
    json: bool,
) -> None:
    from ...images.image import write_text
    from ...light_meter.glare import rate_glare
    from ...light_meter.meters import LightMeter
    from ...render.prepare import open_once
    from ..console import dumps, print_line

    eyes = [one for one in given or () if isinstance(one, LightMeter) and one.direction is not None]
    if not eyes or len(eyes) < len(given or ()):
        raise SettingsError("--glare needs points of --at, and --facing for where the eye looks", where="--glare", code=CODE)
    for path in outputs:
        if Path(path).suffix.lower() != ".json":
            raise SettingsError(f"ratings of glare are written as .json, not {path}", where=path, code=CODE)
    rows, opened = [], open_once(scene, settings)
    for eye in eyes:
        assert eye.direction is not None
        found = rate_glare(opened, eye.position, eye.direction, settings, target=target)
        rows.append({"name": eye.name, **found.as_json()})
        if json:
            continue
        value, low, high = found.dgp
        doubt = "" if found.is_valid else "; outside of 0.2 to 0.8 at more than 380 lx, where DGP was fitted"
        print(f"{eye.name}: DGP {value:.3f} ({low:.3f} to {high:.3f}), {found.comfort}{doubt}")
        if found.ugr is not None:
            value, low, high = found.ugr
            print(f"{eye.name}: UGR {value:.1f} ({low:.1f} to {high:.1f})")
        lit = found.vertical_illuminance
        print(
            f"{eye.name}: {lit.value:.4g} lx at the eye, background {found.background:.4g} cd/m2, {len(found.sources)} sources"
        )
        for source in found.sources[:5]:
            print(f"  {source.luminance:.4g} cd/m2, {source.solid_angle:.3g} sr, position index {source.position_index:.2f}")
    for path in outputs:
        write_text(Path(path), str(dumps({"stage": scene, "ratings": rows}, indent=2)) + "\n")
    if json:
        for row in rows:
            print_line({"stage": scene, **row})


def _vector(text: str, flag: str) -> Vector:
    try:
        x, y, z = (float(word) for word in text.split(","))
    except ValueError:
        raise SettingsError(f"{flag} takes X,Y,Z, not {text!r}", where=flag, code=CODE) from None
    return (x, y, z)


def _text_of(found: Measurement, facts: dict[str, Any], pictures: list[LuminancePicture], suffix: str, dumps: Any) -> str:
    if suffix == ".json":
        return str(dumps(facts, indent=2)) + "\n"
    from ...light_meter.page import as_csv, as_page

    return as_csv(found) if suffix == ".csv" else as_page(found, str(facts["stage"]), pictures)


def _lines(found: Measurement) -> Iterator[str]:
    from ...light_meter.page import shown

    shares = found.is_daylight_factor
    readings = found.readings[:MOST_LINES]
    width = max(len(reading.meter.name) for reading in readings)
    for reading in readings:
        unmet = "" if reading.met else "  less precise than asked"
        yield f"{reading.meter.name:<{width}}  {shown((reading.value, reading.low, reading.high), shares)}{unmet}"
    if len(found.readings) > MOST_LINES:
        yield f"... and {len(found.readings) - MOST_LINES} more: write them with -o"
    for grid in found.grids:
        mean, least, most = (shown(interval, shares) for interval in (grid.mean, grid.least, grid.most))
        yield f"{grid.name}: mean {mean}, least {least}, most {most}"
        low, high = grid.uniformity[1:]
        yield f"{grid.name}: uniformity (least over mean) {grid.uniformity[0]:.3f} ({low:.3f} to {high:.3f})"
    report = found.report
    yield f"{report['samples']} samples a meter in {report['seconds']:.2f} s"
    if found.maintenance_factor != 1:
        yield f"all readings are multiplied by the maintenance factor {found.maintenance_factor:g}"
    if not found.met:
        yield f"the precision of {report['target']:.3g} was not reached: {report['stop']} came first"
