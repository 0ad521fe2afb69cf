"""Merging of checkpoints with disjoint samples to the picture and checkpoint of one render that took all samples.

Parts are summed up one after another, and each film is released once it is added. No stage is needed: everything that an image
and its report say about the scene is in the checkpoints.
"""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from .. import core
from ..denoising.denoiser import Guides, has_denoiser
from ..diagnostics import UNFINISHED as PICTURE_UNFINISHED
from ..diagnostics import Diagnostics, kept_without
from ..errors import CheckpointError
from ..images.aov import Aov
from ..images.image import Image, pixels_sha256
from ..images.light_path_aovs import light_paths_of
from ..report.report import Costs, header_of, make_report, subject_of, usable_threads
from ..sampling.mix_weights import mix_weights
from ..sampling.sampling import Sampling
from ..sampling.schedule import Schedule
from ..settings import RenderSettings, StopAt, settings_as_json, settings_of_json
from ..settings.light_mixes import NO_MIXES
from .aov_data import AovData, aovs_of_data, merged_aov_data
from .checkpoint import Checkpoint, Range, check, compare, contents, gaps, load
from .checkpoint_file import write_checkpoint

# Diagnostics about the merged samples, which each merge reports again.
OF_SAMPLES = ("samples-missing", "invalid-samples", "aovs-not-merged", "display-error-unknown", PICTURE_UNFINISHED)


@dataclass(frozen=True)
class Merged:
    image: Image
    header: dict[str, Any]
    arrays: dict[str, Any]

    @property
    def time_code(self) -> float | None:
        """Time code of the frame that the parts belong to; None: the stage's default time."""
        found = self.header["settings"]["time_code"]
        return None if found is None else float(found)

    def save_checkpoint(self, path: Path) -> None:
        write_checkpoint(path, self.header, self.arrays)


def merge(paths: Sequence[Path]) -> Merged:
    """Merge checkpoints; CheckpointError, naming the file, unless all are complete parts of one picture without overlap."""
    costs = Costs()
    with costs.stage("render"):
        gathering = merged_parts(paths)
        sampling = gathering.sampling(gathering.settings(rules_for_all(gathering.ranges)))
        sampling.run()  # takes no sample: they are all there; measures
    return picture_of_parts(gathering, sampling, costs, {"parts": [str(path) for path in paths]})


def merged_parts(paths: Sequence[Path]) -> MergedParts:
    """Return the sum of checkpoints; raise CheckpointError as `merge` does."""
    for path in paths:
        check(path)
    gathering = MergedParts()
    for path in paths:
        gathering.add(path)
    return gathering


def rules_for_all(ranges: tuple[Range, ...]) -> dict[str, Any]:
    """Return the stopping rules of one render of all these samples; with gaps, of the range that they span."""
    first, end = ranges[0][0], ranges[-1][1]
    whole = len(ranges) == 1 and first == 0
    spans = {"spp": end if whole else None, "sample_range": None if whole else [first, end]}
    return spans | {"target_error": None, "time_limit_s": None, "adaptive": None}


