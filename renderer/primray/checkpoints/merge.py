"""Checkpoints of disjoint samples of one picture, merged to the picture and checkpoint of one render that took them all.

Needs no stage: what an image and its report say of the scene is in the checkpoints.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from .. import core
from ..diagnostics import Diagnostics
from ..errors import CheckpointError
from ..images.image import Image, pixels_sha256
from ..report.report import Costs, header_of, make_report, settings_as_json, usable_threads
from ..sampling.sampling import Sampling
from ..sampling.schedule import Schedule
from ..settings import RenderSettings, settings_of_json
from .checkpoint import Checkpoint, Range, check, compare, contents, gaps, load
from .checkpoint_file import write_checkpoint

# What is told of the samples that are merged, anew each time.
OF_SAMPLES = ("samples-missing", "invalid-samples", "aovs-not-merged")


@dataclass(frozen=True)
class Merged:
    image: Image
    header: dict[str, Any]
    arrays: dict[str, Any]

    @property
    def time_code(self) -> float | None:
        """Of the frame that they are parts of; None where none was asked for."""
        found = self.header["settings"]["time_code"]
        return None if found is None else float(found)

    def save_checkpoint(self, path: Path) -> None:
        write_checkpoint(path, self.header, self.arrays)


def merge(paths: Sequence[Path]) -> Merged:
    """CheckpointError, naming the file, unless all are whole parts of the same picture and no sample is in two of them."""
    for path in paths:
        check(path)
    costs = Costs()
    with costs.stage("render"):
        sampling, held, ranges = _gather(paths)
        sampling.run()  # takes no sample: they are all there; measures
        pixels, errors = sampling.film.image()
    diagnostics = _diagnostics(sampling, held, ranges)
    about = replace(held[0].about, diagnostics=diagnostics, settings=settings_as_json(sampling.settings))
    says = {"isa": core.isa(), "lanes": core.lanes(), "versions": core.versions(), "features": about.features}
    report = make_report(sampling, costs, about.counts, diagnostics, says, pixels_sha256(pixels), about.rendering_space)
    metadata = header_of(report)
    report |= {"frame": asdict(about.frame), "motion": about.motion}
    report |= {"parts": [str(path) for path in paths], "sample_ranges": [list(r) for r in ranges]}
    image = Image(pixels, report, metadata, about.camera, errors=errors, frame=about.frame, color_space=about.rendering_space)
    header, arrays = contents(sampling, about)
    if about.camera.diffusion.strength > 0:
        from ..diffusing.diffuse import with_diffusion

        image = with_diffusion(image)
    return Merged(image, header | {"ranges": [list(r) for r in ranges]}, arrays)


def _gather(paths: Sequence[Path]) -> tuple[Sampling, list[Checkpoint], tuple[Range, ...]]:
    """The films as one, loaded one after the other; the checkpoints without their films; the samples that are there."""
    held: list[Checkpoint] = []
    taken: list[tuple[Range, Path]] = []
    film: core.Film | None = None
    for path in paths:
        part = load(path)
        about = part.about
        scene = core.CoreScene(None, about.camera.exposure_scale, [], part.resolution, rendering_space=about.rendering_space)
        if held:
            compare(part.about, held[0].about, path)
        _check_part(part, held)
        for span in part.ranges:
            _check_overlap(span, path, taken)
            taken.append((span, path))
        if film is None:
            film = core.Film(scene, part.film)
        else:
            film.merge(core.Film(scene, part.film))
        held.append(replace(part, film={}))
    assert film is not None
    ranges = _joined([span for span, _ in taken])
    done, seconds = ranges[-1][1], sum(part.seconds for part in held)
    schedule = Schedule(_settings(held[0], ranges), resumable=True, earlier_seconds=seconds, earlier_done=done)
    sampling = Sampling(scene, film, held[0].splits, schedule, done=done, seconds=seconds, earlier_rays=film.rays)
    sampling.busy_lanes, sampling.shaded_lanes = (sum(part.lanes[i] for part in held) for i in range(2))
    return sampling, held, ranges


def _check_part(part: Checkpoint, held: Sequence[Checkpoint]) -> None:
    if part.under_way:
        raise _unfit("its samples are not complete: resume it first", part.path)
    if part.adaptive:
        raise _unfit("its sampling is adaptive: its pixels do not have the same samples", part.path)
    if held and held[0].splits != part.splits:
        raise _unfit("its paths were split otherwise", part.path)
    if held and held[0].screen_block != part.screen_block:
        raise _unfit("one of them is a quick look of up to 3 samples, which others cannot follow", part.path)


def _check_overlap(span: Range, path: Path, taken: Sequence[tuple[Range, Path]]) -> None:
    for (a, b), other in taken:
        if max(a, span[0]) < min(b, span[1]):
            shared = f"{max(a, span[0])}:{min(b, span[1])}"
            raise _unfit(f"samples {shared} are in {other.name} too", path)


def _unfit(how: str, path: Path) -> CheckpointError:
    return CheckpointError(f"the checkpoint cannot be merged: {how}", where=str(path), code="checkpoint-merge")


def _joined(ranges: Sequence[Range]) -> tuple[Range, ...]:
    """Sorted, those that touch made one."""
    found: list[Range] = []
    for a, b in sorted(ranges):
        if found and found[-1][1] == a:
            found[-1] = (found[-1][0], b)
        elif a < b or not found:
            found.append((a, b))
    return tuple(found)


def _settings(part: Checkpoint, ranges: tuple[Range, ...]) -> RenderSettings:
    """Those of one render of all the samples; with gaps, of the range that they span."""
    first, end = ranges[0][0], ranges[-1][1]
    whole = len(ranges) == 1 and first == 0
    try:
        return settings_of_json(
            {
                **part.about.settings,
                "spp": end if whole else None,
                "sample_range": None if whole else [first, end],
                "target_error": None,
                "time_limit_s": None,
                "adaptive": None,
                "threads": usable_threads(),
            }
        )
    except (TypeError, ValueError) as error:
        raise _unfit("its settings are those of another version", part.path) from error


def _diagnostics(sampling: Sampling, held: Sequence[Checkpoint], ranges: tuple[Range, ...]) -> list[dict[str, str]]:
    own = Diagnostics()
    missing = ([(0, ranges[0][0])] if ranges[0][0] > 0 else []) + gaps(ranges)
    if missing:
        spans = ", ".join(f"{a}:{b}" for a, b in missing)
        own.add("samples-missing", "", f"samples {spans} are in none of the parts")
    asked = sorted({name for part in held for name in part.about.aovs})
    if asked:
        own.add("aovs-not-merged", "", f"{', '.join(asked)} are not in the checkpoints that were merged")
    film = sampling.film
    if film.invalid_samples:
        own.add("invalid-samples", "", f"{film.invalid_samples} of {film.samples} samples are left out")
    rows = [row for part in held for row in part.about.diagnostics if row.get("code") not in OF_SAMPLES]
    rows += [diagnostic.as_json() for diagnostic in own]
    return list({tuple(row.items()): row for row in rows}.values())
