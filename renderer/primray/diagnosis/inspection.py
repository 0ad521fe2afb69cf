"""Facts about a stage and about what would be rendered of it, without rendering: `primray inspect` and `primray.inspect`."""

from __future__ import annotations

import os
from dataclasses import asdict
from typing import TYPE_CHECKING, Any, Unpack

from ..diagnostics import Diagnostics
from ..render.render import with_setting_names
from ..settings import RenderSettings, with_values

if TYPE_CHECKING:
    from ..description import SceneDescription
    from ..settings.written import SettingsValues


@with_setting_names
def inspect(
    stage: str | os.PathLike[str] | Any,
    settings: RenderSettings = RenderSettings(),  # noqa: B008 - immutable
    **values: Unpack[SettingsValues],
) -> dict[str, Any]:
    """Return what `primray inspect --json` prints of a stage, given as a Usd.Stage or as a path: cameras, lights,
    RenderSettings, products with their files, passes, counts, memory and diagnostics. Nothing is rendered.

    >>> found = primray.inspect("shot.usda", resolution=(32, 18))
    >>> found["camera"]["resolution"], found["outputs"]["products"]
    ([32, 18], [])
    """
    return facts_of(stage, with_values(settings, values))[0]


def facts_of(scene: str | os.PathLike[str] | Any, settings: RenderSettings) -> tuple[dict[str, Any], Diagnostics]:
    """Return the facts, and the diagnostics that they list."""
    from .. import usd
    from ..core import compiled
    from ..render.prepare import open_once, with_additions, with_stage_settings
    from ..report.summary import counts, motion_facts, primvar_names, summary, texture_sizes, volume_facts
    from ..textures.coverage import note_missing_tiles
    from ..textures.texture_set import note_unreadable

    opened = open_once(scene, settings)
    stage, diagnostics = opened.stage, opened.diagnostics
    description, translating = usd.translate(stage, settings, compiled.triangulate)
    diagnostics.extend(translating)
    settings, taken = with_stage_settings(settings, description.asked, diagnostics)
    description = with_additions(description, settings, diagnostics)
    note_missing_tiles(description, diagnostics)
    textures = texture_sizes(description, usd.read_asset)
    note_unreadable(description, {path for path, size in textures.items() if size is None}, diagnostics, usd.read_asset)
    sizes = [size for size in textures.values() if size]
    facts = {
        "type": "scene",
        "scene": os.fspath(scene) if isinstance(scene, str | os.PathLike) else usd.stage_name(stage),
        "stage": usd.stage_facts(stage),
        "cameras": usd.camera_paths(stage),
        "camera": camera_facts(description),
        "outputs": _outputs(stage, settings) | {"settings_taken": taken.as_json()},
        "motion": motion_facts(description),
        "lights": light_facts(description),
        "materials": sorted({surface.path for surface in description.surfaces if surface.path}),
        "textures": [
            {"path": path, "size": size and [size.width, size.height, size.channels]} for path, size in textures.items()
        ],
        "volumes": volume_facts(description),
        "primvars": primvar_names(description),
        "counts": counts(summary(description, settings.dicing_rate, sizes)),
        "diagnostics": [diagnostic.as_json() for diagnostic in diagnostics],
    }
    return facts, diagnostics


def _outputs(stage: Any, settings: RenderSettings) -> dict[str, Any]:
    """Return the stage's outputs with the file of each product, and the diagnostics of a render of all products.

    Relative files are relative to --output-dir.
    """
    from .. import usd
    from ..render.products import files_of

    found = usd.output_facts(stage, settings)
    notes = Diagnostics()
    files = files_of(stage, settings, notes)
    found["products"] = [product | {"file": files[product["path"]]} for product in found["products"]]
    found["diagnostics"] = [note.as_json() for note in notes]
    return found


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
