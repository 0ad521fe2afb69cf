"""Parts of machines that are not trusted: random tiles of each are rendered again here, before the part is merged.

A part is a film, whose pixels are sums of all of its samples: a sum cannot be checked for some of its samples, but a pixel can
be rendered with all of them. Tiles are drawn by a secret and the part's hash, once the part is here: who rendered it cannot
know them, and cannot exchange it. What an accepted part says of the scene (camera, settings, diagnostics) is this machine's.

A part in which a share c of the tiles is wrong passes m tiles with a chance of at most (1 - c)^m: docs/untrusted-machines.md
has what a cheat costs and saves.
"""

from __future__ import annotations

import secrets
import shutil
from collections import Counter
from collections.abc import Callable
from concurrent.futures import Future, InvalidStateError, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import numpy.typing as npt

from .. import core
from ..aovs import light_path_of
from ..checkpoints.aov_data import aov_data_of
from ..checkpoints.checkpoint import Checkpoint, contents, load
from ..checkpoints.checkpoint_file import write_checkpoint
from ..checkpoints.checkpointing import begin
from ..content_hash import hash_of_file
from ..diagnostics import Diagnostics
from ..errors import CheckpointError, PrimrayError, SettingsError
from ..render.prepare import open_once, prepare
from ..report.report import Costs
from ..settings import BIAS, SAMPLE_BLOCK, RenderSettings
from .executor import PartLost, PartsWithdrawn
from .planner import Range, seed_of

if TYPE_CHECKING:
    from ..checkpoints.aov_data import AovData
    from ..report.prepared import Prepared

DEFAULT_TILES = 32
OTHER_BUILD = ("isa", "core", "embree", "embreex")


class WorkersExecutor(Protocol):
    """A PartsExecutor whose parts come from workers with names, which may be excluded."""

    def begin(self, stage: str) -> None: ...

    def slots(self) -> int: ...

    def submit(self, settings: RenderSettings, file: Path) -> Future[str]:
        """Render the part to `file`; the result is the worker's name."""

    def exclude(self, worker: str) -> None:
        """Give a worker no more parts."""

    def end(self) -> None: ...


@dataclass(frozen=True)
class RefusedPart:
    """A part that does not have the bits of a render here, whether its worker cheats, or has bad memory or another build.

    `accepted`: how many parts of the worker were accepted before.
    """

    worker: str
    part: Range
    why: str
    accepted: int


def chance_to_pass(tiles: int, wrong: int, checked: int) -> float:
    """Return the chance that none of `checked` random tiles is among the `wrong` ones of `tiles`."""
    found = 1.0
    for k in range(min(checked, tiles)):
        found *= max(tiles - wrong - k, 0) / (tiles - k)
    return found


def drawn_by(secret: bytes, sha256: str, part: Range) -> np.random.Generator:
    return np.random.default_rng(seed_of(secret, sha256, part))


