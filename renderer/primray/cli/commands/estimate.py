"""`primray estimate`: what an error would cost in samples and seconds, from a pilot of a few seconds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from ...errors import SettingsError
from ...settings import (
    DEFAULT_DICING_RATE,
    DEFAULT_MOTION_ERROR,
    AutoCamera,
    DefaultWrap,
    Filter,
    Metric,
    RenderContext,
    RenderSettings,
    StudioLight,
)
from .. import option_values, output_flags, render_flags, stage_flags
from ..option_values import OnOff

if TYPE_CHECKING:
    from ...sampling.prediction import Pilot, Prediction


# Stands for all the round targets of the table: the render that is meant has no other end.
SMALLEST_TARGET = 1e-30


def estimate(
    scene: stage_flags.Scene,
    target_errors: Annotated[
        list[float] | None,
        typer.Option("--target-error", metavar="E", help="May be repeated.", show_default="a table of round ones"),
    ] = None,
    error_metric: render_flags.ErrorMetric = Metric.RELMSE,
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
    pixel_filter: render_flags.PixelFilter = Filter.BOX,
    filter_width: render_flags.FilterWidth = None,
    threads: render_flags.Threads = None,
    seed: render_flags.Seed = 0,
    dicing_rate: stage_flags.DicingRate = DEFAULT_DICING_RATE,
    complexity: stage_flags.Dicing = None,
    no_motion_blur: stage_flags.NoMotionBlur = False,
    shutter: stage_flags.Shutter = None,
    region: stage_flags.Region = None,
    motion_error: stage_flags.MotionError = DEFAULT_MOTION_ERROR,
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
    purposes: stage_flags.Purposes = None,
    variants: stage_flags.Variants = None,
    no_payloads: stage_flags.NoPayloads = False,
    load: stage_flags.Load = None,
    mask: stage_flags.Mask = None,
    session_layer: stage_flags.SessionLayer = None,
    verbose: output_flags.Verbose = False,
) -> None:
    """Predict the samples and seconds that a render needs to reach an error, without rendering it."""
    if not pilot_seconds > 0:
        raise SettingsError(f"the pilot needs some seconds, not {pilot_seconds}", code="pilot")
    targets = sorted(set(target_errors or ()), reverse=True)
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
        target_error=min(targets, default=SMALLEST_TARGET),
        error_metric=error_metric,
        adaptive=True if adaptive is None else adaptive,
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
    for target in targets:
        RenderSettings(target_error=target)  # checks itself
    _print(_pilot(scene, settings, pilot_seconds, verbose), targets, json)


def _pilot(scene: str, settings: RenderSettings, seconds: float, verbose: bool) -> Pilot:
    from ... import usd
    from ...diagnostics import Diagnostics
    from ...notices.diagnostics_text import print_diagnostics
    from ...render import prepare
    from ...report.report import Costs
    from ...sampling.prediction import run_pilot

    opening, diagnostics = Diagnostics(), Diagnostics()
    stage = usd.open_stage(scene, opening, settings.composition)
    prepared = prepare(stage, opening, settings, Costs(), diagnostics)
    print_diagnostics([diagnostic.as_json() for diagnostic in diagnostics], verbose=verbose)
    pilot = run_pilot(prepared.scene, prepared.settings, seconds)
    if pilot is None:
        raise KeyboardInterrupt
    return pilot


def _print(pilot: Pilot, targets: list[float], as_json: bool) -> None:
    from ...sampling.prediction import usual_targets
    from ..json_lines import print_line

    predictions = [pilot.predict(target) for target in targets or usual_targets(pilot)]
    row, metric = pilot.row, pilot.metric.value
    if as_json:
        found: dict[str, Any] = {"samples": row.samples, "seconds": row.seconds, metric: row.error.of(pilot.metric).as_json()}
        print_line({"type": "estimate", "metric": metric, "pilot": found, "targets": [p.as_json() for p in predictions]})
        return
    known = row.error.of(pilot.metric)
    print(
        f"pilot: {row.samples:.0f} samples a pixel in {row.seconds:.2f} s, "
        f"{metric} {known.value:.3g} (95 %: {known.low:.3g} to {known.high:.3g})"
    )
    if not predictions:
        print("the picture has no error that could be seen")
        return
    print(f"{metric:>10}  {'samples':>8}  {'(95 %)':>17}  {'seconds':>8}  {'(95 %)':>17}")
    for prediction in predictions:
        print(_line(prediction))


def _line(prediction: Prediction) -> str:
    samples, seconds = prediction.samples, prediction.seconds
    if samples is None or seconds is None:
        return f"{prediction.target:>10.3g}  more samples than are allowed"
    return (
        f"{prediction.target:>10.3g}  {samples.value:>8.0f}  {f'{samples.low:.0f} - {samples.high:.0f}':>17}  "
        f"{seconds.value:>8.1f}  {f'{seconds.low:.1f} - {seconds.high:.1f}':>17}"
    )
