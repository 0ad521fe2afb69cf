"""`primray doctor`: checks of this machine, and reasons why a stage comes out slow, grey, dark or empty."""

from __future__ import annotations

from typing import Annotated

import typer

from ...settings import (
    DEFAULT_DICING_RATE,
    AutoCamera,
    DefaultWrap,
    RenderContext,
    RenderSettings,
    StudioLight,
)
from .. import option_values, output_flags, render_flags, stage_flags
from ..option_values import OnOff

SceneOrNone = Annotated[
    str | None,
    typer.Argument(
        metavar="[SCENE]", help="The USD stage to examine; without it, only the machine is checked.", show_default=False
    ),
]


def doctor(
    scene: SceneOrNone = None,
    pilot_seconds: render_flags.PilotSeconds = 3.0,
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
    max_depth: render_flags.MaxDepth = None,
    threads: render_flags.Threads = None,
    rendering_color_space: stage_flags.RenderingColorSpace = None,
    no_default_light: stage_flags.NoDefaultLight = False,
    studio_light: stage_flags.Studio = StudioLight.AUTO,
    dome: stage_flags.Dome = None,
    dome_rotation: stage_flags.DomeRotation = 0.0,
    dome_visible: stage_flags.DomeVisible = OnOff.ON,
    ground: stage_flags.GroundBelow = None,
    default_wrap: stage_flags.WrapByDefault = DefaultWrap.BLACK,
    render_context: stage_flags.MaterialContext = RenderContext.MTLX,
    no_translated_shaders: stage_flags.NoTranslatedShaders = False,
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
    motion_error: stage_flags.MotionError = None,
    lens: stage_flags.LensFlaws = None,
    json: output_flags.Json = False,
    verbose: output_flags.Verbose = False,
    strict: stage_flags.Strict = False,
    fail_on: stage_flags.FailOn = None,
    allow: stage_flags.Allow = None,
) -> None:
    """Check this machine; with a SCENE, render for a few seconds and explain why it is slow, grey, dark or empty."""
    if scene is None:
        _machine(json)
        return
    settings = RenderSettings(
        camera=option_values.camera_of(camera),
        auto_camera=auto_camera,
        render_settings=option_values.render_settings_of(render_settings),
        render_pass=option_values.render_settings_of(render_pass),
        resolution=option_values.resolution_of(res, image_width),
        resolution_scale=option_values.scale_of(res_scale),
        time_code=option_values.one_frame_of(
            option_values.frames_of(frames, frame_count, frame_inc, default_time, scene, session_layer), "doctor"
        ),
        max_depth=max_depth,
        threads=option_values.threads_of(threads),
        default_light=not no_default_light,
        studio_light=studio_light,
        dome=dome,
        dome_rotation=dome_rotation,
        dome_visible=dome_visible is OnOff.ON,
        ground=ground,
        default_wrap=default_wrap,
        render_context=render_context,
        translated_shaders=not no_translated_shaders,
        rendering_color_space=rendering_color_space,
        purposes=option_values.purposes_of(purposes),
        variants=tuple(variants or ()),
        load=option_values.load_of(no_payloads, load),
        mask=option_values.mask_of(mask),
        session_layer=session_layer,
        dicing_rate=option_values.dicing_rate_of(dicing_rate, complexity),
        motion_blur=not no_motion_blur,
        shutter=shutter,
        region=region,
        motion_error=motion_error,
        lens_flaws=tuple(lens or ()),
        strict=strict,
        fail_on=option_values.codes_of(fail_on),
        allow=option_values.codes_of(allow),
    )
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
    from ...diagnosis.doctor import diagnose
    from ...diagnosis.text import lines
    from ..console import print_line

    facts = diagnose(scene, settings, seconds).as_json()
    if as_json:
        print_line(facts)
    else:
        print("\n".join(lines(facts, verbose)))
