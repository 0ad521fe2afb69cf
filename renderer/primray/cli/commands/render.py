"""`primray render`: a stage to picture files. Flags are usdrecord's and husk's where they have one.

Typer and the options are named in annotations only, which app.py has read: quick.py calls this function without them.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from ...errors import SettingsError
from ...render.frame_numbers import check_names, name_of_frame, parse_frames
from ...settings import DEFAULT_DICING_RATE, Filter, Metric, RenderSettings
from .. import option_values
from ..shots import Shot, moments, product_shots

if TYPE_CHECKING:
    import typer

    from ...checkpoints.checkpointing import Checkpointing
    from ...images.image import Image
    from ...render import OpenedStage
    from .. import output_flags, render_flags, stage_flags


def render(
    scene: stage_flags.Scene,
    output: Annotated[str | None, typer.Argument(metavar="[OUTPUT]", help="As -o.", show_default=False)] = None,
    outputs: output_flags.Outputs = None,
    camera: stage_flags.Camera = None,
    render_settings: stage_flags.RenderSettingsPrim = None,
    product: output_flags.Products = None,
    all_products: output_flags.AllProducts = False,
    output_dir: output_flags.OutputDir = None,
    res: stage_flags.Resolution = None,
    image_width: stage_flags.ImageWidth = None,
    frames: stage_flags.Frames = None,
    spp: render_flags.Samples = None,
    target_error: render_flags.TargetError = None,
    error_metric: render_flags.ErrorMetric = Metric.RELMSE,
    time_limit: render_flags.TimeLimit = None,
    sample_range: output_flags.SampleRange = None,
    checkpoint: output_flags.Checkpoint = None,
    checkpoint_every: Annotated[
        float | None, typer.Option(metavar="S", help="Seconds between checkpoints.", show_default="60")
    ] = None,
    resume: Annotated[
        str | None,
        typer.Option(metavar="FILE", help="Go on from a checkpoint, and with it unless --checkpoint names another."),
    ] = None,
    adaptive: render_flags.Adaptive = None,
    max_depth: render_flags.MaxDepth = None,
    pixel_filter: render_flags.PixelFilter = Filter.BOX,
    filter_width: render_flags.FilterWidth = None,
    threads: render_flags.Threads = None,
    seed: render_flags.Seed = 0,
    rendering_color_space: stage_flags.RenderingColorSpace = None,
    display: output_flags.Display = None,
    aovs: output_flags.Aovs = None,
    view: output_flags.View = None,
    look: output_flags.Look = None,
    exposure: output_flags.Exposure = 0.0,
    strict: stage_flags.Strict = False,
    max_memory: render_flags.MaxMemory = None,
    dicing_rate: stage_flags.DicingRate = DEFAULT_DICING_RATE,
    report: output_flags.Report = None,
    json: output_flags.Json = False,
    no_default_light: stage_flags.NoDefaultLight = False,
    purposes: stage_flags.Purposes = None,
    variants: stage_flags.Variants = None,
    no_payloads: stage_flags.NoPayloads = False,
    load: stage_flags.Load = None,
    mask: stage_flags.Mask = None,
    session_layer: stage_flags.SessionLayer = None,
    verbose: output_flags.Verbose = False,
) -> None:
    """Render a USD stage to EXR, PNG or JPEG."""
    time_codes = None if frames is None else parse_frames(frames)
    names = ([output] if output else []) + (outputs or [])
    by_product = bool(product) or all_products or output_dir is not None
    if by_product:
        _require_names_of_their_own(names, report, checkpoint or resume)
    else:
        names = names or [_default_name(scene, time_codes)]
    settings = RenderSettings(
        camera=option_values.camera_of(camera),
        render_settings=render_settings,
        resolution=option_values.resolution_of(res, image_width),
        time_code=time_codes[0] if time_codes else None,
        spp=spp,
        target_error=target_error,
        error_metric=error_metric,
        time_limit_s=time_limit,
        adaptive=adaptive,
        sample_range=option_values.sample_range_of(sample_range),
        max_depth=max_depth,
        filter=pixel_filter,
        filter_width=filter_width,
        threads=threads,
        seed=seed,
        default_light=not no_default_light,
        rendering_color_space=rendering_color_space,
        purposes=option_values.purposes_of(purposes),
        variants=tuple(variants or ()),
        load=option_values.load_of(no_payloads, load),
        mask=option_values.mask_of(mask),
        session_layer=session_layer,
        aovs=option_values.aovs_of(aovs) if by_product else option_values.aovs_for(aovs, names),
        strict=strict,
        max_memory_bytes=option_values.bytes_of(max_memory),
        dicing_rate=dicing_rate,
    )
    looks = Looks(json, verbose, view=view, display=display, look=look, exposure=exposure)
    if by_product:
        opened, shots = product_shots(scene, settings, product, output_dir, time_codes)
        check_outputs([file for shot in shots for file in shot.files], None, looks)
        _render_shots(opened, shots, looks, [None] * len(shots))
        return
    saved = [name for name in (report, checkpoint, resume if checkpoint is None else None) if name]
    check_names(names + saved, time_codes)
    shots = _shots_of(settings, time_codes, names, report)
    check_outputs(shots[0].files, shots[0].report, looks)
    checkpointing = [_checkpointing(checkpoint, checkpoint_every, resume, shot.settings.time_code) for shot in shots]
    _render_shots(scene, shots, looks, _check_checkpoints(checkpointing))


def _shots_of(settings: RenderSettings, time_codes: list[float] | None, names: list[str], report: str | None) -> list[Shot]:
    """One for each frame, with its own names."""
    return [
        Shot(replace(settings, time_code=t), [_name(name, t) for name in names], _name(report, t) if report else None)
        for t in moments(time_codes)
    ]


TARGET_MISSED = 5  # the exit code of a render that ended above its target error


@dataclass(frozen=True)
class Looks:
    """How messages and pictures are to look."""

    as_json: bool
    verbose: bool
    view: str | None = None
    display: str | None = None
    look: str | None = None
    exposure: float = 0.0

    @property
    def is_chosen(self) -> bool:
        return not self.view == self.display == self.look is None


def _default_name(scene: str, time_codes: list[float] | None) -> str:
    many = time_codes is not None and len(time_codes) > 1
    member = scene.rstrip("]").replace("[", "/")  # a usdz member gives its own name
    return f"{Path(member).stem}{'.####' if many else ''}.exr"


def _require_names_of_their_own(names: list[str], report: str | None, checkpoint: str | None) -> None:
    given = {"-o": bool(names), "--report": report is not None, "--checkpoint": checkpoint is not None}
    for flag, is_given in given.items():
        if is_given:
            sentence = f"{flag} names one file, products have names of their own: --output-dir says where they are written"
            raise SettingsError(sentence, code="product-output")


def check_outputs(files: list[str], report: str | None, looks: Looks) -> None:
    """Find out before rendering what cannot be written after it."""
    import math

    from ...color.ocio import check_look, check_view
    from ...images.image import VIEW_EXTENSIONS, check_folder, check_output_path

    for file in files:
        check_output_path(file)
    if report is not None:
        check_folder(Path(report))
    if looks.is_chosen or any(file.lower().endswith(VIEW_EXTENSIONS) for file in files):
        check_view(looks.view, looks.display)
        check_look(looks.look)
    if not math.isfinite(looks.exposure):
        raise SettingsError(f"the exposure must be a number of stops, not {looks.exposure}")


def _checkpointing(
    checkpoint: str | None, every_s: float | None, resume: str | None, time_code: float | None
) -> Checkpointing | None:
    from ...checkpoints.checkpointing import DEFAULT_EVERY_S, Checkpointing

    file = checkpoint or resume
    if file is None:
        if every_s is not None:
            raise SettingsError("--checkpoint-every says how often; --checkpoint FILE says where", code="checkpoint")
        return None
    going_on = None if resume is None else Path(_name(resume, time_code))
    return Checkpointing(Path(_name(file, time_code)), DEFAULT_EVERY_S if every_s is None else every_s, going_on)


def _check_checkpoints(frames: list[Checkpointing | None]) -> list[Checkpointing | None]:
    """Before rendering; of several frames, those that have no checkpoint to go on from yet begin."""
    begun = [c is not None and c.resume is not None and c.resume.exists() for c in frames]
    some = len(frames) > 1 and any(begun)
    found = [c if c is None or there or not some else replace(c, resume=None) for c, there in zip(frames, begun, strict=True)]
    for checkpointing in found:
        if checkpointing is not None:
            checkpointing.check()
    return found


def _name(name: str, time_code: float | None) -> str:
    return name if time_code is None else name_of_frame(name, time_code)


def _render_shots(scene: str | OpenedStage, shots: list[Shot], looks: Looks, checkpointing: list[Checkpointing | None]) -> None:
    from ...render import quiet_frames
    from ...render.interruption import terminate_as_interrupt
    from ..progress import Show, showing

    showing_now: list[Show] = []
    missed = unsaved = False
    terminate_as_interrupt()
    images = quiet_frames(
        scene,
        [shot.settings for shot in shots],
        progress=lambda *now: showing_now[-1](*now),
        on_interrupt="partial",
        checkpointing=checkpointing,
    )
    for shot in shots:
        with showing(shot.files[0], looks.as_json) as show:
            showing_now.append(show)
            image = next(images)
        write(image, shot.files, shot.report, looks)
        if image.report["interrupted"]:
            print(f"interrupted: the picture so far was saved{_how_to_go_on(image.report)}", file=sys.stderr)
            raise SystemExit(130)
        unsaved = unsaved or image.report.get("checkpoint", {}).get("failed") is not None
        missed = missed or image.report["stop"]["target_met"] is False
    if unsaved:
        raise SystemExit(1)
    if missed:
        raise SystemExit(TARGET_MISSED)


def _how_to_go_on(report: Mapping[str, Any]) -> str:
    saved = report.get("checkpoint", {"failed": "none was asked for"})
    return "" if saved["failed"] else f"; --resume {saved['file']} goes on"


def write(image: Image, files: list[str], report_file: str | None, looks: Looks) -> None:
    from ...images.image import write_text
    from ...notices.diagnostics_text import print_diagnostics
    from ..json_lines import dumps, print_line

    start = time.perf_counter()
    for file in files:
        image.save(file, view=looks.view, display=looks.display, exposure=looks.exposure, look=looks.look)
    stages_s = {**image.report["stages_s"], "write": time.perf_counter() - start}
    report = {**image.report, "outputs": files, "stages_s": stages_s}
    if report_file is not None:
        write_text(Path(report_file), dumps(report, indent=2) + "\n")
    print_diagnostics(report["diagnostics"], verbose=looks.verbose)
    if looks.as_json:
        print_line({"type": "report", **report})
    else:
        print(_summary_line(image, report, files))


def _summary_line(image: Image, report: dict[str, Any], files: list[str]) -> str:
    width, height = image.resolution
    low, high = report["samples_per_pixel"]
    samples = f"{low}" if low == high else f"{low} to {high}"
    return (
        f"{', '.join(files)}: {width} x {height}, {samples} samples a pixel in {report['stages_s']['render']:.2f} s "
        f"({report['rays_per_s'] / 1e6:.1f} Mrays/s, {sum(report['stages_s'].values()):.2f} s in all)\n{_error_line(report)}"
    )


def _error_line(report: dict[str, Any]) -> str:
    """How wrong the picture is, and why the render stopped there."""
    metric = report["settings"]["error_metric"]
    found, target = report["error"][metric], report["settings"]["target_error"]
    if found is None:
        return "error: unknown, it takes two samples a pixel"
    low, high = found["ci95"]
    line = f"{metric} {found['estimate']:.3g} (95 %: {low:.3g} to {high:.3g})"
    if target is not None:
        met = "reached" if report["stop"]["target_met"] else "NOT reached"
        line += f", target {target:g} {met}"
    return f"{line}; stopped by {report['stop']['reason']}"
