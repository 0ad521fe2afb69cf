"""What formats make of the samples when all are there: one folder each, in the order of the samples, made again at will."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import PrimrayError, SettingsError
from .config import Config
from .ledger import flush, record_of, sample_folder, sample_name
from .lock_file import Lock
from .sampler import INDEX_MAP


@dataclass(frozen=True, eq=False)
class Sample:
    """A sample that is done. `record` is its sample.json."""

    folder: Path
    record: dict[str, Any]

    @property
    def index(self) -> int:
        return int(self.record["index"])

    @property
    def name(self) -> str:
        return sample_name(self.index)

    @property
    def resolution(self) -> tuple[int, int]:
        width, height = self.record["resolution"]
        return width, height

    @property
    def things(self) -> list[dict[str, Any]]:
        return list(self.record["things"])

    def file(self, what: str) -> Path:
        """Return the path of one of its files: picture, exr, things, or an AOV."""
        return self.folder / str(self.record["files"][what])

    def aov(self, name: str) -> np.ndarray[Any, Any]:
        """Return the values (H, W, C) of an AOV; pictures must have npy."""
        return np.asarray(np.load(self.file(name), allow_pickle=False))

    @cached_property
    def index_map(self) -> np.ndarray[Any, Any]:
        """The innermost thing that each pixel sees (H, W): its place in `things`, from 1; 0 where nothing is labelled."""
        return read_integers(self.folder / INDEX_MAP)[..., 0]

    def mask(self, thing: int) -> np.ndarray[Any, Any]:
        """Return the pixels (H, W), bool, of a thing, given by its place in `things`, and of all that it holds."""
        held = [thing]
        things = self.things
        for each in held:
            held += [k for k, other in enumerate(things) if other["parent"] == things[each]["id"] and k not in held]
        return np.isin(self.index_map, [k + 1 for k in held])


def read_integers(path: Path) -> np.ndarray[Any, Any]:
    """Return the values (H, W, C) of a PNG as they are stored."""
    import OpenImageIO as oiio

    file: Any = oiio.ImageInput.open(str(path))
    if file is None:
        raise PrimrayError("it is no picture", where=str(path), code="dataset-damaged")
    values = file.read_image(file.spec().format)
    file.close()
    if values is None:
        raise PrimrayError("the picture is damaged, or ends early", where=str(path), code="dataset-damaged")
    return np.asarray(values).reshape(file.spec().height, file.spec().width, -1)


def samples_of(folder: str | os.PathLike[str], count: int | None = None) -> Iterator[Sample]:
    """Yield the samples of a data set in order.

    >>> [sample.index for sample in primray.dataset.samples_of("suns")]
    [0, 1, 2]
    """
    from .ledger import finished

    place = Path(folder)
    for index in finished(place) if count is None else range(count):
        yield Sample(sample_folder(place, index), record_of(place, index))


@dataclass(frozen=True)
class AllSamples:
    """The samples of a data set, read from its files each time that they are iterated over."""

    folder: Path
    count: int

    def __iter__(self) -> Iterator[Sample]:
        return samples_of(self.folder, self.count)


def pack(config: Config, lock: Lock, folder: Path) -> list[str]:
    """Write the folder of each format anew; return sentences on what formats could not hold."""
    from .writers import WRITERS

    notes = []
    for name, options in config.writers.items():
        target, partial = folder / name, folder / f".{name}.partial"
        shutil.rmtree(partial, ignore_errors=True)
        partial.mkdir()
        writer = WRITERS[name]
        notes += [
            f"{name}: {note}" for note in writer.write(AllSamples(folder, config.samples), config, lock, options, partial)
        ]
        for file in sorted(partial.rglob("*")):
            if not file.is_symlink():
                flush(file)
        flush(partial)
        old = folder / f".{name}.old"
        shutil.rmtree(old, ignore_errors=True)
        if target.exists():
            os.rename(target, old)
        os.rename(partial, target)
        flush(folder)
        shutil.rmtree(old, ignore_errors=True)
    return notes


def check_pinhole(format_name: str, sample: Sample) -> None:
    """Raise SettingsError unless the sample's camera has an intrinsic matrix."""
    if sample.record["camera"]["intrinsics"] is None:
        raise SettingsError(
            f"{format_name} needs cameras with an intrinsic matrix: perspective ones, without settings: panorama",
            where=f"sample {sample.index}",
            code="dataset-camera",
        )


def link(source: Path, target: Path) -> None:
    """Have a file under a further name; a copy where the file system has no hard links."""
    target.parent.mkdir(parents=True, exist_ok=True)
    try:
        os.link(source, target)
    except OSError:
        shutil.copyfile(source, target)
