"""`primray render`: renders a stage to picture files. Flags have the names of usdrecord's and husk's where those exist.

quick.py calls `render` without importing Typer.
"""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ... import process_memory
from ...errors import SettingsError
from ...render.frames import FrameName, check_names, default_name, frame_name, name_of_frame
from ...report.profile import profile as recorded
from ...settings import RenderSettings
from ...time_spans import span
from .. import option_values
from ..flags import (
    CONTENTS,
    DIFFUSION,
    FRAMES,
    LIGHTING,
    REFUSAL,
    SIZE,
    SURFACES,
    TEXTURES,
    VIEWPOINT,
    frames_in,
    in_order,
    setting_values,
)
from ..option_values import ColorCorrection
from ..output_targets import EVERY_S, MOST_SHARE, is_standard, is_tev, output_name
from ..pictures import Looks, check_outputs, check_reports, check_shots, has_samples, is_refused, save, tell_of_all, write
from ..shots import (
    Shot,
    moments,
    movie_of,
    product_shots,
    require_only_products,
    turntable_numbers,
    turntable_shots,
    write_movie,
)
from ..stereo import render_pair, require_files, require_whole_renders, write_pair

if TYPE_CHECKING:
    from ...checkpoints.checkpointing import Checkpointing
    from ...distributed.executor import PartsExecutor
    from ...images.image import Image
    from ...render import OpenedStage
    from ...render.progress import Snapshots
    from ...sampling.sampling import Progress


def profiled(command: Callable[..., None]) -> Callable[..., None]:
    """Return the command with a trace of it written, if --profile asks for one."""

    @wraps(command)
    def run(*args: Any, profile: str | None = None, **given: Any) -> None:
        with nullcontext() if profile is None else recorded(profile, from_start=True):
            command(*args, **given)

    return run


@in_order(
    *("scene", "output", "outputs", *VIEWPOINT, "product", "all_products", "output_dir", "record", *SIZE, *FRAMES),
    *("spp", "target_error", "error_metric", "time_limit_s", "denoise", "stop_at", "sample_range"),
    *("checkpoint", "checkpoint_every", "resume"),
    *("adaptive", "max_depth", "clamp_indirect", "caustics", "filter", "filter_width", "threads", "seed"),
    *(
        "rendering_color_space",
        "display",
        "aovs",
        "aov_errors",
        "deep_tolerance",
        "deep_samples",
        "view",
        "look",
        "color_correction",
        "exposure",
    ),
    *(
        *REFUSAL,
        "max_memory_bytes",
        *TEXTURES,
        *SURFACES,
        "bit_depth",
        "half",
        "compression",
        "metadata",
        "stereo",
        *DIFFUSION,
        "lens_flaws",
    ),
    *(
        "make_output_path",
        "snapshot",
        "ray",
        "debug_pixel",
        "profile",
        "report",
        "json",
        *LIGHTING,
        "turntable",
        "fps",
        "preview",
        *CONTENTS,
    ),
    *("list_cameras", "verbose"),
)
@profiled
def render(
    scene: str,
    output: str | None = None,
    outputs: list[str] | None = None,
    product: list[str] | None = None,
    all_products: bool = False,
    output_dir: str | None = None,
    record: bool = False,
    checkpoint: str | None = None,
    checkpoint_every: float | None = None,
    resume: str | None = None,
    display: str | None = None,
    view: str | None = None,
    look: str | None = None,
    color_correction: ColorCorrection | None = None,
    exposure: str | None = None,
    bit_depth: int | None = None,
    half: list[str] | None = None,
    compression: str | None = None,
    metadata: list[str] | None = None,
    stereo: bool = False,
    make_output_path: bool = False,
    snapshot: float | None = None,
    ray: str | None = None,
    debug_pixel: tuple[int, int] | None = None,
    report: str | None = None,
    json: bool = False,
    turntable: int | None = None,
    fps: float | None = None,
    preview: bool = False,
    list_cameras: bool = False,
    verbose: bool = False,
    **given: Any,
) -> None:
    """Render a USD stage to EXR, PNG, JPEG, TIFF or HDR."""
    time_codes = option_values.time_codes_of(frames_in(given, scene))
    by_product = bool(product) or all_products or output_dir is not None
    if by_product:
        require_only_products(bool(product) and all_products, bool(output or outputs), checkpoint or resume)
    turns = turntable_numbers(turntable, fps, time_codes)
    if turns is not None and (by_product or checkpoint or resume or stereo):
        raise SettingsError(
            "a turntable cannot be combined with products, stereo pairs or checkpoints", where="--turntable", code="turntable"
        )
    names = _names_of([name for name in (output, *(outputs or ())) if name is not None], scene, turns or time_codes)
    if turns is not None and len(turns) > 1:
        names = [name.with_holder() for name in names]
    values = setting_values(given)
    if preview:
        values |= option_values.previewed(values)
    aovs = given.get("aovs")
    values["aovs"] = option_values.aovs_of(aovs) if by_product else option_values.aovs_for(aovs, _files_of(names))
    settings = RenderSettings(**values, time_code=time_codes[0] if time_codes else None)
    looks = Looks(
        as_json=json,
        verbose=verbose,
        view=option_values.view_of(view, color_correction),
        display=display,
        look=look,
        exposure=option_values.exposure_of(exposure),
        make_folders=make_output_path,
        encoding=option_values.encoding_of(bit_depth, half, compression, metadata),
        names_space=settings.rendering_color_space is not None,
    )
    process_memory.hold(settings.max_memory_bytes, json, _memory_watch)
    if debug_pixel is not None:
        pictures = {
            "an output": output or outputs,
            "a product": by_product,
            "a turntable": turns,
            "a report": report,
            "several frames": time_codes is not None and len(time_codes) > 1,
            "--stereo": stereo,
            "--ray": ray,
            "--checkpoint": checkpoint,
            "--resume": resume,
            "--snapshot": snapshot,
        }
        return _print_pixel(scene, settings, debug_pixel, [name for name, asked in pictures.items() if asked], json)
    if stereo:
        require_files([str(name) for name in names])
        require_whole_renders({"--checkpoint": checkpoint, "--resume": resume, "--snapshot": snapshot})
    if ray is not None:
        require_parts({"--checkpoint": checkpoint, "--resume": resume, "--snapshot": snapshot, "--stereo": stereo or None})
    if list_cameras:
        _list_cameras(scene, settings, json)
    elif by_product:
        _render_products(scene, settings, product, output_dir, time_codes, looks, snapshot, stereo, ray, record, report)
    else:
        if turns is not None:
            return _render_turntable(ray, scene, settings, turns, names, report, looks, snapshot, fps)
        shots = _shots_of(settings, time_codes, names, report, resume if checkpoint is None else checkpoint)
        check_shots(shots, looks)
        if stereo:
            return _render_pairs(scene, shots, looks)
        if ray is not None:
            return _render_on_ray(ray, scene, shots, looks)
        checkpointing = [_checkpointing(checkpoint, checkpoint_every, resume, t) for t in moments(time_codes)]
        _render_shots(scene, shots, looks, _check_checkpoints(checkpointing), snapshot)


