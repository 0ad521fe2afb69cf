"""`verify`: renders a pinned picture again, all of it or random tiles, and finds the first difference to its lock.

What is compared, in this order: the signature, if one is asked for, the lock's seals, inputs, settings, the picture's file,
what reaches the core by prim, and pixels. Versions, the build and the ISA class may differ without a difference in
pixels; where pixels differ, they are to blame.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ..arrays import Floats
from ..diagnostics import Diagnostics
from ..errors import PrimrayError, RenderCancelled, SettingsError
from ..images.image import pixels_sha256
from ..render.interruption import interruption
from ..render.progress import shown_progress
from ..report.report import Costs
from ..settings import RenderSettings
from .attestation import difference_of_attestation
from .difference import Difference, differences_between
from .inputs import environment, files_of, hashes, hashes_now, settings_for_lock, settings_of_lock, versions, with_real_folder
from .lock import SHORT, Lock, Picture
from .pinning import hashes_of_aovs, prepared_for

if TYPE_CHECKING:
    from ..report.prepared import Prepared
    from ..sampling.sampling import Progress

SHOWN = 3  # prims that a sentence names


@dataclass(frozen=True)
class Verification:
    """What verification found. `difference`: the first one, None where all that was looked at is as it was pinned.

    >>> pinned = primray.pin("shot.usda", resolution=(32, 18), spp=2)
    >>> found = primray.verify(pinned.file, share=0.5)
    >>> found.difference is None, len(found.tiles), found.of
    (True, 2, 4)

    `tiles`: those of `of` whose bits were rendered again, with all samples; `pixels`: how many pixels they have. `file`: the
    EXR that was compared bit by bit, if there is one. `notes`: what differs although no pixel does, and what was not looked at.
    """

    difference: Difference | None
    tiles: tuple[int, ...] = ()
    of: int = 0
    pixels: int = 0
    samples: int = 0
    file: str | None = None
    notes: tuple[str, ...] = ()
    ranges: tuple[tuple[int, int, int], ...] = ()  # tile, first sample and the one after the last, that were rendered alone

    @property
    def is_whole(self) -> bool:
        return self.difference is None and len(self.tiles) == self.of

    def chance_to_miss(self, share: float) -> float:
        """Return the chance that tiles chosen like these are all right in a picture of which this share of tiles is not."""
        if self.is_whole:
            return 0.0
        return (1 - share) ** len(self.tiles)

    def as_json(self) -> dict[str, Any]:
        return {
            "same": self.difference is None,
            "difference": None if self.difference is None else self.difference.as_json(),
            "tiles": len(self.tiles),
            "of": self.of,
            "pixels": self.pixels,
            "samples": self.samples,
            "ranges": [list(each) for each in self.ranges],
            "file": self.file,
            "notes": list(self.notes),
        }


def verify(
    lock: str | os.PathLike[str],
    *,
    share: float = 1.0,
    ranges: bool = False,
    seed: int | None = None,
    stage: str | os.PathLike[str] | None = None,
    picture: str | os.PathLike[str] | Literal[False] | None = None,
    key: str | os.PathLike[str] | None = None,
    attestation: str | os.PathLike[str] | None = None,
    threads: int | None = None,
    progress: Progress | Literal[False] | None = None,
) -> Verification:
    """Render a random share of a pinned picture's tiles again, each with all its samples, and compare the bits.

    >>> lock = primray.pin("shot.usda", resolution=(32, 18), spp=2).file
    >>> primray.verify(lock).is_whole
    True

    `share`: 1 renders all of them, and compares AOVs too; 0 renders none, and compares inputs and the picture's file. `ranges`:
    of each chosen tile only a range of samples is rendered, that of the pass of a random sample, and compared with the lock's
    hash of it. `seed` chooses the tiles; None: others each time. `stage` and `picture` are paths where the files are not where
    the lock says, such as a picture that another machine, farm or service made. False: no file is compared. `key`, a PEM file
    with an Ed25519 public key, is the one that must have signed the attestation; None: no signature is asked for.
    `attestation`: None is beside the lock.
    """
    if not 0 <= share <= 1:
        raise SettingsError(f"a share is 0 to 1, not {share:g}", where="share", code="verify-share")
    place = Path(lock)
    if seed is not None and seed < 0:
        raise SettingsError(f"a seed is 0 or more, not {seed}", where="seed", code="verify-seed")
    found, broken = Lock.read(place)
    root = with_real_folder(with_real_folder(place).parent / found.stage if stage is None else Path(stage))
    if not root.is_file():
        raise SettingsError("there is no such stage; --stage names where it is", where=str(root), code="verify-stage")
    file = _file(found, place, picture)
    unsigned = None if key is None else difference_of_attestation(found, place, key, attestation)
    with shown_progress(progress) as shown:
        return _Verifier(found, root, file, threads, shown).run(broken, unsigned, share, ranges, seed)


def _file(lock: Lock, place: Path, picture: str | os.PathLike[str] | Literal[False] | None) -> Path | None:
    if picture is False or (picture is None and lock.file is None):
        return None
    return with_real_folder(place).parent / str(lock.file) if picture is None else Path(picture)


class _Found(Exception):
    """The first difference."""

    def __init__(self, difference: Difference) -> None:
        super().__init__(str(difference))
        self.difference = difference


class _Verifier:
    def __init__(self, lock: Lock, stage: Path, file: Path | None, threads: int | None, progress: Progress | None) -> None:
        self.lock, self.stage, self.file, self.progress = lock, stage, file, progress
        self.picture: Picture = lock.picture
        self.notes: list[str] = []
        self.softer: list[Difference] = []
        self.tiles: tuple[int, ...] = ()
        self.ranges: tuple[tuple[int, int, int], ...] = ()
        self.suspects: tuple[int, ...] = ()  # tiles whose bits in the file are not those of the lock
        self.stored: Floats | None = None
        self.stored_aovs: dict[str, str] = {}  # hashes of those that the file has with all of their bits
        self.settings = self._settings(threads)

    def _settings(self, threads: int | None) -> RenderSettings:
        try:
            return replace(settings_of_lock(self.lock.settings, self.stage.parent), threads=threads)
        except (TypeError, ValueError) as error:
            raise SettingsError(f"the lock has settings of another version: {error}", code="lock-unreadable") from None

    def run(
        self, broken: Sequence[str], unsigned: Difference | None, share: float, ranges: bool, seed: int | None
    ) -> Verification:
        try:
            if unsigned is not None:
                raise _Found(unsigned)
            if broken:
                raise _Found(Difference("lock", f"section {broken[0]}", "its seal", "other contents"))
            self._compare_inputs()
            self._compare_versions()
            self._read_file()
            if ranges:
                self._compare_ranges(share, seed)
            else:
                self._compare_pixels(share, seed)
            difference = None
        except _Found as found:
            difference = found.difference
        notes = (
            [*(f"the same pixels, though {each}" for each in self.softer), *self.notes] if difference is None else self.notes
        )
        ends = self.picture.ends()
        boxes = [self.picture.box(tile) for tile in self.tiles]
        sizes = [(rows.stop - rows.start) * (columns.stop - columns.start) for rows, columns in boxes]
        return Verification(
            difference=difference,
            tiles=self.tiles,
            of=len(self.picture.tiles),
            pixels=sum(sizes),
            samples=sum(int(ends[:, tile].sum()) * size for tile, size in zip(self.tiles, sizes, strict=True)),
            ranges=self.ranges,
            file=None if self.stored is None else str(self.file),
            notes=tuple(notes),
        )

    def _compare_inputs(self) -> None:
        """Find the first file that is not as it was, and which prims it changes."""
        folder = self.stage.parent
        named = hashes_now(self.lock.inputs, folder)
        for difference in differences_between(
            "input", self.lock.inputs, named | hashes(files_of(self.stage, self.settings), folder)
        ):
            raise _Found(replace(difference, what=f"{difference.what}{self._effect()}"))

    def _effect(self) -> str:
        """Return which prims changed with the inputs, as words after a file's name."""
        try:
            prepared, steps = prepared_for(self.stage, self.settings, Costs(), Diagnostics())
        except PrimrayError as error:
            return f" (it cannot be rendered: {error.message})"
        changed = [each.what for each in differences_between("scene", self._things(), steps.things)]
        if not changed and self._digests(prepared) == self._digests():
            return " (nothing that is rendered changes)"
        more = f" and {len(changed) - SHOWN} more" if len(changed) > SHOWN else ""
        return f" (it changes {', '.join(changed[:SHOWN]) or 'the scene'}{more})"

    def _things(self) -> dict[str, str]:
        return {name: digest for name, digest in self.lock.scene.items() if not name.startswith("all ")}

    def _digests(self, prepared: Prepared | None = None) -> dict[str, str]:
        if prepared is not None:
            return {f"all {name}": digest for name, digest in prepared.fingerprint.items()}
        return {name: digest for name, digest in self.lock.scene.items() if name.startswith("all ")}

    def _compare_versions(self) -> None:
        from .. import core

        self.softer += differences_between("isa", {"class of the core": self.lock.isa}, {"class of the core": core.isa()})
        self.softer += differences_between("version", self.lock.versions, versions())
        self.softer += differences_between("environment", self.lock.environment, environment())

    def _read_file(self) -> None:
        """Read the picture's file, and find the tiles in which it is not the picture that was pinned."""
        from ..images.reading import read_image

        if self.file is None:
            self.notes.append("no file of the picture was compared")
            return
        if not self.file.exists():
            raise _Found(Difference("picture", str(self.file), "there", None))
        try:
            image = read_image(self.file)
            pixels = image.pixels
        except PrimrayError as error:
            raise _Found(Difference("picture", str(self.file), "readable", error.message)) from None
        if pixels.shape[1::-1] != self.picture.resolution:
            raise _Found(
                Difference("picture", f"{self.file}: resolution", list(self.picture.resolution), list(pixels.shape[1::-1]))
            )
        self.stored = pixels
        wanted = enumerate(self.picture.tiles)
        self.suspects = tuple(tile for tile, digest in wanted if pixels_sha256(pixels[self.picture.box(tile)]) != digest)
        exact = {name: aov for name, aov in image.aovs.items() if aov.stored != "half"}
        self.stored_aovs = hashes_of_aovs(exact)
        lost = [name for name in self.lock.aovs if name not in exact]
        if lost:
            self.notes.append(f"{self.file} does not have all bits of {', '.join(lost)}")
        if unknown := [name for name in image.aovs if name not in self.lock.aovs]:
            self.notes.append(f"{self.file} also has {', '.join(unknown)}, of which the lock says nothing")

    def _compare_pixels(self, share: float, seed: int | None) -> None:
        chosen = self._chosen(share, seed)
        prepared = self._prepared()
        if len(chosen) < len(self.picture.tiles) and not self.suspects:
            self._compare_aovs_of_file()
        if not chosen:
            if self.suspects:
                raise _Found(self._of_file(self.suspects[0], None))
            self.notes.append("no pixel was rendered again")
            return
        with interruption() as asked:
            self._asked = asked
            pixels = self._rendered(prepared, chosen, self.picture.ends())
        for tile in chosen:
            self._compare_tile(prepared, tile, pixels[self.picture.box(tile)])
        self.tiles = chosen
        if len(chosen) == len(self.picture.tiles):
            self._compare_whole(prepared, pixels)
        elif self.lock.aovs:
            self.notes.append("AOVs were not compared, which takes the whole picture")

    def _compare_ranges(self, share: float, seed: int | None) -> None:
        """Render of random tiles the samples of one pass each, which that of a random sample is."""
        if self.suspects:
            raise _Found(self._of_file(self.suspects[0], None))
        random = np.random.default_rng(seed)
        count = len(self.picture.tiles)
        chosen = sorted(random.choice(count, math.ceil(share * count), replace=False).tolist())
        prepared = self._prepared()
        self._compare_aovs_of_file()
        if not chosen or not self.picture.passes:
            self.notes.append("no pixel was rendered again")
            return
        with interruption() as asked:
            self._asked = asked
            for tile in chosen:
                ends = [self._range(k, tile)[1] for k in range(len(self.picture.passes))]
                number = min(int(np.searchsorted(ends, random.integers(max(ends[-1], 1)), side="right")), len(ends) - 1)
                first, end = self._range(number, tile)
                if not self._is_range_right(prepared, number, tile):
                    what = f"{self._name(tile)}, samples {first} to {end}"
                    raise _Found(self._blamed(Difference("pixels", what, "the lock's hash of them", "other bits")))
                self.ranges += ((tile, first, end),)

    def _chosen(self, share: float, seed: int | None) -> tuple[int, ...]:
        """Return random tiles, and one in which the file differs, which tells whether file or lock is wrong."""
        count = len(self.picture.tiles)
        random = np.random.default_rng(seed)
        chosen = random.choice(count, math.ceil(share * count), replace=False).tolist()
        return tuple(sorted({*chosen, *(self.suspects[:1] if share > 0 else ())}))

    def _prepared(self) -> Prepared:
        """Return the scene, if settings and prims are what they were."""
        prepared, steps = prepared_for(self.stage, self.settings, Costs(), Diagnostics())
        now = settings_for_lock(prepared.settings, self.stage.parent)
        for difference in differences_between("setting", self.lock.settings, now):
            raise _Found(self._blamed(difference))
        for difference in differences_between("scene", self._things(), steps.things):
            raise _Found(self._blamed(difference))
        for difference in differences_between("scene", self._digests(), self._digests(prepared)):
            raise _Found(self._blamed(difference))
        return prepared

    def _rendered(self, prepared: Prepared, tiles: Sequence[int], ends: Any, begins: Any = None) -> Floats:
        """Return pixels of which these tiles have these samples, from 0 on or from `begins`."""
        from .. import core

        if begins is None:
            film = self._film = core.Film(prepared.scene, settings=prepared.settings)
        else:
            film = self._film = core.Film.begun_at(prepared.scene, begins, prepared.settings)
        splits = core.choose_splits(prepared.scene, prepared.settings)
        if tuple(splits) != self.picture.splits:
            raise _Found(self._blamed(Difference("pixels", "splitting factors", list(self.picture.splits), list(splits))))
        wanted = np.zeros_like(ends) if begins is None else begins.copy()
        wanted[:, list(tiles)] = ends[:, list(tiles)]

        def poll(fraction: float) -> bool:
            stops = self.progress is not None and self.progress(fraction, film.samples, film.rays) is False
            return not stops and not self._asked.asked

        done = core.render_pass(prepared.scene, film, wanted, splits, prepared.settings, poll)
        if done.interrupted:
            if self._asked.asked:
                raise KeyboardInterrupt
            raise RenderCancelled("the verification was stopped by its progress callback")
        return film.image()[0]

    def _compare_tile(self, prepared: Prepared, tile: int, rendered: Floats) -> None:
        digest = pixels_sha256(rendered)
        stored = None if self.stored is None else self.stored[self.picture.box(tile)]
        if digest == self.picture.tiles[tile]:
            if tile in self.suspects:
                raise _Found(self._of_file(tile, rendered))
            return
        before, now = self.picture.tiles[tile], digest
        if stored is not None and np.array_equal(stored.view(np.uint32), rendered.view(np.uint32)):
            what = f"hash of {self._name(tile)}: the picture's file and the render have the same bits, which are not the lock's"
            raise _Found(Difference("lock", what, before, now))
        where = self._samples(prepared, tile)
        if stored is not None and tile not in self.suspects:
            pixel = self._first_pixel(tile, stored, rendered)
            raise _Found(self._blamed(Difference("pixels", f"{pixel}, {where}", *self._values(tile, stored, rendered))))
        raise _Found(self._blamed(Difference("pixels", f"{self._name(tile)}, {where}", before, now)))

    def _samples(self, prepared: Prepared, tile: int) -> str:
        """Return in which samples a tile differs: of which passes of the pinned render."""
        wrong = [self._range(k, tile) for k in range(len(self.picture.passes)) if not self._is_range_right(prepared, k, tile)]
        if wrong:
            return f"samples {' and '.join(f'{first} to {end}' for first, end in wrong)}"
        last = int(self.picture.ends(self.picture.passes[-1].counts)[:, tile].sum()) if self.picture.passes else 0
        return f"samples after {last}" if last < int(self.picture.ends()[:, tile].sum()) else "hash of all samples alone"

    def _range(self, number: int, tile: int) -> tuple[int, int]:
        """Return the samples of a tile that a pass took: the first, and the one after the last."""
        picture = self.picture
        first, end = (
            int(counts[:, tile].sum()) for counts in (picture.begins(number), picture.ends(picture.passes[number].counts))
        )
        return first, end

    def _is_range_right(self, prepared: Prepared, number: int, tile: int) -> bool:
        """Return whether the samples of a tile that a pass took have the bits of the lock, rendered alone."""
        first, end = self._range(number, tile)
        if first == end:
            return True
        ends = self.picture.ends(self.picture.passes[number].counts)
        pixels = self._rendered(prepared, [tile], ends, self.picture.begins(number))
        digest = pixels_sha256(pixels[self.picture.box(tile)])
        return digest[:SHORT] == self.picture.hash_of_range(number, tile)

    def _of_file(self, tile: int, rendered: Floats | None) -> Difference:
        assert self.stored is not None
        count = f" ({len(self.suspects)} tiles differ)" if len(self.suspects) > 1 else ""
        if rendered is None:
            box = self.stored[self.picture.box(tile)]
            return Difference(
                "picture", f"{self.file}: {self._name(tile)}{count}", self.picture.tiles[tile], pixels_sha256(box)
            )
        stored = self.stored[self.picture.box(tile)]
        what = f"{self.file}: {self._first_pixel(tile, rendered, stored)}{count}"
        return Difference("picture", what, *self._values(tile, rendered, stored))

    def _first(self, one: Floats, other: Floats) -> tuple[int, int]:
        y, x = np.argwhere((one.view(np.uint32) != other.view(np.uint32)).any(axis=2))[0]
        return int(y), int(x)

    def _first_pixel(self, tile: int, one: Floats, other: Floats) -> str:
        y, x = self._first(*map(np.ascontiguousarray, (one, other)))
        rows, columns = self.picture.box(tile)
        return f"pixel {columns.start + x + self.picture.origin[0]}, {rows.start + y + self.picture.origin[1]}"

    def _values(self, tile: int, before: Floats, now: Floats) -> tuple[list[float], list[float]]:
        y, x = self._first(*map(np.ascontiguousarray, (before, now)))
        return before[y, x].tolist(), now[y, x].tolist()

    def _name(self, tile: int) -> str:
        rows, columns = self.picture.box(tile)
        x, y = self.picture.origin
        return f"pixels {columns.start + x}:{columns.stop + x}, {rows.start + y}:{rows.stop + y}"

    def _compare_whole(self, prepared: Prepared, pixels: Floats) -> None:
        from ..images.image import pixels_sha256
        from ..render.render import find_aovs
        from ..sampling.sampling import Sampling

        if (whole := pixels_sha256(pixels)) != self.picture.pixels_sha256:
            raise _Found(Difference("lock", "pixels_sha256: all tiles are the same", self.picture.pixels_sha256, whole))
        if not self.lock.aovs:
            return
        sampling = Sampling.begin(prepared.scene, prepared.settings)
        sampling.film = self._film
        aovs, _ = find_aovs(prepared, sampling, Costs(), Diagnostics())
        now = hashes_of_aovs(aovs)
        for difference in differences_between("pixels", self.lock.aovs, now):
            name = difference.what
            if name in now and self.stored_aovs.get(name) == now[name]:
                what = f"hash of AOV {name}: the picture's file and the render have the same values, which are not the lock's"
                raise _Found(replace(difference, kind="lock", what=what))
            raise _Found(self._blamed(replace(difference, what=f"AOV {name}")))
        self._compare_aovs_of_file()

    def _compare_aovs_of_file(self) -> None:
        """Find the first AOV of the picture's file that is not the one that was pinned."""
        pinned = {name: self.lock.aovs[name] for name in self.stored_aovs if name in self.lock.aovs}
        for difference in differences_between("picture", pinned, {name: self.stored_aovs[name] for name in pinned}):
            raise _Found(replace(difference, what=f"{self.file}: AOV {difference.what}"))

    def _blamed(self, difference: Difference) -> Difference:
        """Return the version or ISA class that differs in place of what differs with it."""
        if not self.softer:
            return (
                difference if difference.kind != "pixels" else replace(difference, what=f"{difference.what} (code or machine)")
            )
        first = self.softer[0]
        return replace(first, what=f"{first.what} ({difference.kind} {difference.what} differ)")