class SpotChecked:
    """Executor of parts of machines that are not trusted. It accepts those whose random tiles have the bits of a render here.

    `tiles`: how many are rendered of each part. A worker of a part that is refused gets no more, and the frame begins again
    without it if parts of it were accepted before. `refused` has what was found. Pictures have no outputs beside them but
    light paths: these would come from the parts unchecked.
    """

    def __init__(
        self,
        executor: WorkersExecutor,
        *,
        tiles: int = DEFAULT_TILES,
        secret: bytes | None = None,
        threads: int | None = None,
        on_refused: Callable[[RefusedPart], None] | None = None,
    ) -> None:
        if tiles < 1:
            raise SettingsError(f"the number of tiles must be 1 or more, not {tiles}", where="tiles", code="parts-setting")
        self.refused: list[RefusedPart] = []
        self.checked = 0  # parts
        self._executor, self._tiles, self._threads, self._on_refused = executor, tiles, threads, on_refused
        self._secret = secrets.token_bytes(32) if secret is None else secret
        self._excluded: set[str] = set()
        self._accepted: Counter[str] = Counter()  # in this frame
        self._stage = ""
        self._scene: tuple[RenderSettings, TrustedScene] | None = None
        self._checking: ThreadPoolExecutor | None = None

    def begin(self, stage: str) -> None:
        self._accepted.clear()
        if stage != self._stage:
            self._scene = None
        self._stage = stage
        self._checking = self._checking or ThreadPoolExecutor(1, "spot-checks")
        self._executor.begin(stage)

    def slots(self) -> int:
        return self._executor.slots()

    def submit(self, settings: RenderSettings, file: Path) -> Future[None]:
        mine: Future[None] = Future()
        left = file.with_name(f"{file.name}.unchecked")
        theirs = self._executor.submit(settings, left)
        mine.add_done_callback(lambda done: theirs.cancel() if done.cancelled() else None)
        checking = self._checking
        assert checking is not None
        theirs.add_done_callback(lambda done: _submit(checking, self._settle, settings, left, file, done, mine))
        return mine

    def end(self) -> None:
        self._executor.end()
        if self._checking is not None:
            self._checking.shutdown(cancel_futures=True)
            self._checking = None

    def _settle(self, settings: RenderSettings, left: Path, file: Path, theirs: Future[str], mine: Future[None]) -> None:
        """Set a part's future by what its check finds; called in the thread of checks."""
        if theirs.cancelled() or mine.cancelled():
            return
        try:
            self._take(settings, left, file, theirs.result())
        except BaseException as error:
            file.unlink(missing_ok=True)
            with suppress(InvalidStateError):
                mine.set_exception(error)
        else:
            with suppress(InvalidStateError):
                mine.set_result(None)
        finally:
            left.unlink(missing_ok=True)

    def _take(self, settings: RenderSettings, left: Path, file: Path, worker: str) -> None:
        """Check a part; PartLost if it is refused, PartsWithdrawn if parts of its worker were accepted before."""
        if worker in self._excluded:
            raise PartLost(f"{worker} is excluded")
        assert settings.sample_range is not None
        try:
            shutil.copyfile(left, file)  # what its worker cannot change any more
            part = load(file)
        except (OSError, CheckpointError) as error:
            raise PartLost(f"the part of {worker} cannot be read: {error}") from None
        scene = self._scene_for(settings)
        self.checked += 1
        random = drawn_by(self._secret, hash_of_file(file), settings.sample_range)
        why = scene.fault_of(part, settings.sample_range, random, self._tiles)
        if why is None:
            scene.write(part, settings.sample_range, file)
            self._accepted[worker] += 1
            return
        found = RefusedPart(worker, settings.sample_range, why, self._accepted[worker])
        self.refused.append(found)
        self._excluded.add(worker)
        self._executor.exclude(worker)
        if self._on_refused is not None:
            self._on_refused(found)
        sentence = f"samples {found.part[0]}:{found.part[1]} of {worker} are refused: {why}"
        raise PartsWithdrawn(sentence) if found.accepted else PartLost(sentence)

    def _scene_for(self, settings: RenderSettings) -> TrustedScene:
        """Return the scene here; only ranges of samples differ between parts."""
        of_all = replace(settings, sample_range=None, threads=self._threads)
        if self._scene is None or self._scene[0] != of_all:
            self._scene = of_all, TrustedScene(self._stage, replace(settings, threads=self._threads))
        return self._scene[1]


def _submit(checking: ThreadPoolExecutor, work: Callable[..., None], *args: Any) -> None:
    with suppress(RuntimeError):  # the frame has ended
        checking.submit(work, *args)