def _memory_watch() -> process_memory.Watch:
    from ...core import compiled

    return compiled.watch_memory


def _print_pixel(scene: str, settings: RenderSettings, pixel: tuple[int, int], pictures: list[str], as_json: bool) -> None:
    if pictures:
        raise SettingsError(
            f"--debug-pixel renders no picture and cannot be combined with {', '.join(pictures)}",
            where="--debug-pixel",
            code="debug-pixel",
        )
    from ...diagnosis.pixel_log import debug_pixel
    from ..console import print_line

    log = debug_pixel(scene, *pixel, settings)
    if as_json:
        print_line(log.as_json())
    else:
        print("\n".join(log.lines()))


def _render_turntable(
    ray: str | None,
    scene: str,
    settings: RenderSettings,
    numbers: list[float],
    names: list[FrameName],
    report: str | None,
    looks: Looks,
    snapshot_s: float | None,
    fps: float | None,
) -> None:
    of_report = frame_name(report) if report else None
    if of_report is not None and len(numbers) > 1:
        of_report = of_report.with_holder()
    movie = movie_of(names, fps)
    shots = turntable_shots(settings, numbers, names, of_report)
    check_shots(shots, looks)
    if ray is not None:
        _render_on_ray(ray, scene, shots, looks)
    else:
        _render_shots(scene, shots, looks, [None] * len(shots), snapshot_s)
    if movie is not None:
        write_movie(movie, numbers)


def _render_products(
    scene: str,
    settings: RenderSettings,
    asked: list[str] | None,
    folder: str | None,
    time_codes: list[float] | None,
    looks: Looks,
    snapshot_s: float | None,
    stereo: bool,
    ray: str | None,
    with_record: bool,
    report: str | None,
) -> None:
    opened, shots = product_shots(scene, settings, asked, folder, time_codes, with_record, report)
    check_outputs([file for shot in shots for file in shot.files], None, replace(looks, make_folders=True), settings)
    check_reports([shot.report for shot in shots if shot.report is not None], looks.make_folders)
    if stereo:
        return _render_pairs(opened, shots, looks)
    if ray is not None:
        return _render_on_ray(ray, scene, shots, looks)
    _render_shots(opened, shots, looks, [None] * len(shots), snapshot_s)


