"""HDF5: one file, dataset.h5, with an array of each picture and AOV of all samples, and their records as JSON.

Arrays are (samples, height, width, channels), a chunk a sample, written in order and without times, so that the same samples
are the same bytes with one version of HDF5. It is made at the end: a file that a kill interrupts cannot be read.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import SettingsError
from ..packing import Sample, read_integers

if TYPE_CHECKING:
    from ..config import Config
    from ..document import Entry
    from ..lock_file import Lock

NEEDS_LABELS, NEEDS_PINHOLE, PICTURES, AOVS = False, False, (), ()
FILE = "dataset.h5"


def options(entry: Entry | None) -> dict[str, Any]:
    """Return the level of compression, 0 to 9."""
    fields = {} if entry is None else entry.fields((), ("level",))
    return {"level": fields["level"].whole(0, 9) if "level" in fields else 1}


def write(samples: Iterable[Sample], config: Config, lock: Lock, asked: Any, folder: Path) -> list[str]:
    """Write dataset.h5: `picture` (display values), `things` (places in the record's list, from 1), AOVs, `records`."""
    try:
        import h5py
    except ImportError:
        raise SettingsError("HDF5 needs h5py: pip install 'primray[dataset]'", code="dataset-missing") from None
    with h5py.File(folder / FILE, "w", track_order=True) as file:
        records = file.create_dataset("records", (config.samples,), dtype=h5py.string_dtype(), chunks=(1,), track_times=False)
        for place, sample in enumerate(samples):
            for name, values in arrays_of(sample):
                if name not in file:
                    made = file.create_dataset(
                        name,
                        (config.samples, *values.shape),
                        dtype=values.dtype,
                        chunks=(1, *values.shape),
                        compression="gzip" if asked["level"] else None,
                        compression_opts=asked["level"] or None,
                        shuffle=bool(asked["level"]),
                        track_times=False,
                    )
                    made.attrs["source"] = name
                elif file[name].shape[1:] != values.shape:
                    raise SettingsError(
                        f"{name} of sample {sample.name} has the shape {values.shape}, others {file[name].shape[1:]}; "
                        "one file of arrays needs one resolution",
                        where="write.hdf5",
                        code="dataset-shapes",
                    )
                file[name][place] = values
            records[place] = json.dumps(sample.record, ensure_ascii=False)
    return []


def arrays_of(sample: Sample) -> Iterable[tuple[str, np.ndarray[Any, Any]]]:
    """Yield a sample's arrays by name: AOVs as floats or ids, pictures as they are stored."""
    for what in sample.record["files"]:
        path = sample.file(what)
        if path.suffix == ".png":
            yield what, read_integers(path)
        elif path.suffix == ".npy":
            yield what.replace("/", "_"), sample.aov(what)