class TrustedScene:
    """The scene of a frame on this machine, on which tiles of parts are rendered again.

    `outputs_follow`: outputs beside the picture are made from the merged samples by a machine that is trusted, not from parts.
    """

    def __init__(self, stage: str, settings: RenderSettings, *, outputs_follow: bool = False) -> None:
        self._outputs_follow = outputs_follow
        self._diagnostics = Diagnostics()
        opened = open_once(stage, settings)
        self._prepared = prepare(opened.stage, opened.diagnostics, settings, Costs(), self._diagnostics, fingerprinted=True)
        beside = [request.name for request in self._prepared.aovs if light_path_of(request.source) is None]
        if not outputs_follow and (beside or self._prepared.settings.denoises):
            names = ", ".join([*beside, *(["the denoised picture"] if self._prepared.settings.denoises else [])])
            sentence = f"{names} would come unchecked from machines that are not trusted: render the picture alone"
            raise SettingsError(sentence, where="aovs", code="parts-setting")

    def _of(self, part: Range) -> Prepared:
        return replace(self._prepared, settings=replace(self._prepared.settings, sample_range=part))

    def fault_of(self, part: Checkpoint, span: Range, random: np.random.Generator, tiles: int) -> str | None:
        """Return why a part is not the one that was asked for, or None: all counts are compared, and the bits of some tiles."""
        prepared = self._of(span)
        sampling, about = begin(prepared, [], None)
        film = sampling.film
        for name in dict.fromkeys([*about.identity, *part.about.identity]):
            if part.about.identity.get(name) != about.identity.get(name):
                return f"it is of another {'build' if name in OTHER_BUILD else 'render'}: {name.replace('_', ' ')} differs"
        if part.ranges != (span,) or part.under_way or part.adaptive:
            return f"it has samples {', '.join(f'{a}:{b}' for a, b in part.ranges)}"
        if part.splits != sampling.splits or part.screen_block != prepared.settings.screen_block:
            return "its paths have other splitting factors"
        if not _is_bare(part.about.beside) or part.film.keys() != film.state().keys():
            return "it has other outputs"
        if any(part.film[name].shape != own.shape for name, own in film.state().items()):
            return "it is of another resolution"
        theirs = core.Film(prepared.scene, part.film)
        ends = core.uniform_ends(film, span[1])
        each = (ends - film.next)[:, 0].astype(np.uint32)
        if not np.array_equal(theirs.next, ends) or (theirs.counts != each[:, None, None]).any():
            return "its pixels do not have all of their samples"
        return self._fault_of_tiles(prepared, theirs, ends, random, tiles)

    def _fault_of_tiles(
        self, prepared: Prepared, theirs: core.Film, ends: npt.NDArray[np.uint32], random: np.random.Generator, tiles: int
    ) -> str | None:
        count = ends.shape[1]
        chosen = np.sort(random.choice(count, min(tiles, count), replace=False))
        own = self._rendered(prepared, ends, chosen)
        wrong = next((tile for tile in chosen if not _same(own, theirs, prepared, int(tile))), None)
        if wrong is None:
            return None
        again = self._rendered(prepared, ends, np.array([wrong]))
        if not _same(own, again, prepared, int(wrong)):
            raise PrimrayError("two renders of one tile on this machine differ: its memory is not sound", code="spot-check")
        rows, columns = _box(own, int(wrong))
        return f"pixels {columns.start}:{columns.stop}, {rows.start}:{rows.stop} do not have the bits of a render here"

    def _rendered(self, prepared: Prepared, ends: npt.NDArray[np.uint32], tiles: npt.NDArray[np.int64]) -> core.Film:
        film, span = core.Film(prepared.scene, settings=prepared.settings), prepared.settings.sample_range
        assert span is not None
        film.start_at(span[0] // SAMPLE_BLOCK)
        wanted = film.next.copy()
        wanted[:, tiles] = ends[:, tiles]
        splits = core.choose_splits(prepared.scene, prepared.settings)
        core.render_pass(prepared.scene, film, wanted, splits, prepared.settings)
        return film

    def write(self, part: Checkpoint, span: Range, file: Path) -> None:
        """Write an accepted part anew: its film, under what is known of the scene here."""
        prepared = self._of(span)
        sampling, about = begin(prepared, list(self._diagnostics), None)
        sampling.film = core.Film(prepared.scene, part.film)
        sampling.done, sampling.seconds = span[1], part.seconds
        sampling.busy_lanes, sampling.shaded_lanes = part.lanes
        beside = None if self._outputs_follow else aov_data_of(prepared, sampling)
        write_checkpoint(file, *contents(sampling, replace(about, beside=beside)))


def _is_bare(beside: AovData | None) -> bool:
    """Return whether a part has no outputs besides its film."""
    return beside is None or not (beside.fixed or beside.labels or beside.guides or beside.covered)


def _box(film: core.Film, tile: int) -> tuple[slice, slice]:
    columns, (width, height) = film.tiles[0], film.resolution
    x, y = tile % columns * core.TILE, tile // columns * core.TILE
    return slice(y, min(y + core.TILE, height)), slice(x, min(x + core.TILE, width))


def _same(one: core.Film, other: core.Film, prepared: Prepared, tile: int) -> bool:
    """Return whether a tile has the same bits in two films: both replicates, and all that is kept beside them."""
    return all(np.array_equal(a, b) for a, b in zip(*(_bits(film, prepared, tile) for film in (one, other)), strict=True))


def _bits(film: core.Film, prepared: Prepared, tile: int) -> list[npt.NDArray[np.uint8]]:
    rows, columns = _box(film, tile)
    found = [film.replicates[:, rows, columns], film.image()[0][rows, columns], film.image()[1][rows, columns]]
    if prepared.scene.light_paths is not None:
        found += [each[:, rows, columns] for each in film.light_path_images()]
    for why, name in core.REMOVALS.items():
        if getattr(prepared.settings, name) != BIAS[name]:
            found += [each[:, columns] for each in film.removed_rows(why, rows.start, rows.stop)]
    return [np.ascontiguousarray(each).view(np.uint8) for each in found]
