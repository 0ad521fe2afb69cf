"""The chunk that runs a frame, or checks a scene: its command and the files it may see."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from primray.report import settings_as_json
from primray.settings import DEFAULT_SPP, Filter, Metric, RenderSettings

from ..executor.base import Capacity, Chunk
from ..files import DataDirectory
from ..jobs import Frame, Job, Json, Scene
from ..limits import Limits
from ..problems import Problem

CHECKPOINT = "checkpoint.prc"  # by this name a worker finds the one it goes on from
LEAST_S = 1e-3  # of a time limit


@dataclass(frozen=True)
class Asked:
    """What a frame's chunk is to do, beyond what its job says."""

    picture_only: bool = False
    preview: bool = False
    spent_s: float = 0.0  # of the time that the job gives a frame


def render_chunk(
    chunk_id: str, job: Job, frame: Frame, scene: Scene, data: DataDirectory, capacity: Capacity, limits: Limits, asked: Asked
) -> Chunk:
    """Problem if there is nothing to render with."""
    root, inputs, folders = _files(scene, data)
    saved = data.job(job.id) / frame.checkpoint_file if frame.checkpoint_file else None
    # A checkpoint that is gone (a disk was lost, or short) costs time, nothing else: samples are a function of the seed.
    begin = saved is None or not saved.is_file()
    if saved is not None and not begin:
        inputs[CHECKPOINT] = saved
    settings = replace(render_settings(job.settings, frame, capacity), time_limit_s=_time_left(job.settings, asked.spent_s))
    command: Json = {
        "do": "render",
        "file": f"package/{_entry(job, scene)}" if scene.kind == "zip" else root,
        "settings": settings_as_json(settings),
        "checkpoint": None if begin else CHECKPOINT,
        "number": frame.checkpoint,
        "checkpoint_every_s": limits.checkpoint_every_s,
        "picture_only": asked.picture_only and not begin,
        "preview": asked.preview,
        "outputs": list(worker_names()),
        "limits": asdict(limits),
        "traceparent": job.traceparent,
    }
    return Chunk(chunk_id, "render", command, inputs, folders, load_cpu_s=limits.load_cpu_s)


def check_chunk(chunk_id: str, scene: Scene, data: DataDirectory, limits: Limits) -> Chunk:
    root, inputs, folders = _files(scene, data)
    command: Json = {
        "do": "check",
        "file": "package" if scene.kind == "zip" else root,
        "kind": scene.kind,
        "entry": None,
        "limits": asdict(limits),
    }
    return Chunk(chunk_id, "check", command, inputs, folders, load_cpu_s=limits.check_cpu_s)


def _files(scene: Scene, data: DataDirectory) -> tuple[str, dict[str, Path], dict[str, Path]]:
    """The root layer's name, files and folders; Problem where the scene's bytes are gone."""
    folder = data.scene(scene.id)
    if scene.kind == "zip":
        _require(folder / "package")
        return "", {}, {"package": folder / "package"}
    _require(folder / "upload")
    return f"scene.{scene.kind}", {f"scene.{scene.kind}": folder / "upload"}, {}


def _require(path: Path) -> None:
    if not path.exists():
        raise Problem("internal", "The scene's files are not on the server any more; upload it again.")


def _entry(job: Job, scene: Scene) -> str:
    entry = job.entry or scene.facts.get("entry")
    if not isinstance(entry, str):
        raise Problem("ambiguous-entry", "The package has several root layers; say which as `entry`.")
    return entry


def render_settings(asked: Mapping[str, object], frame: Frame, capacity: Capacity) -> RenderSettings:
    """The library's settings of a job's (models.Settings), for one frame."""
    from ..models import Settings

    settings = Settings.model_validate(asked, strict=False)
    stop = settings.stop
    early = stop.target_error is not None or stop.max_seconds is not None
    return RenderSettings(
        camera=settings.camera,
        resolution=settings.resolution,
        time_code=frame.time_code,
        spp=stop.max_samples if early or stop.max_samples is not None else DEFAULT_SPP,
        target_error=stop.target_error,
        error_metric=Metric(stop.metric),
        time_limit_s=stop.max_seconds,
        adaptive=settings.adaptive,
        max_depth=settings.max_depth,
        filter=Filter(settings.filter),
        filter_width=settings.filter_width,
        threads=capacity.threads,
        seed=settings.seed,
        default_light=settings.default_light,
        purposes=_tuple(settings.purposes),
        strict=settings.strict,
        max_memory_bytes=capacity.memory_bytes,
        **({} if settings.dicing_rate is None else {"dicing_rate": settings.dicing_rate}),
        variants=tuple(settings.variants),
        load=_tuple(settings.load),
        mask=_tuple(settings.mask),
    )


def _tuple(values: list[str] | None) -> tuple[str, ...] | None:
    return None if values is None else tuple(values)


def _time_left(settings: Json, spent_s: float) -> float | None:
    """The renderer counts the seconds of one run; those of earlier chunks of the same attempt come off here."""
    most = settings.get("stop", {}).get("max_seconds")
    return None if most is None else max(float(most) - spent_s, LEAST_S)


# ---- what outputs are called ------------------------------------------------------------------------------------------------


def worker_names() -> tuple[str, ...]:
    return "beauty.exr", "beauty.png", "report.json"


def output_name(name: str, job: Job, frame: Frame, frames: int) -> str:
    """A job's name for what a worker calls `name`. Jobs of several frames have the time code in it; later attempts have their
    number, since what a name once meant may be kept by whoever fetched it."""
    stem, dot, suffix = name.lower().partition(".")
    attempt = f"-{job.attempt}" if job.attempt > 1 else ""
    code = f".{_code_text(frame)}" if frames > 1 else ""
    return f"{stem}{attempt}{code}{dot}{suffix}"


def _code_text(frame: Frame) -> str:
    """ "0012", "-003", "0012.500"; the frame's place where it has no time code."""
    code = float(frame.number) if frame.time_code is None else frame.time_code
    if code == int(code):
        return f"{int(code):04d}"
    return f"{code:08.3f}"
