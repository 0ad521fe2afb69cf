"""`primray inspect`: what a stage would render, without rendering it."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ...errors import SettingsError
from ...render.frame_numbers import parse_frames
from ...settings import DEFAULT_DICING_RATE, RenderSettings
from .. import option_values, options

if TYPE_CHECKING:
    from ...description import SceneDescription


def inspect(
    scene: options.Scene,
    camera: options.Camera = None,
    render_settings: options.RenderSettingsPrim = None,
    res: options.Resolution = None,
    image_width: options.ImageWidth = None,
    frame: options.Frame = None,
    no_default_light: options.NoDefaultLight = False,
    purposes: options.Purposes = None,
    variants: options.Variants = None,
    no_payloads: options.NoPayloads = False,
    load: options.Load = None,
    mask: options.Mask = None,
    session_layer: options.SessionLayer = None,
    dicing_rate: options.DicingRate = DEFAULT_DICING_RATE,
    json: options.Json = False,
    verbose: options.Verbose = False,
    strict: Annotated[
        bool, typer.Option("--strict", help="Refuse a stage with warnings about the picture, after printing.")
    ] = False,
) -> None:
    """Print what a stage is made of and what would be rendered: layers, variants, cameras, counts, memory, diagnostics."""
    from ... import usd
    from ...diagnostics import Diagnostics
    from ...report.summary import counts, primvar_names, summary
    from ...report.texture_sizes import texture_sizes
    from ..inspect_text import lines
    from ..json_lines import print_line

    time_codes: list[float | None] = [None] if frame is None else [*parse_frames(frame)]
    if len(time_codes) > 1:
        raise SettingsError("inspect looks at one frame", code="frames")
    settings = RenderSettings(
        camera=option_values.camera_of(camera),
        render_settings=render_settings,
        resolution=option_values.resolution_of(res, image_width),
        time_code=time_codes[0],
        default_light=not no_default_light,
        purposes=option_values.purposes_of(purposes),
        variants=tuple(variants or ()),
        load=option_values.load_of(no_payloads, load),
        mask=option_values.mask_of(mask),
        session_layer=session_layer,
        dicing_rate=dicing_rate,
    )
    diagnostics = Diagnostics()
    stage = usd.open_stage(scene, diagnostics, settings.composition)
    description, translating = usd.translate(stage, settings)
    diagnostics.extend(translating)
    textures = texture_sizes(description, usd.read_asset)
    facts = {
        "type": "scene",
        "scene": scene,
        "stage": usd.stage_facts(stage),
        "cameras": usd.camera_paths(stage),
        "camera": camera_facts(description),
        "lights": light_facts(description),
        "materials": sorted({surface.path for surface in description.surfaces if surface.path}),
        "textures": [
            {"path": path, "size": size and [size.width, size.height, size.channels]} for path, size in textures.items()
        ],
        "primvars": primvar_names(description),
        "counts": counts(
            summary(
                description,
                settings.dicing_rate,
                [size for size in textures.values() if size],
            )
        ),
        "diagnostics": [diagnostic.as_json() for diagnostic in diagnostics],
    }
    if json:
        print_line(facts)
    else:
        print("\n".join(lines(facts, verbose)))
    if strict:
        diagnostics.raise_if_strict()


def camera_facts(description: SceneDescription) -> dict[str, Any]:
    camera = description.camera
    return {
        "path": camera.path,
        "projection": camera.projection.value,
        "resolution": list(description.resolution),
        "pixels": asdict(description.frame.pixels),
        "pixel_aspect_ratio": description.pixel_aspect_ratio,
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
