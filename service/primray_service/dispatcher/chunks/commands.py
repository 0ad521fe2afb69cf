"""Chunks for the executor: the command that renders a frame, explains a pixel or checks a scene, and the files that its worker
may see."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from primray.distributed.planner import part_settings
from primray.settings import DEFAULT_SPP, RenderSettings, settings_as_json

from ...admission import ALL, products_by_name, render_settings
from ...api.models import FileSettings, Settings
from ...executor.base import Capacity, Chunk
from ...files import DataDirectory
from ...jobs import Frame, Job, Json, Part, Scene
from ...limits import Limits
from ...problems import Problem
from ...scenes import shared
from ...scenes.recognize import choose, file_name
from ...shared_roots import SharedFile, shared_name
from ..context import Context

MERGE_CPU_S = 900.0  # for reading and measuring several large films
FILE_SETTINGS = tuple(FileSettings.model_fields)
SHARED = "shared"  # kind of scenes on shared storage
CHECKPOINT = "checkpoint.prc"  # name under which a worker finds the checkpoint to resume from


@dataclass(frozen=True)
class Asked:
    """Details of a frame's chunk that its job does not determine."""

    frames: int  # number of frames in the job
    more: bool = False  # whether more frames of the job are queued
    picture_only: bool = False
    preview: bool = False  # whether a client watches already
    taken: int | None = None  # samples already taken by parts: the frame takes no more, except for one if the number is odd


def render_chunk(
    chunk_id: str, job: Job, frame: Frame, scene: Scene, data: DataDirectory, capacity: Capacity, limits: Limits, asked: Asked
) -> Chunk:
    """Return the chunk that renders a frame; raises Problem if inputs are missing."""
    file, inputs, folders = _stage_of(job, scene, data)
    roots = _roots(scene, data)
    saved = data.job(job.id) / frame.checkpoint_file if frame.checkpoint_file else None
    # A lost checkpoint (from a failed or full disk) costs time only: samples are a function of the seed.
    begin = saved is None or not saved.is_file()
    if saved is not None and not begin:
        inputs[CHECKPOINT] = saved
    command: Json = {
        "do": "render",
        "file": file,
        "settings": settings_as_json(_settings_of(job, frame, capacity, asked)),
        "checkpoint": None if begin else CHECKPOINT,
        "number": frame.checkpoint,
        "checkpoint_every_s": limits.checkpoint_every_s,
        "picture_only": asked.picture_only and not begin,
        "preview": asked.preview,
        "outputs": list(output_names(job, frame, asked.frames)),
        "spent_s": 0.0 if begin else spent_s(frame),
        "fraction": 0.0 if begin else float(frame.progress.get("fraction", 0.0)),
        "limits": asdict(limits),
        "traceparent": job.traceparent,
        "files": {name: value for name in FILE_SETTINGS if (value := job.settings.get(name)) is not None},
    }
    command |= _products_of(job, frame, asked.frames) | _root_of(roots)
    # Frames of one attempt share processes, and so do a tenant's other jobs of the same scene. A retried frame has its own
    # group, since its outputs have the same names as those before.
    group = f"{job.id}/{job.attempt}/{frame.attempt}" if asked.frames > 1 else ""
    return Chunk(
        chunk_id,
        "render",
        command,
        inputs,
        folders,
        load_cpu_s=limits.load_cpu_s,
        group=group,
        more_follow=asked.more,
        scene=_open_scene(job, scene),
        keep_s=_kept_s(scene, limits),
        roots=roots,
    )


def _products_of(job: Job, frame: Frame, frames: int) -> Json:
    """Return the products that are written under their own names, and the suffix of this frame's file names."""
    products = products_by_name(job.settings)
    if products is None:
        return {}
    return {"products": {"named": None if products == [ALL] else products, "name_end": name_end(job, frame, frames)}}


def part_chunk(
    chunk_id: str, job: Job, frame: Frame, part: Part, scene: Scene, data: DataDirectory, capacity: Capacity, limits: Limits
) -> Chunk:
    """Return the chunk that renders a part; raises Problem if inputs are missing."""
    of_part = replace(frame, checkpoint=part.checkpoint, checkpoint_file=part.checkpoint_file, progress={})
    whole = render_chunk(chunk_id, job, of_part, scene, data, capacity, limits, Asked(1))
    settings = part_settings(frame_settings(job.settings, frame, capacity), (part.first, part.end))
    command = whole.command | {"settings": settings_as_json(settings), "outputs": [], "part": True}
    return replace(whole, command=command, group=_group_of_parts(job), more_follow=True)