def picture_of_parts(gathering: MergedParts, sampling: Sampling, costs: Costs, says: Mapping[str, Any]) -> Merged:
    """Return the picture and checkpoint of a sampling of parts that has ended; `says` is added to the report."""
    pixels, errors = sampling.film.image()
    kept, own, found = gathering.beside, Diagnostics(), dict[str, Aov]()
    if sampling.view_fault:
        own.add("display-error-unknown", "", sampling.view_fault)
    with costs.stage("aovs"):
        with kept_without("the AOV data of the parts", own):
            found |= {} if kept is None else aovs_of_data(kept, sampling.film)
        with kept_without("the light path output", own):
            found |= light_paths(gathering, sampling)
        aovs = {name: found[name] for name in gathering.held[0].about.aovs if name in found}
    denoises = sampling.settings.denoises and kept is not None and kept.guides is not None and has_denoiser()
    diagnostics = _diagnostics(sampling, gathering, {*aovs, *(["denoised"] if denoises else [])}, own)
    about = replace(gathering.held[0].about, diagnostics=diagnostics, settings=settings_as_json(sampling.settings), beside=kept)
    ranges = [list(r) for r in gathering.ranges]
    core_says = {"isa": core.isa(), "lanes": core.lanes(), "versions": core.versions(), "features": about.features}
    report = make_report(sampling, costs, about.counts, diagnostics, core_says, pixels_sha256(pixels), about.rendering_space)
    metadata = header_of(report) | subject_of(about.stage, about.camera)
    report["aovs"] = {name: aov.as_json() for name, aov in aovs.items()}
    report |= {"labels": dict(kept.labels)} if kept is not None and kept.labels else {}
    report |= {"frame": asdict(about.frame), "motion": about.motion} | dict(says) | {"sample_ranges": ranges}
    camera, frame, space = about.camera, about.frame, about.rendering_space
    image = Image(pixels, report, metadata, camera, errors=errors, frame=frame, aovs=aovs, color_space=space, file=about.file)
    after = Diagnostics()
    if denoises and kept is not None and kept.guides is not None:
        with kept_without("the denoised picture", after):
            image = _denoised(image, kept.guides, sampling, costs)
    header, arrays = contents(sampling, about)
    if about.camera.diffusion.strength > 0:
        from ..images.glare import with_diffusion

        with kept_without("the diffused picture", after):
            image = with_diffusion(image)
    diagnostics += [diagnostic.as_json() for diagnostic in after]
    return Merged(image, header | {"ranges": ranges}, arrays)


def light_paths(gathering: MergedParts, sampling: Sampling) -> dict[str, Aov]:
    """Return the light path outputs that films hold, by name."""
    held = gathering.held[0].about.light_paths
    if held is None:
        return {}
    return light_paths_of(held.requests, held.expressions, held.members, sampling.film)


def _denoised(image: Image, guides: Guides, sampling: Sampling, costs: Costs) -> Image:
    from ..denoising.denoised import Denoising, with_denoised

    assert image.camera is not None
    with costs.stage("denoise"):
        return with_denoised(image, Denoising(guides, image.camera.exposure_scale, sampling.settings).of(sampling.film))


def _diagnostics(sampling: Sampling, gathering: MergedParts, made: Container[str], own: Diagnostics) -> list[dict[str, str]]:
    """Return the parts' diagnostics, and `own`, with those found here added to it."""
    held, ranges = gathering.held, gathering.ranges
    missing = ([(0, ranges[0][0])] if ranges[0][0] > 0 else []) + gaps(ranges)
    if missing:
        spans = ", ".join(f"{a}:{b}" for a, b in missing)
        own.add("samples-missing", "", f"samples {spans} are in none of the parts")
    asked = sorted({name for part in held for name in part.about.aovs})
    asked += ["denoised"] if any(part.about.settings.get("denoise") for part in held) else []
    missing_names = [name for name in asked if name not in made]
    if missing_names:
        own.add("aovs-not-merged", "", f"{', '.join(missing_names)} are not in the checkpoints that were merged")
    film = sampling.film
    if film.invalid_samples:
        own.add("invalid-samples", "", f"{film.invalid_samples} of {film.samples} samples are left out")
    rows = [row for part in held for row in part.about.diagnostics if row.get("code") not in OF_SAMPLES]
    rows += [diagnostic.as_json() for diagnostic in own]
    return list({tuple(row.items()): row for row in rows}.values())


