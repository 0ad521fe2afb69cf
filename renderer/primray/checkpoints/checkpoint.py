"""Checkpoint: the complete state of a render in one file. A resumed render has the bits of an uninterrupted one.

A checkpoint holds the film, the range of samples taken, measurements of the error and the plan of adaptive sampling; and the
render's identity, everything that decides about pixels: settings, the scene's contents, the ISA class and the core's build.
Stopping rules (samples, target error, time limit), threads and outputs are no part of the identity.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from .. import core
from ..camera import Camera, camera_as_json, camera_of
from ..color.color_space import REC709, ColorSpace, is_gamut
from ..description import Frame, PixelWindow
from ..description.picture_file import PLAIN, PictureFile, picture_file_of_json
from ..errors import CheckpointError
from ..sampling.adaptive import DOUBLINGS, Plan
from ..sampling.error import ErrorCurve, ErrorRow, Estimate, FrameError, MixError
from ..sampling.sampling import Sampling
from ..sampling.schedule import Schedule
from ..settings import BIAS, MAX_RESOLUTION, MAX_SPP, SAMPLE_BLOCK, Counts, Metric, RenderSettings, rows, settings_as_json
from .aov_data import AovData, LightPaths, aov_data_of_contents, contents_of_aov_data, light_paths_of_json
from .checkpoint_file import Arrays, read_checkpoint, read_header

REPLICATES, COLORS = 2, 3
SPLITS = ((1, 2, 4, 8), (1, 2, 4))  # what core.choose_splits returns; other values are refused
BINS = (-4, 3)  # exact_sum.hpp: kLowestBin, and the bin of the largest float

# Settings that decide about pixels after translation, and those that decide what is translated.
OF_PIXELS = (Counts.PIXELS, Counts.BIAS)
OF_SCENE = (Counts.SCENE, Counts.STAGING)

BESIDE = "beside."  # prefix of the names of arrays kept for AOVs and the denoiser
PLAN_ARRAYS = ("begin", "order", "levels", "spent")

Range = tuple[int, int]


@dataclass(frozen=True)
class CheckpointInfo:
    """A checkpoint's data besides the sampling: the render's identity, and what a report and an EXR's header contain."""

    identity: Mapping[str, Any]
    settings: Mapping[str, Any]
    camera: Camera
    frame: Frame
    counts: Mapping[str, int]
    features: list[dict[str, str]]
    diagnostics: list[dict[str, str]]
    aovs: tuple[str, ...] = ()  # names of the AOVs that the render makes: from the scene, not from data held here
    rendering_space: ColorSpace = REC709
    motion: Mapping[str, Any] | None = None  # the report's facts about motion
    stage: str = ""  # the root layer's file name
    light_paths: LightPaths | None = None  # the light path expressions in the film
    beside: AovData | None = None  # data for AOVs and the denoiser that a part keeps
    file: PictureFile = PLAIN  # what the stage's product requests of the EXR


@dataclass(frozen=True)
class Checkpoint:
    """A checkpoint as read, not yet compared with the render it is for."""

    path: Path
    about: CheckpointInfo
    ranges: tuple[Range, ...]  # the complete samples of each pixel
    under_way: bool  # a pass is unfinished: some pixels have more samples
    adaptive: bool
    splits: core.Splits
    screen_block: int  # not 0 for a quick look
    seconds: float
    lanes: tuple[int, int]  # busy, shaded
    rows: tuple[ErrorRow, ...]
    target: tuple[float | None, str]  # the target and its metric, for which rows were due
    plan: Plan | None
    film: Arrays

    @property
    def resolution(self) -> tuple[int, int]:
        """Resolution of the film."""
        return self.about.frame.size

    def curve(self, target_error: float | None, metric: Metric) -> ErrorCurve:
        """Return the measured error curve for a render with this target; rows that were due for another target are not due."""
        same_target = self.target == (target_error, metric.value)
        return ErrorCurve(metric, tuple(replace(row, due=row.due and same_target) for row in self.rows))


