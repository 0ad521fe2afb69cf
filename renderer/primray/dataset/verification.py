"""Verification of a data set: renders a random share of its samples again, and finds the first difference to its lock file."""

from __future__ import annotations

import math
import os
import secrets
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..content_hash import hash_of_array
from ..errors import PrimrayError, SettingsError
from ..pinned.difference import Difference
from .config import Config
from .draws import Draws
from .ledger import finished, hashes_of, record_of, sample_folder, sample_name
from .lock_file import CONFIG, Lock, lock_of, read_lock
from .packing import read_integers
from .sampler import Sampler


@dataclass(frozen=True)
class Verification:
    """What verification found. `difference`: the first one, None where all is as it was; `samples`: those that were rendered.

    `notes`: versions or an ISA class that differ though all pixels that were rendered are the same.
    """

    difference: Difference | None
    samples: tuple[int, ...]
    notes: tuple[str, ...] = ()


def verify(
    folder: str | os.PathLike[str],
    *,
    share: float = 0.01,
    seed: int | None = None,
    inputs: str | os.PathLike[str] | None = None,
    threads: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Verification:
    """Render a random share of a data set's samples again, at least one, and compare their pixels with the lock file.

    >>> primray.dataset.verify("suns", share=0.5).difference is None
    True

    Inputs are looked at first, then settings, the files of all samples, and then pixels. `inputs` is the folder of the config's
    relative files where it is not where it was. `seed` chooses the samples; None: others each time.
    """
    if not 0 < share <= 1:
        raise SettingsError(f"a share is above 0 and at most 1, not {share:g}", where="share", code="dataset-verify")
    place = Path(folder)
    lock = read_lock(place)
    if lock is None or not lock.samples:
        raise SettingsError("there is no complete data set", where=str(place), code="dataset-incomplete")
    config = _config_of(place, lock, None if inputs is None else Path(inputs))
    found, softer = _first_difference(config, lock, place)
    if found is not None:
        return Verification(found, ())
    names = sorted(lock.samples)
    chosen = _chosen(len(names), share, secrets.randbits(63) if seed is None else seed)
    with tempfile.TemporaryDirectory(prefix="primray-dataset-") as scratch:
        sampler = Sampler(config, threads=threads, scratch=Path(scratch), classes=lock.classes)
        try:
            for k, index in enumerate(chosen):
                difference = _difference_of_sample(sampler, index, lock, place)
                if difference is not None:
                    return Verification(_blamed(difference, softer), tuple(chosen[: k + 1]))
                if progress is not None:
                    progress(k + 1, len(chosen))
        finally:
            sampler.close()
    return Verification(None, tuple(chosen), tuple(map(str, softer)))


def _config_of(folder: Path, lock: Lock, inputs: Path | None) -> Config:
    path = folder / CONFIG
    where = (folder / lock.folder).resolve() if inputs is None else inputs
    try:
        return Config.parse(path.read_text(encoding="utf-8"), where, CONFIG)
    except OSError as error:
        raise SettingsError(f"it cannot be read: {error.strerror}", where=str(path), code="dataset-damaged") from None


def _first_difference(config: Config, lock: Lock, folder: Path) -> tuple[Difference | None, list[Difference]]:
    """Return the first difference of inputs, settings and files; and those of versions and ISA, which pixels may survive."""
    softer = []
    for difference in lock.differences(lock_of(config, folder)):
        if difference.kind in ("input", "setting"):
            return difference, []
        softer.append(difference)
    there = {sample_name(index) for index in finished(folder)}
    for name in sorted(lock.samples):
        if name not in there:
            return Difference("pixels", f"of sample {name}", "there", None), []
    return None, softer


def _chosen(count: int, share: float, seed: int) -> list[int]:
    wanted = max(1, math.ceil(share * count))
    return sorted(Draws(seed, 0, "verification").shuffled(range(count))[:wanted])


def _difference_of_sample(sampler: Sampler, index: int, lock: Lock, folder: Path) -> Difference | None:
    """Return how a sample differs from what is rendered now: in its record, what was drawn, its pixels, or its files."""
    name, kept = sample_name(index), record_of(folder, index)
    locked = dict(lock.samples[name])
    if hashes_of(kept) != locked:
        return Difference("pixels", f"of sample {name}, in its sample.json", locked, hashes_of(kept))
    image, now = sampler.render(index)
    for what, before in kept["varied"].items():
        if now["varied"].get(what) != before:
            return Difference("setting", f"vary.{what} of sample {name}", before, now["varied"].get(what))
    for what, digest in locked.items():
        if hashes_of(now).get(what) != digest:
            return Difference("pixels", f"of sample {name}, {what}", digest, hashes_of(now).get(what))
    return _difference_of_files(image, kept, sample_folder(folder, index))


def _difference_of_files(image: Any, kept: Mapping[str, Any], place: Path) -> Difference | None:
    """Return which of a sample's files does not hold the pixels that were rendered again."""
    for what, file in kept["files"].items():
        path = place / file
        if not path.exists():
            return Difference("pixels", str(path), "there", None)
        try:
            if what == "picture":
                shown = image.to_uint8()
                stored = read_integers(path)
                same = np.array_equal(stored, shown[..., : stored.shape[2]])
            elif what in image.aovs:
                same = hash_of_array(np.load(path, allow_pickle=False)) == kept["aovs_sha256"][what]
            else:
                continue
        except (OSError, ValueError, PrimrayError) as error:
            return Difference("pixels", str(path), "readable", str(error))
        if not same:
            return Difference("pixels", str(path), "as rendered", "other values")
    return None


def _blamed(difference: Difference, softer: list[Difference]) -> Difference:
    """Return the version or ISA class that differs in place of the pixels that differ with it."""
    if difference.kind != "pixels" or not softer:
        return difference
    return replace(softer[0], what=f"{softer[0].what} (pixels {difference.what} differ)")
