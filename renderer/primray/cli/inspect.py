"""`primray inspect`: what a stage would render, without rendering it."""

from __future__ import annotations

from dataclasses import asdict, is_dataclass
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import SettingsError
from ..settings import RenderSettings
from . import options
from .frames import parse_frames

if TYPE_CHECKING:
    from ..description import SceneDescription


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
    json: options.Json = False,
    verbose: options.Verbose = False,
) -> None:
    """Print what would be rendered: cameras, lights, counts, memory, diagnostics."""
    from .. import usd
    from ..diagnostics import Diagnostics
    from ..summary import summary
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
    )
    diagnostics = Diagnostics()
    stage = usd.open_stage(scene, diagnostics)
    description, translating = usd.translate(stage, settings)
    diagnostics.extend(translating)
    facts = {
        "type": "scene",
        "scene": scene,
        "cameras": usd.camera_paths(stage),
        "camera": camera_facts(description),
        "lights": light_facts(description),
        "counts": as_plain(summary(description)),
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


def as_plain(value: Any) -> Any:
    return asdict(value) if is_dataclass(value) and not isinstance(value, type) else dict(value)


def _print_table(facts: dict[str, Any], verbose: bool) -> None:
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    from .diagnostics_text import diagnostics_lines

    table = Table(show_header=False, box=None, pad_edge=False)
    camera = facts["camera"]
    width, height = camera["resolution"]
    table.add_row("camera", escape(f"{camera['path'] or 'automatic'} ({camera['projection']}), {width} x {height}"))
    others = [path for path in facts["cameras"] if path != camera["path"]]
    for path in others if verbose else others[:10]:
        table.add_row("", escape(f"also {path}"))
    for light in facts["lights"] if verbose else facts["lights"][:20]:
        emission = " ".join(f"{v:.4g}" for v in light["emission"])
        texture = f", {light['texture']}" if light["texture"] else ""
        table.add_row("light", escape(f"{light['path'] or 'default'} ({light['type']}), {emission}{texture}"))
    if not verbose and len(facts["lights"]) > 20:
        table.add_row("", f"and {len(facts['lights']) - 20} more lights")
    for name, value in facts["counts"].items():
        if name.endswith("_bytes"):
            table.add_row(name.removesuffix("_bytes").replace("_", " "), f"{value / 2**20:.1f} MiB")
        else:
            table.add_row(name.replace("_", " "), f"{value:,}" if isinstance(value, int) else escape(str(value)))
    Console(soft_wrap=True, highlight=False).print(table)
    for line in diagnostics_lines(facts["diagnostics"], verbose=verbose):
        print(line)