def _list_cameras(scene: str, settings: RenderSettings, as_json: bool) -> None:
    from ... import usd
    from ...render import open_once
    from ..console import print_line

    cameras = usd.camera_paths(open_once(scene, settings).stage)
    if as_json:
        print_line({"type": "cameras", "scene": scene, "cameras": cameras})
    elif cameras:
        print("\n".join(cameras))


def _shots_of(
    settings: RenderSettings,
    time_codes: list[float] | None,
    names: list[FrameName],
    report: str | None,
    checkpoint: str | None,
) -> list[Shot]:
    """Return one shot for each frame, with its own file names; the checkpoint's name must differ by frame, too."""
    check_names([*names, *(frame_name(name) for name in (report, checkpoint) if name)], time_codes)
    return [
        Shot(replace(settings, time_code=t), [name.of(t) for name in names], name_of_frame(report, t) if report else None)
        for t in moments(time_codes)
    ]


def _files_of(names: list[FrameName]) -> list[str]:
    """Return the names that are files; frame placeholders are kept."""
    return [str(name) for name in names if not is_tev(str(name))]


REFUSED = 3  # exit code of a picture that --strict or --fail-on refuse after it was rendered
TARGET_MISSED = 5  # exit code of a render that did not reach its target error


def _names_of(outputs: list[str], scene: str, time_codes: list[float] | None) -> list[FrameName]:
    """Return the output names; the default is named after the stage."""
    stem = Path(scene.rstrip("]").replace("[", "/")).stem  # for a layer in a usdz package, the layer's name
    many = time_codes is not None and len(time_codes) > 1
    return [output_name(name, stem, many) for name in outputs] or [default_name(stem, many)]


def _checkpointing(
    checkpoint: str | None, every_s: float | None, resume: str | None, time_code: float | None
) -> Checkpointing | None:
    from ...checkpoints.checkpointing import Checkpointing

    file = checkpoint or resume
    if file is None:
        if every_s is not None:
            raise SettingsError("--checkpoint-every needs --checkpoint FILE, the file to write", code="checkpoint")
        return None
    going_on = None if resume is None else Path(name_of_frame(resume, time_code))
    return Checkpointing(Path(name_of_frame(file, time_code)), every_s, going_on)


def _check_checkpoints(frames: list[Checkpointing | None]) -> list[Checkpointing | None]:
    """Check checkpoints before rendering.

    If several frames are rendered and some have a checkpoint, the others begin from the first sample.
    """
    begun = [c is not None and c.resume is not None and c.resume.exists() for c in frames]
    some = len(frames) > 1 and any(begun)
    found = [c if c is None or there or not some else replace(c, resume=None) for c, there in zip(frames, begun, strict=True)]
    for checkpointing in found:
        if checkpointing is not None:
            checkpointing.check()
    missing = [c.resume for c, now in zip(frames, found, strict=True) if c is not None and c.resume and now and not now.resume]
    if missing:
        print(f"no checkpoint found, rendering from the first sample: {', '.join(map(str, missing))}", file=sys.stderr)
    return found


def _render_shots(
    scene: str | OpenedStage,
    shots: list[Shot],
    looks: Looks,
    checkpointing: list[Checkpointing | None],
    snapshot_s: float | None,
) -> None:
    with span("import"):
        from ...incremental.scene import quiet_frames

    rendering: list[Shot] = []

    def images(progress: Progress) -> Iterator[Image]:
        return quiet_frames(
            scene,
            [shot.settings for shot in shots],
            progress=progress,
            on_interrupt="partial",
            checkpointing=checkpointing,
            snapshots=_snapshots(snapshot_s, rendering, looks, any(map(is_tev, shots[0].files))),
        )

    _write_shots(images, shots, looks, rendering)


def _render_on_ray(address: str, scene: str, shots: list[Shot], looks: Looks) -> None:
    """Render shots like `_render_shots`, each frame split over the nodes of a Ray cluster."""
    from ...render.in_parts import render_in_parts

    with ray_executor(address) as executor:

        def images(progress: Progress) -> Iterator[Image]:
            return (render_in_parts(scene, shot.settings, executor, progress, "partial") for shot in shots)

        _write_shots(images, shots, looks, [])