def identity(settings: RenderSettings, scene: Mapping[str, str]) -> dict[str, Any]:
    """Return what renders of the same pixels have in common, by names that errors can show; `settings` are resolved."""
    values = settings_as_json(settings)
    return {
        "isa": core.isa(),
        "core": core.build_digest(),
        **core.versions(),
        **{row.name: values[row.name] for row in rows(type(settings)) if row.counts in OF_PIXELS and row.name in values},
        **{f"scene.{name}": digest for name, digest in scene.items()},
    }


def contents(sampling: Sampling, about: CheckpointInfo) -> tuple[dict[str, Any], Arrays]:
    """Return the header and arrays of a checkpoint, as copies, so that sampling can continue while they are written."""
    settings, plan, film = sampling.settings, sampling.plan, sampling.film.state()
    first = settings.sample_range[0] if settings.sample_range else 0
    rows = [asdict(replace(row, error=replace(row.error, tiles=np.zeros(0)))) for row in sampling.rows]
    for row in rows:
        del row["error"]["tiles"]
    header: dict[str, Any] = {
        "identity": dict(about.identity),
        "settings": dict(about.settings),
        "camera": camera_as_json(about.camera),
        "frame": asdict(about.frame),
        "counts": dict(about.counts),
        "features": about.features,
        "diagnostics": about.diagnostics,
        "aovs": list(about.aovs),
        "rendering_space": asdict(about.rendering_space),
        "motion": about.motion,
        "stage": about.stage,
        "light_paths": None if about.light_paths is None else about.light_paths.as_json(),
        "ranges": [[first, sampling.done]],
        "under_way": sampling.goal is not None,
        "adaptive": settings.adapts,
        "splits": sampling.splits,
        "screen_block": settings.screen_block,
        "seconds": sampling.seconds,
        "lanes": [sampling.busy_lanes, sampling.shaded_lanes],
        "rows": rows,
        "target": [settings.target_error, settings.metric.value],
        "plan": None if plan is None else plan.samples,
    }
    arrays = {f"film.{name}": array for name, array in film.items()}
    if sampling.rows:
        arrays["tiles"] = np.stack([row.error.tiles for row in sampling.rows[_last_anchor(sampling.rows) :]])
    if plan is not None:
        arrays |= {f"plan.{name}": getattr(plan, name) for name in PLAN_ARRAYS}
    if about.file != PLAIN:
        header["file"] = about.file.as_json()
    if about.beside is not None:
        header["beside"], kept = contents_of_aov_data(about.beside)
        arrays |= {f"{BESIDE}{name}": array for name, array in kept.items()}
    return header, arrays


def _last_anchor(rows: Sequence[ErrorRow]) -> int:
    """Return the index of the first row whose tile errors may still be needed."""
    anchors = [i for i, row in enumerate(rows) if row.anchor]
    return anchors[-1] if anchors else len(rows) - 1


def load(path: Path) -> Checkpoint:
    """Read a checkpoint; CheckpointError if there is none, or it is not valid."""
    header, arrays = read_checkpoint(path)
    try:
        return _checkpoint(path, header, arrays)
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise CheckpointError(
            "the checkpoint is damaged: its header is not valid", where=str(path), code="checkpoint-damaged"
        ) from error


def check(path: Path) -> None:
    """Raise CheckpointError if the file's header shows that it cannot be used here; cheap, before the scene is translated."""
    found = read_header(path).get("identity")
    if not isinstance(found, dict):
        raise CheckpointError("the checkpoint is damaged: its header is not valid", where=str(path), code="checkpoint-damaged")
    here = {"isa": core.isa(), "core": core.build_digest(), **core.versions()}
    _compare({name: found.get(name) for name in here}, here, path)


