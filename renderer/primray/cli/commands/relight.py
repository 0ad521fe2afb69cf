"""`primray relight`: lights of a picture made brighter, darker or of another colour after the render."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ...errors import SettingsError

if TYPE_CHECKING:
    from ...light_mix.fit import Fit
    from ...light_mix.mix import LightMix

Weights = dict[str, tuple[float, float, float]]


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

    if (layer is None) != (stage is None):
        raise SettingsError("--layer and --stage go together: the layer changes the lights of that stage", code="lights-layer")
    for path in outputs or ():
        check_output_path(path)
        if Path(path).resolve() == Path(picture).resolve():
            raise SettingsError(
                "the output would overwrite the picture, whose lights would be lost", where=path, code="output-folder"
            )
    for file in (layer, report):
        if file is not None:
            check_folder(Path(file))
    mix = LightMix.of(picture)
    fitted = None if reference is None else fit(mix, reference, colors=fit_colors)
    asked = {} if fitted is None else {name: found.weight for name, found in fitted.weights.items()}
    asked |= _weights(mix, lights or [], stops or [], _names(only), _names(without))
    weights = mix.weights(asked)
    made = mix.mixed(asked)
    facts = {"picture": picture, "lights": _facts(mix, weights), "error": made.report["error"], "keeps_light": mix.keeps_light}
    if fitted is not None:
        facts["fit"] = fitted.as_json()
    if layer is not None and stage is not None:
        facts["left_out"] = _write_layer(mix, weights, stage, Path(layer))
    for path in outputs or ():
        made.save(path)
    if report is not None:
        write_text(Path(report), dumps(facts, indent=2) + "\n")
    if json:
        print_line({"type": "relight", **facts})
    else:
        print("\n".join(_lines(mix, weights, facts, fitted)))


def _names(text: str | None) -> list[str] | None:
    return None if text is None else [name for name in text.split(",") if name]


def _weights(mix: LightMix, lights: list[str], stops: list[str], only: list[str] | None, without: list[str] | None) -> Weights:
    found: Weights = {}
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
        before = found.get(name, mix.weights({name: 1.0})[name])
        factor = 2.0 ** values[0]
        found[name] = before[0] * factor, before[1] * factor, before[2] * factor
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


def _unreadable(text: str, flag: str) -> SettingsError:
    forms = {"--light": "NAME=0.5 or NAME=1,0.8,0.6", "--stops": "NAME=+1"}
    return SettingsError(f"{flag} takes {forms[flag]}, not {text!r}", where=flag, code="lights-weight")


def _facts(mix: LightMix, weights: Weights) -> list[dict[str, Any]]:
    return [
        {"name": part.name, "weight": list(weights[part.name]), "share": mix.share_of(part), "lights": list(part.paths)}
        for part in mix.parts
    ]


def _write_layer(mix: LightMix, weights: Weights, stage: str, layer: Path) -> dict[str, str]:
    from ... import usd
    from ...color.color_space import REC709
    from ...diagnostics import Diagnostics
    from ...images.image import write_text

    of_lights = {path: weights[part.name] for part in mix.parts for path in part.paths if weights[part.name] != (1.0, 1.0, 1.0)}
    if mix.image.color_space != REC709 and any(len(set(weight)) > 1 for weight in of_lights.values()):
        sentence = "the picture's colour space is not Rec.709, in which UsdLux has colours: weigh lights by one factor each"
        raise SettingsError(sentence, where=str(layer), code="lights-layer")
    text, left_out = usd.weight_layer(usd.open_stage(stage, Diagnostics()), of_lights)
    for part in mix.parts:
        if not part.paths and weights[part.name] != (1.0, 1.0, 1.0):
            left_out[part.name] = "it is no light of the stage"
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
    if mix.keeps_light:
        lines.append("some light of the picture is of no light (a background): it stays as it is")
    lines += [f"not in the layer: {path}: {why}" for path, why in facts.get("left_out", {}).items()]
    return lines