class MergedParts:
    """The sum of the parts that arrived so far. `held`: the parts, without their films."""

    def __init__(self) -> None:
        self.held: list[Checkpoint] = []
        self._taken: list[tuple[Range, Path]] = []
        self._scene: core.CoreScene | None = None
        self._film: core.Film | None = None
        self.beside: AovData | None = None  # merged data for AOVs and the denoiser

    def add(self, path: Path) -> Checkpoint:
        """Add a part; CheckpointError, naming the file, unless it is complete, of the same picture, and has new samples."""
        part = load(path)
        about = part.about
        scene = core.CoreScene(None, about.camera.exposure_scale, [], part.resolution, rendering_space=about.rendering_space)
        if self.held:
            compare(part.about, self.held[0].about, path)
        self._check(part)
        film = core.Film(scene, part.film)
        if self._film is None:
            self._scene, self._film, self.beside = scene, film, about.beside
        else:
            self._film.merge(film)
            self.beside = merged_aov_data(self.beside, about.beside)
        self._taken += [(span, path) for span in part.ranges]
        self.held.append(replace(part, film={}, about=replace(about, beside=None)))
        return self.held[-1]

    def _check(self, part: Checkpoint) -> None:
        if part.under_way:
            raise merge_error("its samples are not complete: resume it first", part.path)
        if part.adaptive:
            raise merge_error("its sampling is adaptive: its pixels do not have the same samples", part.path)
        if self.held and self.held[0].splits != part.splits:
            raise merge_error("its paths have other splitting factors", part.path)
        if self.held and self.held[0].screen_block != part.screen_block:
            raise merge_error("one of them is a quick look of up to 3 samples, which cannot be merged", part.path)
        for span in part.ranges:
            _check_overlap(span, part.path, self._taken)

    @property
    def ranges(self) -> tuple[Range, ...]:
        """Ranges of samples that have been added."""
        return _merged_ranges([span for span, _ in self._taken])

    @property
    def counts(self) -> tuple[int, int]:
        """Number of samples and of rays."""
        return (0, 0) if self._film is None else (self._film.samples, self._film.rays)

    @property
    def seconds(self) -> float:
        """Seconds of sampling, over all parts."""
        return sum(part.seconds for part in self.held)

    def settings(self, ending: Mapping[str, Any]) -> RenderSettings:
        """Return the parts' settings, with the stopping rules of `ending`."""
        part = self.held[0]
        values = {**part.about.settings, **ending, "threads": usable_threads()}
        if values.get("target_error") is None and values.get("stop_at") == StopAt.MIX.value:
            values |= NO_MIXES
        try:
            return settings_of_json(values)
        except (TypeError, ValueError) as error:
            raise merge_error("its settings come from another version of primray", part.path) from error

    def sampling(self, settings: RenderSettings) -> Sampling:
        """Return the sampling of one render that took all of these samples and ends as the settings say; it shares the film."""
        assert self._film is not None
        assert self._scene is not None
        done, seconds, film = self.ranges[-1][1], self.seconds, self._film
        schedule = Schedule(settings, resumable=True, earlier_seconds=seconds, earlier_done=done)
        sampling = Sampling(
            self._scene, film, self.held[0].splits, schedule, done=done, seconds=seconds, earlier_rays=film.rays
        )
        held = self.held[0].about.light_paths
        sampling.mixes = mix_weights(settings, held.requests, held.expressions) if held else mix_weights(settings, (), ())
        sampling.busy_lanes, sampling.shaded_lanes = (sum(part.lanes[i] for part in self.held) for i in range(2))
        return sampling


def _check_overlap(span: Range, path: Path, taken: Sequence[tuple[Range, Path]]) -> None:
    for (a, b), other in taken:
        if max(a, span[0]) < min(b, span[1]):
            shared = f"{max(a, span[0])}:{min(b, span[1])}"
            raise merge_error(f"samples {shared} are also in {other.name}", path)


def merge_error(how: str, path: Path) -> CheckpointError:
    return CheckpointError(f"the checkpoint cannot be merged: {how}", where=str(path), code="checkpoint-merge")


def _merged_ranges(ranges: Sequence[Range]) -> tuple[Range, ...]:
    """Return the ranges sorted, with adjacent ones merged."""
    found: list[Range] = []
    for a, b in sorted(ranges):
        if found and found[-1][1] == a:
            found[-1] = (found[-1][0], b)
        elif a < b or not found:
            found.append((a, b))
    return tuple(found)