def _checkpoint(path: Path, header: dict[str, Any], arrays: Arrays) -> Checkpoint:
    frame = frame_of_json(header["frame"])
    width, height = frame.size
    ranges = tuple((int(a), int(b)) for a, b in header["ranges"])
    _require(bool(ranges) and all(0 <= a <= b <= MAX_SPP for a, b in ranges))
    tiles = math.ceil(width / core.TILE) * math.ceil(height / core.TILE)
    kept = {name.removeprefix(BESIDE): array for name, array in arrays.items() if name.startswith(BESIDE)}
    beside = aov_data_of_contents(header["beside"], kept, frame.size) if header.get("beside") is not None else None
    film = {name.removeprefix("film."): array for name, array in arrays.items() if name.startswith("film.")}
    light_paths = light_paths_of_json(header["light_paths"])
    settings = dict(header["settings"])
    _check_film(film, width, height, tiles, 0 if light_paths is None else len(light_paths.expressions), settings)
    plan = _plan(int(header["plan"]), arrays, width * height, tiles) if header["plan"] is not None else None
    splits = core.Splits(*header["splits"])
    busy, shaded = header["lanes"]
    _require(all(n in known for n, known in zip(splits, SPLITS, strict=True)) and 0 <= int(busy) <= int(shaded) < 2**63)
    _require(_is_number(header["seconds"]))
    target, metric = header["target"]
    return Checkpoint(
        path=path,
        about=CheckpointInfo(
            identity=dict(header["identity"]),
            settings=settings,
            camera=camera_of(header["camera"]),
            frame=frame,
            counts=dict(header["counts"]),
            features=list(header["features"]),
            diagnostics=[dict(row) for row in header["diagnostics"]],
            aovs=tuple(str(name) for name in header["aovs"]),
            rendering_space=_space_of(header["rendering_space"]),
            motion=_motion_of(header["motion"]),
            stage=_text_of(header["stage"]),
            light_paths=light_paths,
            beside=beside,
            file=PLAIN if header.get("file") is None else picture_file_of_json(header["file"]),
        ),
        ranges=ranges,
        under_way=bool(header["under_way"]),
        adaptive=bool(header["adaptive"]),
        splits=splits,
        screen_block=int(header["screen_block"]),
        seconds=float(header["seconds"]),
        lanes=(int(busy), int(shaded)),
        rows=_rows(header["rows"], arrays, tiles),
        target=(None if target is None else float(target), Metric(metric).value),
        plan=plan,
        film=film,
    )


def _require(holds: bool) -> None:
    if not holds:
        raise ValueError


def _motion_of(value: Any) -> dict[str, Any] | None:
    return None if value is None else dict(value)


def _is_number(value: Any) -> bool:
    return math.isfinite(float(value)) and float(value) >= 0


def _check_film(film: Arrays, width: int, height: int, tiles: int, expressions: int, settings: Mapping[str, Any]) -> None:
    pixels = (REPLICATES, height, width)
    shapes: dict[str, tuple[str, tuple[int, ...]]] = {
        "parts": ("<i8", (*pixels, COLORS, 2)),
        "bins": ("|i1", (*pixels, COLORS)),
        "counts": ("<u4", pixels),
        "covered": ("<i8", pixels),
        "next": ("<u4", (REPLICATES, tiles)),
        "tile_rays": ("<i8", (tiles,)),
        "totals": ("<i8", (5,)),
    }
    if expressions:
        shapes["routed"] = ("<i8", (expressions, *pixels, COLORS, 2))
    for why, name in core.REMOVALS.items():
        if settings.get(name, BIAS[name]) != BIAS[name]:
            shapes |= {why: ("<i8", (*pixels, COLORS, 2)), f"{why}_bins": ("|i1", (*pixels, COLORS))}
    _require({name: (array.dtype.str, array.shape) for name, array in film.items()} == shapes)
    bins = [array for name, array in film.items() if name.endswith("bins")]
    _require(all(BINS[0] <= array.min() and array.max() <= BINS[1] for array in bins))
    _require(film["next"].max() <= 4 * MAX_SPP)