def _write_shots(render: Callable[[Progress], Iterator[Image]], shots: list[Shot], looks: Looks, rendering: list[Shot]) -> None:
    """Render and write all shots.

    If a picture cannot be written, this is reported, the next one is rendered, and the command fails at the end. `rendering`
    holds the current shot.
    """
    from ...render.interruption import INTERRUPTED, terminate_as_interrupt
    from ..console import Show, showing

    showing_now: list[Show] = []
    missed = unsaved = refused = False
    terminate_as_interrupt()
    images = render(lambda *now: showing_now[-1](*now))
    for shot in shots:
        rendering[:] = [shot]
        with showing(shot.files[0], looks.as_json) as show:
            showing_now.append(show)
            image = next(images)
        has_picture = has_samples(image) or not image.report["interrupted"]
        # Files of an earlier render are not replaced by a picture without samples.
        unsaved = not write(image, shot if has_picture else replace(shot, files=[], report=None), looks) or unsaved
        looks = looks.settled_if_it_can_be(image)  # the first frame's exposure is kept, so that sequences do not flicker
        if image.report["interrupted"]:
            said = (
                "the unfinished picture was saved" if has_picture else "no picture was written, because it has no samples yet"
            )
            print(f"interrupted: {said}{_how_to_go_on(image.report)}", file=sys.stderr)
            raise SystemExit(INTERRUPTED)
        unsaved = unsaved or image.report.get("checkpoint", {}).get("failed") is not None
        refused = is_refused(image, shot.settings, looks) or refused
        missed = missed or image.report["stop"]["target_met"] is False
    _end(looks, unsaved, refused, missed)


def _end(looks: Looks, unsaved: bool, refused: bool, missed: bool) -> None:
    """Raise SystemExit if something failed."""
    tell_of_all(looks)
    for code, happened in ((1, unsaved), (REFUSED, refused), (TARGET_MISSED, missed)):
        if happened:
            raise SystemExit(code)


def _render_pairs(scene: str | OpenedStage, shots: list[Shot], looks: Looks) -> None:
    """Render shots like `_render_shots`, both eyes of each."""
    from ...render import open_once
    from ...render.interruption import INTERRUPTED, terminate_as_interrupt

    terminate_as_interrupt()
    opened = open_once(scene, shots[0].settings) if isinstance(scene, str) else scene
    missed = unsaved = refused = False
    for shot in shots:
        pair = render_pair(opened, shot, looks)
        if pair is None:
            print("interrupted: no picture was saved, because there was none of both eyes yet", file=sys.stderr)
            raise SystemExit(INTERRUPTED)
        unsaved = not write_pair(pair, shot, looks) or unsaved
        looks = looks.settled_if_it_can_be(pair.left)
        if pair.right.report["interrupted"]:
            print("interrupted: the unfinished pictures were saved", file=sys.stderr)
            raise SystemExit(INTERRUPTED)
        for image in pair.views.values():
            refused = is_refused(image, shot.settings, looks) or refused
        missed = missed or any(image.report["stop"]["target_met"] is False for image in pair.views.values())
    _end(looks, unsaved, refused, missed)


def _snapshots(every_s: float | None, rendering: list[Shot], looks: Looks, shown: bool) -> list[Snapshots]:
    """Return snapshots that write the files of the current shot and, if `shown`, update tev.

    Failures are reported, and rendering continues.
    """
    from ...render.progress import Snapshots

    def write_so_far(image: Image) -> None:
        for file in rendering[0].files:
            if is_tev(file) or is_standard(file):
                continue
            held = rendering[0].image_in(file, image)
            if held.file.contents is not None and not held.file.contents.picture:
                continue  # the product does not include the picture
            try:
                save(held, file, looks)
            except Exception as error:  # the render continues
                print(f"warning: the unfinished picture could not be saved: {error}", file=sys.stderr)

    def show_so_far(image: Image) -> None:
        looks.tev.show_so_far(image, [file for file in rendering[0].files if is_tev(file)])

    written = [] if every_s is None else [Snapshots(every_s, write_so_far)]
    return [*written, *([Snapshots(EVERY_S, show_so_far, MOST_SHARE)] if shown else [])]


def _how_to_go_on(report: Mapping[str, Any]) -> str:
    saved = report.get("checkpoint", {"failed": "none was requested"})
    return "" if saved["failed"] else f"; continue with --resume {shlex.quote(str(saved['file']))}"


GROUP, RAY = "primray.executors", "ray"


def ray_executor(address: str) -> AbstractContextManager[PartsExecutor]:
    """Return the executor for the Ray cluster at `address`; it connects when a frame begins.

    SettingsError if no package provides one.
    """
    from importlib.metadata import entry_points

    for entry in entry_points(group=GROUP, name=RAY):
        made: AbstractContextManager[PartsExecutor] = entry.load()(address)
        return made
    raise SettingsError("--ray needs the render service: pip install 'primray[server,ray]'", code="ray-missing")


def require_parts(flags: Mapping[str, Any]) -> None:
    """Raise SettingsError for flags that need a render on this machine."""
    for flag, value in flags.items():
        if value is not None:
            raise SettingsError(
                f"{flag} cannot be combined with --ray; it is for renders on this machine", code="parts-setting"
            )