def merge_chunk(
    chunk_id: str, job: Job, frame: Frame, parts: Sequence[Part], scene: Scene, data: DataDirectory, limits: Limits
) -> Chunk:
    """Return the chunk that merges the frame's checkpoint, if it has one, and these parts into one checkpoint. It goes to an
    idle worker that rendered parts, if there is one: starting a worker would take longer than the merge."""
    folder, stop = data.job(job.id), job.settings.get("stop", {})
    merged = {CHECKPOINT: folder / frame.checkpoint_file} if frame.merged else {}
    merged |= {f"part-{part.first}.prc": folder / part.checkpoint_file for part in parts}
    # The scene's files stay: otherwise they would be removed from the worker, and its next part would miss them.
    file, inputs, folders = _stage_of(job, scene, data)
    roots = _roots(scene, data)
    command: Json = {
        "do": "merge",
        "file": file,
        "background": job.settings.get("background"),
        "parts": list(merged),
        "number": frame.checkpoint,
        "metric": stop.get("metric") or "relmse",
        "target": stop.get("target_error"),
        "most": stop.get("max_samples"),
        "mixes": job.settings.get("mixes", []),
        "limits": asdict(limits),
    } | _root_of(roots)
    return Chunk(
        chunk_id,
        "render",
        command,
        inputs | merged,
        folders,
        load_cpu_s=MERGE_CPU_S,
        group=_group_of_parts(job),
        more_follow=True,
        scene=_open_scene(job, scene),
        keep_s=_kept_s(scene, limits),
        roots=roots,
    )


def _group_of_parts(job: Job) -> str:
    return f"{job.id}/{job.attempt}/parts"


def _open_scene(job: Job, scene: Scene) -> str:
    """Return the key of the open scene for reuse by other chunks. Files on shared storage may change, so no process keeps them
    open for another job."""
    if scene.kind == SHARED:
        return ""
    return f"{job.tenant}/{scene.id}"


def _kept_s(scene: Scene, limits: Limits) -> float:
    """Return how long a worker without work keeps the scene open: not at all where its files may change."""
    return 0.0 if scene.kind == SHARED else limits.scene_kept_s


def _settings_of(job: Job, frame: Frame, capacity: Capacity, asked: Asked) -> RenderSettings:
    settings = frame_settings(job.settings, frame, capacity)
    if job.parallel is not None:  # even in one slot: the picture must not depend on the number of slots
        # with parts, the stage's render settings are not known here
        spp = settings.spp if settings.stops_early else settings.most_samples
        settings = replace(settings, adaptive=False, spp=spp, error_metric=settings.metric)
    return settings if asked.taken is None else replace(settings, spp=asked.taken, time_limit_s=None)


def spent_s(frame: Frame) -> float:
    """Return the seconds of sampling up to the last checkpoint, over all chunks of this attempt: what a time limit counts."""
    return float(frame.progress.get("spent_s", 0.0))


MOST_EXPLAINED = 1024  # samples of an explained pixel, which is rendered once more for each of 15 other seeds


def explain_chunk(
    chunk_id: str,
    job: Job,
    frame: Frame,
    scene: Scene,
    pixel: tuple[int, int],
    data: DataDirectory,
    capacity: Capacity,
    limits: Limits,
) -> Chunk:
    """Return the chunk that explains a pixel of a frame's picture; raises Problem if inputs are missing.

    The samples are those that the picture has taken of a pixel on average, from its first one.
    """
    file, inputs, folders = _stage_of(job, scene, data)
    roots = _roots(scene, data)
    settings = frame_settings(job.settings, frame, capacity)
    taken = round(float(frame.progress.get("samples_done") or 0)) or settings.spp or DEFAULT_SPP
    command: Json = {
        "do": "explain",
        "file": file,
        "settings": settings_as_json(replace(settings, spp=min(taken, MOST_EXPLAINED))),
        "pixel": list(pixel),
        "limits": asdict(limits),
    } | _root_of(roots)
    return Chunk(
        chunk_id,
        "render",
        command,
        inputs,
        folders,
        load_cpu_s=limits.explain_cpu_s,
        scene=_open_scene(job, scene),
        keep_s=_kept_s(scene, limits),
        roots=roots,
    )