def _plan(samples: int, arrays: Arrays, pixels: int, tiles: int) -> Plan:
    found = {name: arrays[f"plan.{name}"] for name in PLAN_ARRAYS}
    lengths = {"begin": tiles, "order": tiles * DOUBLINGS, "levels": tiles * DOUBLINGS, "spent": tiles * DOUBLINGS}
    _require({name: (a.dtype.str, a.shape) for name, a in found.items()} == {n: ("<i8", (k,)) for n, k in lengths.items()})
    begin, order, levels, spent = found.values()
    _require(0 < samples <= MAX_SPP and begin.min() >= 0 and begin.max() <= MAX_SPP)
    _require(order.min() >= 0 and order.max() < tiles and levels.min() >= 0 and levels.max() < DOUBLINGS)
    _require(np.bincount(order).max() <= DOUBLINGS and spent.min() >= 0 and bool((np.diff(spent) >= 0).all()))
    return Plan(samples=samples, begin=begin, order=order, levels=levels, spent=spent, pixels=pixels)


def _rows(rows: Sequence[Mapping[str, Any]], arrays: Arrays, tiles: int) -> tuple[ErrorRow, ...]:
    """Return the measurements; only the last ones have tile errors."""
    if not rows:
        return ()
    errors = arrays["tiles"]
    _require(errors.dtype.str == "<f8" and errors.ndim == 2 and errors.shape[1] == tiles and 1 <= len(errors) <= len(rows))
    without = len(rows) - len(errors)
    found = tuple(_row(row, errors[i - without] if i >= without else np.zeros(0)) for i, row in enumerate(rows))
    _require(_last_anchor(found) >= without)
    return found


def _row(row: Mapping[str, Any], tiles: npt.NDArray[np.float64]) -> ErrorRow:
    found = {metric: row["error"][metric.value] for metric in Metric}
    estimates = {
        metric.value: None if e is None else Estimate(float(e["value"]), float(e["low"]), float(e["high"]))
        for metric, e in found.items()
    }
    for number in (row["samples"], row["seconds"], *(v for e in found.values() if e is not None for v in e.values())):
        _require(_is_number(number))
    _require(float(row["samples"]) > 0)
    relmse, rmse = estimates["relmse"], estimates["rmse"]
    if relmse is None or rmse is None:
        raise ValueError
    error = FrameError(relmse, rmse, tiles, estimates["display"], _mix_error(row["error"].get("mix")))
    return ErrorRow(float(row["samples"]), float(row["seconds"]), error, bool(row["anchor"]), bool(row["due"]))


def _mix_error(found: Mapping[str, Any] | None) -> MixError | None:
    if found is None:
        return None
    numbers = [[float(found[metric][name]) for name in ("value", "low", "high")] for metric in ("relmse", "rmse")]
    _require(all(_is_number(number) for estimate in numbers for number in estimate) and int(found["worst"]) >= 0)
    return MixError(Estimate(*numbers[0]), Estimate(*numbers[1]), int(found["worst"]))


def _space_of(values: Mapping[str, Any]) -> ColorSpace:
    red, green, blue, white = ((float(x), float(y)) for x, y in (values[k] for k in ("red", "green", "blue", "white")))
    space = ColorSpace(str(values["name"]), red, green, blue, white)
    _require(is_gamut(space))
    return space


def resumed_settings(settings: RenderSettings, checkpoint: Checkpoint) -> RenderSettings:
    """Return the settings with adaptive sampling as in the checkpoint, where they leave it open."""
    if settings.adaptive is None and settings.sample_range is None and settings.adapts != checkpoint.adaptive:
        return replace(settings, adaptive=checkpoint.adaptive)
    return settings


def resume(scene: core.CoreScene, settings: RenderSettings, about: CheckpointInfo, checkpoint: Checkpoint) -> Sampling:
    """Return the sampling as the checkpoint left it; CheckpointError, naming differences, if it is of another picture."""
    compare(checkpoint.about, about, checkpoint.path)
    if settings.adapts != checkpoint.adaptive:
        is_, was = ("adaptive", "uniform") if settings.adapts else ("uniform", "adaptive")
        raise _mismatch(f"its sampling is {was}, not {is_}", checkpoint.path)
    _check_range(settings, checkpoint)
    if checkpoint.screen_block != settings.screen_block and checkpoint.ranges[0][1] < settings.most_samples:
        # A quick look draws samples in another way. Its few samples are worth less than mixing both would cost.
        return Sampling.begin(scene, settings)
    done = checkpoint.ranges[0][1]
    schedule = Schedule(settings, earlier_seconds=checkpoint.seconds, earlier_done=done)
    sampling = Sampling(scene, core.Film(scene, checkpoint.film), checkpoint.splits, schedule)
    sampling.done = done
    sampling.plan = checkpoint.plan
    sampling.curve = checkpoint.curve(settings.target_error, settings.metric)
    sampling.busy_lanes, sampling.shaded_lanes = checkpoint.lanes
    sampling.seconds, sampling.earlier_rays = checkpoint.seconds, sampling.film.rays
    if checkpoint.under_way:
        sampling.aim()
    return sampling


