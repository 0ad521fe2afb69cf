"""`primray inspect`: what a stage would render, without rendering it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import SettingsError
from ..settings import RenderSettings
from . import options
from .frames import parse_frames

if TYPE_CHECKING:
    from ..description import SceneDescription

_SHOWN = 10  # cameras and lights, unless verbose


def inspect(
    scene: options.Scene,
    camera: options.Camera = None,
    res: options.Resolution = None,
    image_width: options.ImageWidth = None,
    frame: Annotated[
        str | None, typer.Option("--frame", "--frames", "-f", metavar="N", help="Time code.", show_default="default time")
    ] = None,
    no_default_light: options.NoDefaultLight = False,
    purposes: options.Purposes = None,
    variants: options.Variants = None,
    no_payloads: options.NoPayloads = False,
    load: options.Load = None,
    mask: options.Mask = None,
    session_layer: options.SessionLayer = None,
    json: options.Json = False,
    verbose: options.Verbose = False,
) -> None:
    """Print what would be rendered: cameras, lights, counts, memory, diagnostics."""
    from .. import usd
    from ..diagnostics import Diagnostics
    from ..summary import counts, summary
    from ..usd import camera_paths
    from .json_lines import print_line

    time_codes: list[float | None] = [None] if frame is None else [*parse_frames(frame)]
    if len(time_codes) > 1:
        raise SettingsError("inspect looks at one frame", code="frames")
    settings = RenderSettings(
        camera=options.camera_of(camera),
        resolution=options.resolution_of(res, image_width),
        time_code=time_codes[0],
        default_light=not no_default_light,
        purposes=options.purposes_of(purposes),
        variants=tuple(variants or ()),
        load=options.load_of(no_payloads, load),
        mask=options.mask_of(mask),
        session_layer=session_layer,
    )
    diagnostics = Diagnostics()
    stage = usd.open_stage(scene, diagnostics, settings.composition)
    description, translating = usd.translate(stage, settings)
    diagnostics.extend(translating)
    facts = {
        "type": "scene",
        "scene": scene,
        "cameras": camera_paths(stage),
        "camera": camera_facts(description),
        "lights": light_facts(description),
        "counts": counts(summary(description)),
        "diagnostics": [diagnostic.as_json() for diagnostic in diagnostics],
    }
    if json:
        print_line(facts)
    else:
        _print_table(facts, verbose)


def camera_facts(description: SceneDescription) -> dict[str, Any]:
    camera = description.camera
    return {
        "path": camera.path,
        "projection": camera.projection.value,
        "resolution": list(description.resolution),
        "position": [float(v) for v in camera.world_from_camera[:3, 3]],
        "window": list(camera.window),
        "lens_radius": camera.lens_radius,
        "focus_distance": camera.focus_distance,
        "exposure_scale": camera.exposure_scale,
        "time_code": description.time_code,
    }


def light_facts(description: SceneDescription) -> list[dict[str, Any]]:
    return [
        {
            "path": light.path,
            "type": light.type.value,
            "emission": list(light.emission),
            "texture": light.texture.path if light.texture else None,
        }
        for light in description.lights
    ]


def _print_table(facts: dict[str, Any], verbose: bool) -> None:
    from .diagnostics_text import diagnostics_lines

    rows = _camera_rows(facts, verbose) + _light_rows(facts["lights"], verbose) + _count_rows(facts["counts"])
    indent = max(len(name) for name, _ in rows) + 2
    for name, text in rows:
        print(f"{name:{indent}}{text}")
    for line in diagnostics_lines(facts["diagnostics"], verbose=verbose):
        print(line)


def _camera_rows(facts: dict[str, Any], verbose: bool) -> list[tuple[str, str]]:
    camera = facts["camera"]
    width, height = camera["resolution"]
    others = [path for path in facts["cameras"] if path != camera["path"]]
    rows = [("camera", f"{camera['path'] or 'automatic'} ({camera['projection']}), {width} x {height}")]
    rows += [("", f"also {path}") for path in (others if verbose else others[:_SHOWN])]
    return rows + _rest(others, "cameras", verbose)


def _light_rows(lights: list[dict[str, Any]], verbose: bool) -> list[tuple[str, str]]:
    rows = []
    for light in lights if verbose else lights[:_SHOWN]:
        emission = " ".join(f"{v:.4g}" for v in light["emission"])
        texture = f", {light['texture']}" if light["texture"] else ""
        rows.append(("light", f"{light['path']} ({light['type']}), {emission}{texture}"))
    return rows + _rest(lights, "lights", verbose)


def _rest(things: list[Any], what: str, verbose: bool) -> list[tuple[str, str]]:
    return [] if verbose or len(things) <= _SHOWN else [("", f"and {len(things) - _SHOWN} more {what}")]


def _count_rows(counted: dict[str, int]) -> list[tuple[str, str]]:
    rows = []
    for name, value in counted.items():
        if name.endswith("_bytes"):
            rows.append((name.removesuffix("_bytes").replace("_", " "), f"{value / 2**20:.1f} MiB"))
        else:
            rows.append((name.replace("_", " "), f"{value:,}"))
    return rows
