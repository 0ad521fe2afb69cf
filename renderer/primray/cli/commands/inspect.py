"""`primray inspect`: what a stage would render, without rendering it."""

from __future__ import annotations

from ...settings import (
    DEFAULT_DICING_RATE,
    AutoCamera,
    DefaultWrap,
    RenderContext,
    RenderSettings,
    StudioLight,
)
from .. import option_values, output_flags, stage_flags
from ..option_values import OnOff


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
    """Print a stage's contents and what would be rendered: layers, cameras, products, counts, memory, diagnostics."""
    from ...diagnosis.inspection import facts_of
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
        translated_shaders=not no_translated_shaders,
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
    facts, diagnostics = facts_of(scene, settings)
    if json:
        print_line(facts)
    else:
        print("\n".join(lines(facts, verbose)))
    diagnostics.raise_if_refused(settings.refusal)