def check_chunk(chunk_id: str, scene: Scene, data: DataDirectory, limits: Limits) -> Chunk:
    root, inputs, folders = _files(scene, data)
    roots = _roots(scene, data)
    command: Json = {
        "do": "check",
        "file": "package" if scene.kind == "zip" else root,
        "kind": scene.kind,
        "entry": None,
        "limits": asdict(limits),
    } | _root_of(roots)
    return Chunk(chunk_id, "check", command, inputs, folders, load_cpu_s=limits.check_cpu_s, roots=roots)


def _roots(scene: Scene, data: DataDirectory) -> tuple[str, ...]:
    """Return the shared root of a scene; raises Problem if the tenant may no longer use it, or the file is gone."""
    return (str(_shared_file(scene, data).root.path),) if scene.kind == SHARED else ()


def _root_of(roots: tuple[str, ...]) -> Json:
    return {"root": roots[0]} if roots else {}


def _shared_file(scene: Scene, data: DataDirectory) -> SharedFile:
    return data.shared_roots.file(shared_name(scene.facts) or scene.name, scene.tenant)


def _files(scene: Scene, data: DataDirectory) -> tuple[str, dict[str, Path], dict[str, Path]]:
    """Return the root layer's name, the files and the folders; raises Problem if the scene's files are gone."""
    if scene.kind == SHARED:
        return str(_shared_file(scene, data).path), {}, {}
    folder = data.scene(scene.id)
    if scene.kind == "zip":
        _require(folder / "package")
        return "", {}, {"package": folder / "package"}
    _require(folder / "upload")
    name = file_name(scene.name, scene.kind)
    return name, {name: folder / "upload"}, {}


def _stage_of(job: Job, scene: Scene, data: DataDirectory) -> tuple[str, dict[str, Path], dict[str, Path]]:
    """Return the file that a job's commands open, and what `_files` returns else; raises Problem as it does."""
    root, inputs, folders = _files(scene, data)
    return f"package/{_entry(job, scene)}" if scene.kind == "zip" else root, inputs, folders


def _require(path: Path) -> None:
    if not path.exists():
        raise Problem("internal", "The scene's files are not on the server any more; upload it again.")


def _entry(job: Job, scene: Scene) -> str:
    entry = choose(job.entry, scene.facts.get("entries", ()), scene.facts.get("layers"))
    if entry is None:
        raise Problem("not-usd", "The package has no layer that can be its root.")
    return entry


def frame_settings(asked: Json, frame: Frame, capacity: Capacity) -> RenderSettings:
    """Return the render settings of one frame on this executor from the job's settings."""
    settings = render_settings(Settings.model_validate_json(json.dumps(asked)))
    return replace(settings, time_code=frame.time_code, threads=capacity.threads, max_memory_bytes=capacity.memory_bytes)


def output_names(job: Job, frame: Frame, frames: int) -> tuple[str, ...]:
    """Return the names of a frame's outputs in the job's outputs folder and in URLs. Frames requested by number have it in
    their names; later attempts have the attempt's number, so that a name that a client has fetched keeps its meaning."""
    end = name_end(job, frame, frames)
    if products_by_name(job.settings) is not None:
        return (f"report{end}.json",)
    return tuple(f"{stem}{end}.{suffix}" for stem, suffix in (("beauty", "exr"), ("beauty", "png"), ("report", "json")))


def name_end(job: Job, frame: Frame, frames: int) -> str:
    """Return the part of the names of a frame's files before the extension."""
    attempt = f"-{job.attempt}" if job.attempt > 1 else ""
    return f"{attempt}.{_code_text(frame)}" if frames > 1 or frame.time_code is not None else attempt


def _code_text(frame: Frame) -> str:
    """Return the time code as text: "0012", "-003" or "0012.500"; the frame's index if it has no time code."""
    code = float(frame.number) if frame.time_code is None else frame.time_code
    return f"{int(code):04d}" if code == int(code) else f"{code:08.3f}"


async def stage_inputs(context: Context, scene: Scene | None, job_id: str = "", files: Iterable[str] = ()) -> None:
    """Stage the scene, and files of the job by their names in its folder ("" for none); files that exist nowhere are skipped.
    Raises Problem or OSError."""
    if context.data.objects is not None:
        await context.calls.disk(bring_inputs, context.data, context.limits, scene, job_id, list(files))


def bring_inputs(data: DataDirectory, limits: Limits, scene: Scene | None, job_id: str = "", files: Iterable[str] = ()) -> None:
    """Bring the inputs from the object store, as `stage_inputs` does; blocks."""
    if scene is not None:
        shared.bring(scene, data, limits)
    for name in files:
        if name:
            data.bring(data.job(job_id) / name)
