"""`primray estimate`: samples and seconds that a target error would cost, from a pilot render of a few seconds."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

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

if TYPE_CHECKING:
    from ...diagnosis.estimate import CostEstimate
    from ...sampling.prediction import Prediction

VAGUE = 2.0  # factor by which the pilot's error may be underestimated, from which a warning is printed


def estimate(
    scene: stage_flags.Scene,
    target_errors: Annotated[
        list[float] | None,
        typer.Option("--target-error", metavar="E", help="Target error to estimate; may be repeated.", show_default="several"),
    ] = None,
    error_metric: render_flags.ErrorMetric = None,
    pilot_seconds: render_flags.PilotSeconds = 3.0,
    adaptive: render_flags.Adaptive = None,
    spp: render_flags.Samples = None,
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
    clamp_indirect: render_flags.ClampIndirect = None,
    caustics: render_flags.Caustics = OnOff.ON,
    pixel_filter: render_flags.PixelFilter = None,
    filter_width: render_flags.FilterWidth = None,
    threads: render_flags.Threads = None,
    seed: render_flags.Seed = 0,
    dicing_rate: stage_flags.DicingRate = DEFAULT_DICING_RATE,
    complexity: stage_flags.Dicing = None,
    no_motion_blur: stage_flags.NoMotionBlur = False,
    shutter: stage_flags.Shutter = None,
    region: stage_flags.Region = None,
    motion_error: stage_flags.MotionError = None,
    lens: stage_flags.LensFlaws = None,
    json: output_flags.Json = False,
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
    verbose: output_flags.Verbose = False,
) -> None:
    """Predict the samples and seconds that a render needs to reach an error, without rendering it."""
    from ...diagnosis.estimate import estimate as cost
    from ...messages.diagnostics_text import print_diagnostics
    from ..console import print_line

    targets = target_errors or []
    settings = RenderSettings(
        camera=option_values.camera_of(camera),
        auto_camera=auto_camera,
        render_settings=option_values.render_settings_of(render_settings),
        render_pass=option_values.render_settings_of(render_pass),
        resolution=option_values.resolution_of(res, image_width),
        resolution_scale=option_values.scale_of(res_scale),
        time_code=option_values.one_frame_of(
            option_values.frames_of(frames, frame_count, frame_inc, default_time, scene, session_layer), "estimate"
        ),
        spp=spp,
        error_metric=error_metric,
        adaptive=adaptive,
        max_depth=max_depth,
        clamp_indirect=clamp_indirect,
        caustics=caustics is OnOff.ON,
        filter=pixel_filter,
        filter_width=filter_width,
        threads=option_values.threads_of(threads),
        seed=seed,
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
    )
    found = cost(scene, targets, settings, pilot_seconds=pilot_seconds)
    print_diagnostics([diagnostic.as_json() for diagnostic in found.diagnostics], verbose=verbose)
    if json:
        print_line(found.as_json())
    else:
        print("\n".join(_lines(found)))


def _lines(cost: CostEstimate) -> Iterator[str]:
    metric, known = cost.metric.value, cost.error
    yield (
        f"pilot: {cost.samples:.0f} samples a pixel in {cost.seconds:.2f} s, "
        f"{metric} {known.value:.3g} (95 %: {known.low:.3g} to {known.high:.3g})"
    )
    if not cost.predictions:
        yield "the picture has no measurable error"
        return
    if known.doubt >= VAGUE:
        yield (
            f"the error may be {known.doubt:.3g} times larger, because of a few bright pixels: a render continues until it is "
            "known better, which a pilot cannot predict; a longer pilot (--pilot) narrows the intervals"
        )
    yield f"{metric:>10}  {'samples':>8}  {'(95 %)':>17}  {'seconds':>8}  {'(95 %)':>17}"
    yield from map(_line, cost.predictions)


def _line(prediction: Prediction) -> str:
    samples, seconds = prediction.samples, prediction.seconds
    if samples is None or seconds is None:
        return f"{prediction.target:>10.3g}  more samples than allowed"
    return (
        f"{prediction.target:>10.3g}  {samples.value:>8.0f}  {f'{samples.low:.0f} - {samples.high:.0f}':>17}  "
        f"{seconds.value:>8.1f}  {f'{seconds.low:.1f} - {seconds.high:.1f}':>17}"
    )
