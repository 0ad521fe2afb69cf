"""Parts of one picture summed up: each part's film is loaded when it arrives, added, and released."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from .. import core
from ..errors import CheckpointError
from ..report.report import usable_threads
from ..sampling.sampling import Sampling
from ..sampling.schedule import Schedule
from ..settings import RenderSettings, settings_of_json
from .checkpoint import Checkpoint, Range, compare, load
from .kept_beside import KeptBeside, joined


class Gathering:
    """The sum of the parts that arrived so far. `held`: the parts, without their films."""

    def __init__(self) -> None:
        self.held: list[Checkpoint] = []
        self._taken: list[tuple[Range, Path]] = []
        self._scene: core.CoreScene | None = None
        self._film: core.Film | None = None
        self.beside: KeptBeside | None = None  # merged data for AOVs and the denoiser

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
            self.beside = joined(self.beside, about.beside)
        self._taken += [(span, path) for span in part.ranges]
        self.held.append(replace(part, film={}, about=replace(about, beside=None)))
        return self.held[-1]

    def _check(self, part: Checkpoint) -> None:
        if part.under_way:
            raise unfit("its samples are not complete: resume it first", part.path)
        if part.adaptive:
            raise unfit("its sampling is adaptive: its pixels do not have the same samples", part.path)
        if self.held and self.held[0].splits != part.splits:
            raise unfit("its paths have other splitting factors", part.path)
        if self.held and self.held[0].screen_block != part.screen_block:
            raise unfit("one of them is a quick look of up to 3 samples, which cannot be merged with other samples", part.path)
        for span in part.ranges:
            _check_overlap(span, part.path, self._taken)

    @property
    def ranges(self) -> tuple[Range, ...]:
        """Ranges of samples that have been added."""
        return _joined([span for span, _ in self._taken])

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
        try:
            return settings_of_json({**part.about.settings, **ending, "threads": usable_threads()})
        except (TypeError, ValueError) as error:
            raise unfit("its settings come from another version of primray", part.path) from error

    def sampling(self, settings: RenderSettings) -> Sampling:
        """Return the sampling of one render that took all of these samples and ends as the settings say; it shares the film."""
        assert self._film is not None
        assert self._scene is not None
        done, seconds, film = self.ranges[-1][1], self.seconds, self._film
        schedule = Schedule(settings, resumable=True, earlier_seconds=seconds, earlier_done=done)
        sampling = Sampling(
            self._scene, film, self.held[0].splits, schedule, done=done, seconds=seconds, earlier_rays=film.rays
        )
        sampling.busy_lanes, sampling.shaded_lanes = (sum(part.lanes[i] for part in self.held) for i in range(2))
        return sampling


def _check_overlap(span: Range, path: Path, taken: Sequence[tuple[Range, Path]]) -> None:
    for (a, b), other in taken:
        if max(a, span[0]) < min(b, span[1]):
            shared = f"{max(a, span[0])}:{min(b, span[1])}"
            raise unfit(f"samples {shared} are also in {other.name}", path)


def unfit(how: str, path: Path) -> CheckpointError:
    return CheckpointError(f"the checkpoint cannot be merged: {how}", where=str(path), code="checkpoint-merge")


def _joined(ranges: Sequence[Range]) -> tuple[Range, ...]:
    """Return the ranges sorted, with adjacent ones merged."""
    found: list[Range] = []
    for a, b in sorted(ranges):
        if found and found[-1][1] == a:
            found[-1] = (found[-1][0], b)
        elif a < b or not found:
            found.append((a, b))
    return tuple(found)