def _check_range(settings: RenderSettings, checkpoint: Checkpoint) -> None:
    held, path = checkpoint.ranges, checkpoint.path
    if len(held) > 1:
        raise _mismatch(f"samples {', '.join(f'{a}:{b}' for a, b in gaps(held))} are missing from it; merge them first", path)
    first, end = held[0]
    wanted, most = settings.sample_range or (0, MAX_SPP)
    if first != wanted:
        how = f"resume it with --sample-range {first}:..." if first else "resume it without --sample-range, or with one from 0"
        raise _mismatch(f"its samples begin at {first}, not at {wanted}; {how}", path)
    reached = max(end, int(checkpoint.film["next"].max()) * SAMPLE_BLOCK) if checkpoint.under_way else end
    if reached > most:
        raise _mismatch(f"it has samples up to {reached}, beyond the end of the range at {most}", path)


def gaps(ranges: tuple[Range, ...]) -> list[Range]:
    """Return the samples that are missing between sorted ranges."""
    return [(a[1], b[0]) for a, b in pairwise(ranges) if a[1] < b[0]]


def compare(held: CheckpointInfo, wanted: CheckpointInfo, path: Path) -> None:
    """Raise CheckpointError, naming differences, unless both are of the same picture and the same compiled core."""
    if held.identity == wanted.identity:
        return
    of_scene = [row.name for row in rows(RenderSettings) if row.counts in OF_SCENE]
    hints = [name for name in of_scene if held.settings.get(name) != wanted.settings.get(name)]
    _compare(held.identity, wanted.identity, path, hints)


def _text_of(value: Any) -> str:
    _require(isinstance(value, str))
    return str(value)


def _compare(held: Mapping[str, Any], wanted: Mapping[str, Any], path: Path, hints: list[str] | None = None) -> None:
    found: list[str] = []
    scene = []
    for name in dict.fromkeys([*wanted, *held]):
        was, now = held.get(name), wanted.get(name)
        if was == now:
            continue
        if name.startswith("scene."):
            scene.append(name.removeprefix("scene."))
        else:
            found.append(f"{name.replace('_', ' ')} is {_shown(was)} in the checkpoint and {_shown(now)} here")
    if scene:
        by = f" (by {', '.join(hints)}?)".replace("_", " ") if hints else ""
        found.append(
            f"the scene's {' and '.join(scene)} {'have' if scene == ['lights'] or len(scene) > 1 else 'has'} changed{by}"
        )
    if found:
        raise _mismatch("; ".join(found), path)


def _shown(value: Any) -> str:
    if isinstance(value, list):
        return " x ".join(map(str, value))
    return "none" if value is None else str(value)[:80]


def _mismatch(how: str, path: Path) -> CheckpointError:
    return CheckpointError(f"the checkpoint is of another render: {how}", where=str(path), code="checkpoint-other")


def frame_of_json(values: Mapping[str, Any]) -> Frame:
    """Return the frame; ValueError, KeyError or TypeError if the JSON is not valid."""
    width, height = values["resolution"]
    window = [values["pixels"][name] for name in ("x", "y", "width", "height")]
    aspect = float(values["pixel_aspect_ratio"])
    _require(all(type(n) is int and 0 < n <= MAX_RESOLUTION for n in (width, height, *window[2:])))
    _require(all(type(n) is int and abs(n) <= MAX_RESOLUTION for n in window[:2]) and 0 < aspect < math.inf)
    return Frame((width, height), PixelWindow(*window), aspect)
