"""Making a data set: its lock, the samples that are missing, and what is packed of them at the end."""

from __future__ import annotations

import json
import os
import tempfile
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..errors import SettingsError
from .config import Config
from .ledger import finished, locked, remove_leftovers, write_durably
from .lock_file import CONFIG, Lock, lock_of, read_lock, with_samples, write_lock
from .packing import pack
from .sampler import Sampler
from .worker import order_of
from .workers import LocalWorkers, SampleExecutor

Progress = Callable[[int, int], None]  # samples that are done, and all


@dataclass(frozen=True)
class Made:
    """A data set that is complete. `rendered`: samples of this run; `diagnostics`: their numbers of samples by code."""

    folder: Path
    samples: int
    rendered: int
    diagnostics: Mapping[str, int]
    notes: tuple[str, ...] = ()  # what formats could not hold


def make(
    config: Config,
    folder: str | os.PathLike[str],
    *,
    processes: int = 1,
    threads: int | None = None,
    executor: SampleExecutor | None = None,
    progress: Progress | None = None,
) -> Made:
    """Make the data set in a folder, or what is missing of it there.

    >>> config = primray.dataset.Config.of({"stage": "shot.usda", "samples": 2, "settings": {"resolution": [32, 18], "spp": 2}})
    >>> primray.dataset.make(config, "shots").rendered
    2

    `processes` render at a time, with `threads` each (by default they share the cores), or `executor` does. Whatever ends it, a
    later call with the same config goes on where it ended. SettingsError, dataset-changed, where anything that pixels depend on
    is not as it was when the data set was begun; more samples may be asked for, and other formats.
    """
    place = Path(folder)
    with locked(place):
        remove_leftovers(place)
        lock = _begun(config, place, threads)
        missing = sorted(set(range(config.samples)) - set(finished(place)))
        counted: Counter[str] = Counter()
        done = config.samples - len(missing)

        def heard(answer: Mapping[str, Any]) -> None:
            nonlocal done
            done += 1
            counted.update({row["code"] for row in answer["diagnostics"]})
            if progress is not None:
                progress(done, config.samples)

        order = order_of(config, place, threads, lock.classes)
        (LocalWorkers(processes) if executor is None else executor).run(order, missing, heard)
        remove_leftovers(place)  # of workers that died, and whose samples others have made
        if missing or len(lock.samples) != config.samples:
            lock = with_samples(lock, place, config.samples)
        notes = pack(config, lock, place)
        write_lock(lock, place)
    return Made(place, config.samples, len(missing), dict(sorted(counted.items())), tuple(notes))


def _begun(config: Config, folder: Path, threads: int | None) -> Lock:
    """Return the lock of the data set, with the present config; write it where the data set begins."""
    before, now = read_lock(folder), lock_of(config, folder)
    if before is not None:
        difference = next(before.differences(now), None)
        if difference is not None:
            raise SettingsError(
                f"the data set was begun with something else: {difference}; use another folder",
                where=str(folder),
                code="dataset-changed",
            )
        lock = replace(before, config=now.config, folder=now.folder)
    else:
        if finished(folder):
            raise SettingsError("there are samples without a lock file", where=str(folder), code="dataset-damaged")
        lock = replace(now, classes=classes_of(config, threads))
    write_durably(folder / CONFIG, config.text or json.dumps(config.plain, indent=1) + "\n")
    write_lock(lock, folder)
    return lock


def classes_of(config: Config, threads: int | None = None) -> str:
    """Return the label table of a data set, "" without labels; find what varies on the stage, so that errors come first.

    Without a table and a list, classes are numbered as a small picture of the first sample does: in the alphabet's order.
    """
    labels = config.labels
    given = ""
    if labels is not None and labels.table is not None:
        given = (config.folder / labels.table).read_text(encoding="utf-8")
    elif labels is not None and labels.classes:
        given = json.dumps({"classes": {labels.taxonomy: {name: k for k, name in enumerate(labels.classes, 1)}}})
    with tempfile.TemporaryDirectory(prefix="primray-dataset-") as scratch:
        small = replace(config, light=False, settings={**config.settings, "aovs": []})
        sampler = Sampler(small, threads=threads, scratch=Path(scratch), classes=given)
        try:
            sampler.check()
            if labels is None or given:
                return given
            sampler.render(0)
            return (Path(scratch) / "labels.json").read_text(encoding="utf-8")
        finally:
            sampler.close()
