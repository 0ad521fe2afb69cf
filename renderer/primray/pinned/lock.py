"""The lock file of a picture: all that its bits depend on, and hashes of the bits, each section with a seal.

A seal is the SHA-256 of a section. It shows a lock that was edited by hand or damaged; whoever forges a hash can forge the seal
too, and is found by rendering, or by the signature of an attestation. Hashes are of linear RGBA in 32-bit floats, by tile: a
tile's bits can be rendered without the others.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Floats
from ..core import TILE
from ..errors import SettingsError
from ..images.image import pixels_sha256

FORMAT = 1
TYPE = "primray-lock"
SUFFIX = ".lock.json"
SHORT = 16  # letters of the hashes of passes: 64 bits

Counts = npt.NDArray[np.uint32]  # samples of each replicate, (R, tiles)


@dataclass(frozen=True)
class Pass:
    """Hashes of the samples that a pass took, alone: a range of each tile's samples, from the counts of the pass before."""

    samples: float  # per pixel, on average, after the pass
    counts: list[list[int]]  # after the pass, as `Picture.counts`
    tiles: str  # of all tiles, SHORT letters each; of a tile without samples in it that of black


@dataclass(frozen=True)
class Picture:
    """The bits of a picture. `counts`: samples of a tile in both replicates, one pair for all tiles where they are equal."""

    resolution: tuple[int, int]  # of the pixels, which may be a region of the frame
    origin: tuple[int, int]  # of the pixels in the frame
    samples: int
    splits: tuple[int, int]
    pixels_sha256: str
    counts: list[list[int]]
    tiles: list[str]
    passes: list[Pass]

    @property
    def grid(self) -> tuple[int, int]:
        """Tiles across and down."""
        return -(-self.resolution[0] // TILE), -(-self.resolution[1] // TILE)

    def box(self, tile: int) -> tuple[slice, slice]:
        """Return the rows and columns of a tile."""
        (width, height), columns = self.resolution, self.grid[0]
        x, y = tile % columns * TILE, tile // columns * TILE
        return slice(y, min(y + TILE, height)), slice(x, min(x + TILE, width))

    def begins(self, number: int) -> Counts:
        """Return the samples of all tiles before a pass."""
        return self.ends(self.passes[number - 1].counts) if number else np.zeros_like(self.ends())

    def hash_of_range(self, number: int, tile: int) -> str:
        """Return the hash of the samples of a tile that a pass took."""
        return self.passes[number].tiles[tile * SHORT : (tile + 1) * SHORT]

    def ends(self, counts: list[list[int]] | None = None) -> Counts:
        """Return the samples of all tiles, as a film counts them."""
        found = np.array(self.counts if counts is None else counts, np.uint32)
        return np.repeat(found, len(self.tiles), axis=0).T if len(found) == 1 else found.T


@dataclass(frozen=True)
class Lock:
    """A pinned picture. Files are relative: the stage to the lock's folder, inputs and files of settings to the stage's."""

    stage: str
    file: str | None  # the EXR
    inputs: Mapping[str, str]
    settings: Mapping[str, Any]
    isa: str
    versions: Mapping[str, str]
    environment: Mapping[str, str]
    scene: Mapping[str, str]
    picture: Picture
    aovs: Mapping[str, str]
    error: Mapping[str, Any]

    @staticmethod
    def read(path: Path) -> tuple[Lock, tuple[str, ...]]:
        """Return a lock, and the sections whose seals are broken; SettingsError for a file that is no lock."""
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
            if found.pop("type") != TYPE or found.pop("format") != FORMAT:
                raise ValueError("it is of another format")
            _check_types(found)
            seals = found.pop("seals")
            sections = {name: value for name, value in found.items() if name not in ("stage", "file")}
            broken = tuple(name for name, value in sections.items() if seals.get(name) != seal(value))
            picture = found.pop("picture")
            passes = [Pass(**row) for row in picture.pop("passes")]
            whole = Picture(
                resolution=_pair(picture.pop("resolution")),
                origin=_pair(picture.pop("origin")),
                splits=_pair(picture.pop("splits")),
                passes=passes,
                **picture,
            )
            lock = Lock(picture=whole, **found)
            lock._check()
        except OSError as error:
            raise SettingsError(f"the lock cannot be read: {error.strerror}", where=str(path), code="lock-unreadable") from None
        except (ValueError, KeyError, TypeError, AttributeError, IndexError, RecursionError) as error:
            raise SettingsError(f"it is no lock of a picture: {error}", where=str(path), code="lock-unreadable") from None
        return lock, broken

    def _check(self) -> None:
        picture = self.picture
        count = picture.grid[0] * picture.grid[1]
        passes_are_whole = all(isinstance(row.tiles, str) and len(row.tiles) == count * SHORT for row in picture.passes)
        if len(picture.tiles) != count or not passes_are_whole:
            raise ValueError("hashes of tiles are missing")
        for counts in (picture.counts, *(row.counts for row in picture.passes)):
            if len(counts) not in (1, count) or not all(map(_is_pair_of_counts, counts)):
                raise ValueError("counts of samples are missing")

    def as_json(self) -> dict[str, Any]:
        sections = {each.name: getattr(self, each.name) for each in fields(self) if each.name not in ("stage", "file")}
        sections["picture"] = asdict(self.picture)
        sections = json.loads(json.dumps(sections))
        seals = {name: seal(value) for name, value in sections.items()}
        return {"type": TYPE, "format": FORMAT, "stage": self.stage, "file": self.file, **sections, "seals": seals}

    @property
    def text(self) -> str:
        return json.dumps(self.as_json(), indent=1, ensure_ascii=False) + "\n"


# What each member of a lock is. The settings are checked as such, and `picture` as its parts are.
_TEXTS = ("inputs", "versions", "environment", "scene", "aovs", "seals")


def _check_types(found: Mapping[str, Any]) -> None:
    """Raise ValueError for a member that is not of its type."""
    for name in ("stage", "file", "isa"):
        if not (isinstance(found[name], str) and "\0" not in found[name]) and (name, found[name]) != ("file", None):
            raise ValueError(f"its {name} is no text")
    for name in ("settings", "error", "picture", *_TEXTS):
        if not isinstance(found[name], dict):
            raise ValueError(f"its {name} are no object")
    for name in _TEXTS:
        if not all(isinstance(text, str) and "\0" not in key for key, text in found[name].items()):
            raise ValueError(f"its {name} are no texts")
    picture = found["picture"]
    if not all(isinstance(text, str) for text in (picture["pixels_sha256"], *picture["tiles"])):
        raise ValueError("its hashes are no texts")
    if not _is_count(picture["samples"]):
        raise ValueError("its number of samples is no number")


def _is_count(value: Any) -> bool:
    return type(value) is int and 0 <= value < 2**63


def _is_pair_of_counts(pair: Any) -> bool:
    return len(pair) == 2 and all(type(n) is int and 0 <= n < 2**32 for n in pair)


def seal(section: Any) -> str:
    """Return the SHA-256 of a section's JSON, whatever its spaces and the order of its keys."""
    text = json.dumps(section, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()


def _pair(values: Sequence[int]) -> tuple[int, int]:
    first, second = values
    if not all(type(value) is int and abs(value) < 2**31 for value in (first, second)):
        raise ValueError(f"{values!r} are not two whole numbers")
    return first, second


def counts_of(ends: Counts) -> list[list[int]]:
    """Return samples of tiles (R, tiles) as a lock has them."""
    pairs = np.ascontiguousarray(ends.T)
    return (pairs[:1] if (pairs == pairs[:1]).all() else pairs).tolist()  # type: ignore[no-any-return]


def hashes_of_tiles(pixels: Floats) -> list[str]:
    """Return the hash of each tile of pixels (H, W, 4), in rows from the top."""
    height, width = pixels.shape[:2]
    corners = [(y, x) for y in range(0, height, TILE) for x in range(0, width, TILE)]
    return [pixels_sha256(pixels[y : y + TILE, x : x + TILE]) for y, x in corners]
