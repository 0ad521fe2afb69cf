"""`primray inspect`: what a stage would render, without rendering it."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from ...settings import (
    DEFAULT_DICING_RATE,
    DEFAULT_MOTION_ERROR,
    AutoCamera,
    DefaultWrap,
    RenderContext,
    RenderSettings,
    StudioLight,
)
from .. import option_values, output_flags, stage_flags
from ..option_values import OnOff

if TYPE_CHECKING:
    from ...description import SceneDescription


def inspect(
    scene: stage_flags.Scene,
    camera: stage_flags.Camera = None,
    auto_camera: stage_flags.AutomaticCamera = AutoCamera.THREE_QUARTER,
    render_settings: stage_flags.RenderSettingsPrim = None,
    render_pass: stage_flags.RenderPassPrim = None,
    res: stage_flags.Resolution = None,
    image_width: stage_flags.ImageWidth = None,
    res_scale: stage_flags.ResolutionScale = None,
    frames: stage_flags.Frames = None,
    frame_count: stage_flags.FrameCount = None,
    frame_inc: stage_flags.FrameIncrement = None,
    default_time: stage_flags.DefaultTime = False,
    rendering_color_space: stage_flags.RenderingColorSpace = None,
    no_default_light: stage_flags.NoDefaultLight = False,
    studio_light: stage_flags.Studio = StudioLight.AUTO,
    dome: stage_flags.Dome = None,
    dome_rotation: stage_flags.DomeRotation = 0.0,
    dome_visible: stage_flags.DomeVisible = OnOff.ON,
    ground: stage_flags.GroundBelow = None,
    default_wrap: stage_flags.WrapByDefault = DefaultWrap.BLACK,
    render_context: stage_flags.MaterialContext = RenderContext.MTLX,
    purposes: stage_flags.Purposes = None,
    variants: stage_flags.Variants = None,
    no_payloads: stage_flags.NoPayloads = False,
    load: stage_flags.Load = None,
    mask: stage_flags.Mask = None,
    session_layer: stage_flags.SessionLayer = None,
    dicing_rate: stage_flags.DicingRate = DEFAULT_DICING_RATE,
    complexity: stage_flags.Dicing = None,
    no_motion_blur: stage_flags.NoMotionBlur = False,
    shutter: stage_flags.Shutter = None,
    region: stage_flags.Region = None,
    motion_error: stage_flags.MotionError = DEFAULT_MOTION_ERROR,
    lens: stage_flags.LensFlaws = None,
    json: output_flags.Json = False,
    verbose: output_flags.Verbose = False,
    strict: stage_flags.Strict = False,
    fail_on: stage_flags.FailOn = None,
    allow: stage_flags.Allow = None,
) -> None:
    """Print what a stage is made of and what would be rendered: layers, variants, cameras, counts, memory, diagnostics."""
    from ... import usd
    from ...diagnostics import Diagnostics
    from ...render.prepare import with_additions
    from ...report.motion import motion_facts
    from ...report.summary import counts, primvar_names, summary
    from ...report.texture_sizes import texture_sizes
    from ...textures.missing_tiles import note_missing_tiles
    from ...textures.texture_set import note_unreadable
    from ..inspect_text import lines
    from ..json_lines import print_line

    settings = RenderSettings(
        camera=option_values.camera_of(camera),
        auto_camera=auto_camera,
        render_settings=option_values.render_settings_of(render_settings),
        render_pass=option_values.render_settings_of(render_pass),
        resolution=option_values.resolution_of(res, image_width),
        resolution_scale=option_values.scale_of(res_scale),
        time_code=option_values.one_frame_of(
            option_values.frames_of(frames, frame_count, frame_inc, default_time, scene, session_layer), "inspect"
        ),
        default_light=not no_default_light,
        studio_light=studio_light,
        dome=dome,
        dome_rotation=dome_rotation,
        dome_visible=dome_visible is OnOff.ON,
        ground=ground,
        default_wrap=default_wrap,
        render_context=render_context,
        rendering_color_space=rendering_color_space,
        purposes=option_values.purposes_of(purposes),
        variants=tuple(variants or ()),
        load=option_values.load_of(no_payloads, load),
        mask=option_values.mask_of(mask),
        session_layer=session_layer,
        strict=strict,
        fail_on=option_values.codes_of(fail_on),
        allow=option_values.codes_of(allow),
        dicing_rate=option_values.dicing_rate_of(dicing_rate, complexity),
        motion_blur=not no_motion_blur,
        shutter=shutter,
        region=region,
        motion_error=motion_error,
        lens_flaws=tuple(lens or ()),
    )
    diagnostics = Diagnostics()
    stage = usd.open_stage(scene, diagnostics, settings.composition)
    description, translating = usd.translate(stage, settings)
    diagnostics.extend(translating)
    description = with_additions(description, settings, diagnostics)
    note_missing_tiles(description, diagnostics)
    textures = texture_sizes(description, usd.read_asset)
    note_unreadable(description, {path for path, size in textures.items() if size is None}, diagnostics, usd.read_asset)
    facts = {
        "type": "scene",
        "scene": scene,
        "stage": usd.stage_facts(stage),
        "cameras": usd.camera_paths(stage),
        "camera": camera_facts(description),
        "motion": motion_facts(description),
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
    diagnostics.raise_if_refused(settings.refusal)


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
