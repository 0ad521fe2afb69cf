"""`primray relight`: lights of a picture made brighter, darker or of another colour after the render."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ...errors import SettingsError
from ...settings.light_mixes import Weights, weights_of_text

if TYPE_CHECKING:
    from ...light_mix.fit import Fit
    from ...light_mix.mix import LightMix


def relight(
    picture: Annotated[str, typer.Argument(metavar="PICTURE", help="An EXR rendered with --aov lights.", show_default=False)],
    lights: Annotated[
        list[str] | None,
        typer.Option(
            "--light",
            "-l",
            metavar="NAME=WEIGHT",
            help="Multiply a light: a factor (key=0.5), or one for each of R, G and B (key=1,0.8,0.6); may be repeated.",
            show_default="1",
        ),
    ] = None,
    stops: Annotated[
        list[str] | None,
        typer.Option(
            "--stops", metavar="NAME=STOPS", help="Brighten a light by stops (rim=+1); may be repeated.", show_default="0"
        ),
    ] = None,
    mix_text: Annotated[
        str | None,
        typer.Option(
            "--mix",
            metavar="WEIGHTS",
            help="Weights of several lights, 'key=0.5 fill=1,0.8,0.6', or the --report of an earlier mix; others change it.",
            show_default=False,
        ),
    ] = None,
    only: Annotated[
        str | None, typer.Option("--only", metavar="NAMES", help="Turn all other lights off.", show_default=False)
    ] = None,
    without: Annotated[
        str | None, typer.Option("--without", metavar="NAMES", help="Turn lights off.", show_default=False)
    ] = None,
    reference: Annotated[
        str | None,
        typer.Option(
            "--fit",
            metavar="FILE",
            help="Find the weights that bring the picture closest to this scene-linear one of the same size.",
            show_default=False,
        ),
    ] = None,
    fit_colors: Annotated[bool, typer.Option("--fit-colors", help="Fit a weight for each of R, G and B.")] = False,
    turns: Annotated[
        list[str] | None,
        typer.Option(
            "--turn",
            metavar="NAME=DEGREES",
            help="Turn a dome about the up axis, counterclockwise from above, by a new render of its group alone, of --stage; "
            "may be repeated.",
            show_default=False,
        ),
    ] = None,
    turn_spp: Annotated[
        int | None,
        typer.Option("--turn-spp", metavar="N", help="Samples per pixel of that render.", show_default="the picture's"),
    ] = None,
    outputs: Annotated[
        list[str] | None,
        typer.Option(
            "--output", "-o", metavar="FILE", help="Picture to write: EXR, PNG, JPEG; may be repeated.", show_default="none"
        ),
    ] = None,
    layer: Annotated[
        str | None,
        typer.Option(
            "--layer",
            metavar="FILE",
            help="Write the lights' new intensities as a USD layer; needs --stage.",
            show_default=False,
        ),
    ] = None,
    stage: Annotated[
        str | None, typer.Option("--stage", metavar="STAGE", help="The stage that was rendered.", show_default=False)
    ] = None,
    report: Annotated[
        str | None, typer.Option(metavar="FILE", help="Write weights and error as JSON.", show_default=False)
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print a JSON line to stdout instead of text.")] = False,
    verbose: Annotated[bool, typer.Option("--verbose", "-V", help="Print tracebacks of errors.")] = False,
) -> None:
    """Change the lights of a picture after it is rendered. Without options, list its lights and what each contributes."""
    from ...images.image import check_output_path, write_text
    from ...images.output_path import check_folder
    from ...light_mix.fit import fit
    from ...light_mix.mix import LightMix
    from ..console import dumps, print_line
    from ..option_values import check_layer_name, mixes_of

    if (layer is None and not turns) != (stage is None):
        sentence = "--stage goes with --layer, which changes its lights, and with --turn, which renders a group of them again"
        raise SettingsError(sentence, code="lights-layer")
    for flag, needs, is_alone in (
        ("--turn-spp", "--turn", turn_spp is not None and not turns),
        ("--fit-colors", "--fit", fit_colors and reference is None),
    ):
        if is_alone:
            raise SettingsError(f"{flag} goes with {needs}", where=flag, code="lights-weight")
    for path in outputs or ():
        check_output_path(path)
    check_layer_name(layer)
    for file in (layer, report):
        if file is not None:
            check_folder(Path(file))
    mix = LightMix.of(picture)
    degrees = _turns(turns or [])
    if stage is not None and degrees:
        from ...render.turned_dome import turn_dome

        mix = turn_dome(mix, stage, degrees, spp=turn_spp)
    fitted = None if reference is None else fit(mix, reference, colors=fit_colors)
    asked = {} if fitted is None else {name: found.weight for name, found in fitted.weights.items()}
    if mix_text is not None:
        asked |= weights_of_text(mixes_of([mix_text])[0])
    asked |= _weights(mix, asked, lights or [], stops or [], _names(only, "--only"), _names(without, "--without"))
    weights = mix.weights(asked)
    made = mix.mixed(asked)
    facts = {"picture": picture, "lights": _facts(mix, weights), "error": made.report["error"], "keeps_light": mix.keeps_light}
    facts |= {"turns": degrees} if degrees else {}
    if fitted is not None:
        facts["fit"] = fitted.as_json()
    if layer is not None and stage is not None:
        left_out = _write_layer(mix, weights, stage, Path(layer))
        facts["left_out"] = left_out | dict.fromkeys(degrees, "its turn is no weight: author it on the dome")
    for path in outputs or ():
        made.save(path)
    if report is not None:
        write_text(Path(report), dumps(facts, indent=2) + "\n")
    if json:
        print_line({"type": "relight", **facts})
    else:
        print("\n".join(_lines(mix, weights, facts, fitted)))


def _names(text: str | None, flag: str) -> list[str] | None:
    names = None if text is None else [name.strip() for name in text.split(",") if name.strip()]
    if names == []:
        raise SettingsError(f"{flag} names no light; write NAME or NAME,NAME", where=flag, code="lights-weight")
    return names


def _weights(
    mix: LightMix, before: Weights, lights: list[str], stops: list[str], only: list[str] | None, without: list[str] | None
) -> Weights:
    """Return the weights that flags change; `before` are those of a fit, or of a mix."""
    found = dict(before)
    for name in [*(only or ()), *(without or ())]:
        mix.weights({name: 0.0})  # raises where there is no such light
    if only is not None:
        found |= {name: (0.0, 0.0, 0.0) for name in mix.names if name not in only}
    found |= dict.fromkeys(without or (), (0.0, 0.0, 0.0))
    for text in lights:
        name, values = _assigned(text, "--light")
        if len(values) not in (1, 3):
            raise _unreadable(text, "--light")
        r, g, b = values * 3 if len(values) == 1 else values
        found[name] = mix.weights({name: (r, g, b)})[name]
    for text in stops:
        name, values = _assigned(text, "--stops")
        if len(values) != 1 or not abs(values[0]) <= 64:
            raise _unreadable(text, "--stops")
        was = found.get(name, mix.weights({name: 1.0})[name])
        factor = 2.0 ** values[0]
        found[name] = was[0] * factor, was[1] * factor, was[2] * factor
    return found


def _assigned(text: str, flag: str) -> tuple[str, list[float]]:
    name, equals, values = text.rpartition("=")
    try:
        numbers = [float(word) for word in values.split(",")]
    except ValueError:
        raise _unreadable(text, flag) from None
    if not equals or not name:
        raise _unreadable(text, flag)
    return name, numbers


def _turns(texts: list[str]) -> dict[str, float]:
    found = {}
    for text in texts:
        name, values = _assigned(text, "--turn")
        if len(values) != 1 or not math.isfinite(values[0]):
            raise _unreadable(text, "--turn")
        found[name] = values[0]
    return found


def _unreadable(text: str, flag: str) -> SettingsError:
    forms = {"--light": "NAME=0.5 or NAME=1,0.8,0.6", "--stops": "NAME=+1", "--turn": "NAME=DEGREES"}
    return SettingsError(f"{flag} takes {forms[flag]}, not {text!r}", where=flag, code="lights-weight")


def _facts(mix: LightMix, weights: Weights) -> list[dict[str, Any]]:
    return [
        {"name": part.name, "weight": list(weights[part.name]), "share": mix.share_of(part), "lights": list(part.paths)}
        for part in mix.parts
    ]


def _write_layer(mix: LightMix, weights: Weights, stage: str, layer: Path) -> dict[str, str]:
    from ... import usd
    from ...color.color_space import REC709
    from ...images.image import write_text
    from ...render.prepare import open_once
    from ...render.turned_dome import composition_of_header

    of_lights = {path: weights[part.name] for part in mix.parts for path in part.paths if weights[part.name] != (1.0, 1.0, 1.0)}
    if mix.image.color_space != REC709 and any(len(set(weight)) > 1 for weight in of_lights.values()):
        sentence = "the picture's colour space is not Rec.709, in which UsdLux has colours: weigh lights by one factor each"
        raise SettingsError(sentence, where=str(layer), code="lights-layer")
    opened = open_once(stage, composition_of_header(mix.image.metadata)).stage
    usd.check_layer_output(opened, layer)
    text, left_out = usd.weight_layer(opened, of_lights)
    for part in mix.parts:
        if not part.paths and weights[part.name] != (1.0, 1.0, 1.0):
            left_out[part.name] = "it is no light of the stage"
    if of_lights and all(path in left_out for path in of_lights):
        path, why = next(iter(left_out.items()))
        more = f", and {len(of_lights) - 1} more" if len(of_lights) > 1 else ""
        raise SettingsError(f"no light can be written: {path}: {why}{more}", where=str(layer), code="lights-layer")
    write_text(layer, text)
    return left_out


def _lines(mix: LightMix, weights: Weights, facts: dict[str, Any], fitted: Fit | None) -> list[str]:
    width = max(len(name) for name in mix.names)
    lines = []
    for part in mix.parts:
        weight = weights[part.name]
        said = f"{weight[0]:.4g}" if len(set(weight)) == 1 else " ".join(f"{w:.4g}" for w in weight)
        if fitted is not None and part.name in fitted.weights:
            found = fitted.weights[part.name]
            said += "  (" + ", ".join(f"{low:.4g} to {high:.4g}" for low, high in zip(found.low, found.high, strict=True)) + ")"
        lines.append(f"{part.name:<{width}}  {mix.share_of(part):6.1%} of the picture  weight {said}")
    error = facts["error"]
    if error is not None:
        told = error["relmse"]
        low, high = told["ci95"]
        lines.append(f"relative error (relMSE) {told['estimate']:.3g} ({low:.3g} to {high:.3g})")
    if fitted is not None:
        lines.append(f"the fit leaves {fitted.residual:.1%} of the reference")
        lines += [f"{a} and {b} look alike: the fit cannot tell them apart" for a, b in fitted.alike]
    lines += [
        f"{name} turned by {degrees:g} degrees, its group rendered again" for name, degrees in facts.get("turns", {}).items()
    ]
    if mix.keeps_light:
        lines.append("some light of the picture is of no light (a background): it stays as it is")
    lines += [f"not in the layer: {path}: {why}" for path, why in facts.get("left_out", {}).items()]
    return lines
