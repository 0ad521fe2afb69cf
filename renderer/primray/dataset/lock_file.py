"""The lock file of a data set: all that its pixels depend on, and the hash of each sample's pixels.

It is written before the first sample, with the inputs' hashes, settings, versions and ISA class, and again at the end, with the
pixels'. Pixels are hashed, not files: a PNG depends on zlib's build, an EXR on OpenEXR's.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ..content_hash import hash_of_file
from ..errors import SettingsError
from ..pinned.difference import Difference, differences_between
from ..report.report import package_versions
from .config import Config
from .document import differing_keys
from .ledger import hashes_of, record_of, sample_name, write_durably
from .sampler import isa_class

FILE, CONFIG = "dataset.lock.json", "dataset.yaml"
FORMAT = 1
# Keys of a config on which no sample depends.
FREE_KEYS = ("samples", "write")


@dataclass(frozen=True)
class Lock:
    """What a data set was made with. `config`: its document; `samples`: hashes of pixels by sample, once all are done."""

    config: Mapping[str, Any]
    folder: str  # of the config's relative files, relative to the data set
    inputs: Mapping[str, str]
    versions: Mapping[str, str]
    isa: str
    classes: str  # the label table
    samples: Mapping[str, Mapping[str, str]] = field(default_factory=dict)

    def differences(self, other: Lock) -> Iterator[Difference]:
        """Yield what differs in another lock: inputs, settings, the ISA class, versions, in this order."""
        yield from differences_between("input", self.inputs, other.inputs)
        for key, before, now in differing_keys(_counting(self.config), _counting(other.config)):
            yield Difference("setting", key, before, now)
        if self.isa != other.isa:
            yield Difference("isa", "class of the core", self.isa, other.isa)
        yield from differences_between("version", self.versions, other.versions)


def _counting(config: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in config.items() if key not in FREE_KEYS}


def lock_of(config: Config, folder: Path) -> Lock:
    """Return the lock of a data set that is made now, in `folder`, without samples and classes."""
    return Lock(
        config=json.loads(json.dumps(config.plain)),
        folder=os.path.relpath(config.folder, folder.absolute()),
        inputs=input_hashes(config),
        versions=package_versions(),
        isa=isa_class(),
        classes="",
    )


def input_hashes(config: Config) -> dict[str, str]:
    """Return the SHA-256 of each file that the pixels depend on, by its path relative to the config's folder."""
    from .. import usd

    files = [*usd.dependencies(str(config.stage)).files]
    for path in config.files.values():
        is_stage = path.lower().endswith((".usd", ".usda", ".usdc", ".usdz"))
        files += usd.dependencies(path).files if is_stage else [path]
    return {os.path.relpath(file, config.folder): hash_of_file(file) for file in dict.fromkeys(files) if os.path.isfile(file)}


def read_lock(folder: Path) -> Lock | None:
    """Return the lock of a data set; None where there is none. SettingsError where it is damaged."""
    path = folder / FILE
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        if found.pop("format") != FORMAT:
            raise ValueError("another format")
        return Lock(**found)
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise SettingsError(f"the lock file cannot be read: {error}", where=str(path), code="dataset-damaged") from None


def write_lock(lock: Lock, folder: Path) -> None:
    says = {
        "format": FORMAT,
        "config": lock.config,
        "folder": lock.folder,
        "inputs": lock.inputs,
        "versions": lock.versions,
        "isa": lock.isa,
        "classes": lock.classes,
        "samples": lock.samples,
    }
    write_durably(folder / FILE, json.dumps(says, indent=1, ensure_ascii=False) + "\n")


def with_samples(lock: Lock, folder: Path, count: int) -> Lock:
    """Return the lock with the hashes of the first `count` samples, all of which are done."""
    return replace(lock, samples={sample_name(k): hashes_of(record_of(folder, k)) for k in range(count)})
