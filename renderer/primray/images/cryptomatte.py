"""Cryptomatte: the objects, materials or assets that cover each pixel and their coverage, by ids that hash their names.

Specification 1.2 (Psyop, 2015): pairs of id and coverage, largest first, two pairs per layer; an id is the MurmurHash3 of the
name with an exponent that makes it a normal float; the header has the names. Coverage is that of the film's own samples,
counted in integer units, and adds up to the picture's alpha.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .. import core
from ..aovs import CRYPTOMATTES, AovRequest
from ..arrays import Floats
from ..sampling.sampling import Sampling
from ..settings import SAMPLE_BLOCK
from .aov import Aov, Values
from .first_hit import Ids

MOST_RANKS = 32
MOST_TEXT = 1 << 22  # bytes of a manifest
MASK = 0xFFFFFFFF
UNIT = 1 << 24  # share of a whole sample
NOTHING = 1e-6  # negligible coverage of a pixel
LIGHTS = "lights"
FOG = "fog"


@dataclass(frozen=True)
class Coverage:
    """Entries of what covers each pixel: `counts` (H, W) entries per pixel, with their shares (N) in pixel order."""

    counts: npt.NDArray[np.uint32]
    shares: npt.NDArray[np.int64]
    samples: npt.NDArray[np.int64]  # (H, W)
    alpha: Floats  # (H, W)


def cryptomatte(source: str, coverage: Coverage, number: npt.NDArray[np.int64], names: Sequence[str]) -> Aov:
    """Return the Cryptomatte of one kind; `number` (N) is the index of each entry's name in `names`."""
    layer = CRYPTOMATTES[source].layer
    hashes = np.array([hash_of(name) for name in names] or [0], np.uint32)
    pixel = np.repeat(np.arange(coverage.counts.size), coverage.counts.ravel())
    pairs, inverse = np.unique(np.stack([pixel, hashes[number]], axis=1), axis=0, return_inverse=True)
    shares = np.bincount(inverse.ravel(), weights=coverage.shares.astype(np.float64), minlength=len(pairs))
    weights = shares / (coverage.samples.ravel()[pairs[:, 0]] * float(UNIT))
    pairs, weights = _to_alpha(pairs, weights, coverage.alpha.ravel().astype(np.float64))
    order = np.lexsort((pairs[:, 1], -weights, pairs[:, 0]))
    at, ids, weights = pairs[order, 0], pairs[order, 1].astype(np.uint32), weights[order]
    rank = np.arange(len(at)) - np.searchsorted(at, at)
    ranks = min(max(int(rank.max(initial=0)) + 1, 2), MOST_RANKS)
    ranks += ranks % 2
    values = np.zeros((coverage.counts.size, ranks, 2), np.float32)
    kept = (rank < ranks) & (weights > 0)
    values[at[kept], rank[kept], 0] = ids[kept].view(np.float32)
    values[at[kept], rank[kept], 1] = weights[kept]
    channels = tuple(f"{layer}{n:02d}.{letter}" for n in range(ranks // 2) for letter in "RGBA")
    seen = {int(h) for h in np.unique(ids[weights > 0]).tolist()}
    every = dict(zip([*names, LIGHTS], [*hashes.tolist(), hash_of(LIGHTS)], strict=False))
    manifest = {name: every[name] for name in sorted(every) if every[name] in seen}
    values = values.reshape(*coverage.counts.shape, 2 * ranks)
    return Aov(values, channels, source, CRYPTOMATTES[source].meaning, metadata=header_of(layer, manifest))


def _to_alpha(
    pairs: npt.NDArray[np.int64], weights: npt.NDArray[np.float64], alpha: npt.NDArray[np.float64]
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.float64]]:
    """Return entries whose weights add up to each pixel's alpha.

    Visible lights cover a pixel without being surfaces. Surfaces that light passes straight through by chance, such as thin
    glass, cover less than they are hit.
    """
    sums = np.bincount(pairs[:, 0], weights=weights, minlength=len(alpha))
    weights = weights * np.where(sums > alpha, alpha / np.maximum(sums, 1e-30), 1.0)[pairs[:, 0]]
    missing = alpha - np.minimum(sums, alpha)
    lit = np.flatnonzero(missing > NOTHING)
    more = np.stack([lit, np.full(len(lit), hash_of(LIGHTS))], axis=1)
    return np.concatenate([pairs, more]), np.concatenate([weights, missing[lit]])


def header_of(layer: str, manifest: Mapping[str, int]) -> dict[str, str]:
    """Return the header attributes of a layer that the specification requires: name, hash, conversion and manifest."""
    key = f"cryptomatte/{murmur_hash(layer.encode()):08x}"[: len("cryptomatte/") + 7]
    says: dict[str, str] = {}
    size = 0
    for name, number in manifest.items():
        size += len(name.encode()) + 16
        if size > MOST_TEXT:
            break
        says[name] = f"{number:08x}"
    text = json.dumps(says, ensure_ascii=False, separators=(",", ":"))
    return {
        f"{key}/name": layer,
        f"{key}/hash": "MurmurHash3_32",
        f"{key}/conversion": "uint32_to_float32",
        f"{key}/manifest": text,
    }


def hash_of(name: str) -> int:
    """Return the bits of a name's id, which are never those of an infinity, a NaN or a denormal."""
    number = murmur_hash(name.encode())
    return number ^ (1 << 23) if (number >> 23) & 255 in (0, 255) else number


def murmur_hash(data: bytes) -> int:
    """MurmurHash3_x86_32 with seed 0 (Appleby, public domain)."""
    number = 0
    for i in range(0, len(data) // 4 * 4, 4):
        number ^= _scrambled(int.from_bytes(data[i : i + 4], "little"))
        number = (_rotated(number, 13) * 5 + 0xE6546B64) & MASK
    rest = data[len(data) // 4 * 4 :]
    number ^= _scrambled(int.from_bytes(rest, "little")) if rest else 0
    number ^= len(data)
    number = ((number ^ number >> 16) * 0x85EBCA6B) & MASK
    number = ((number ^ number >> 13) * 0xC2B2AE35) & MASK
    return number ^ number >> 16


def _scrambled(word: int) -> int:
    return (_rotated(word * 0xCC9E2D51 & MASK, 15) * 0x1B873593) & MASK


def _rotated(word: int, by: int) -> int:
    return (word << by | word >> (32 - by)) & MASK


Names = list[str]
Named = tuple[Values, Mapping[int, str]]  # ids, and their names
NONE = "default"  # name of surfaces without a material


def mattes_of(
    scene: core.CoreScene, requests: Sequence[AovRequest], sampling: Sampling, assets: Mapping[str, str]
) -> dict[str, Aov]:
    """Return Cryptomattes by name; `assets` maps prim paths to asset names."""
    film = sampling.film
    counts, what, shares = _covering(scene, sampling)
    samples = film.counts.sum(axis=0, dtype=np.int64)
    covering = Coverage(counts, shares, np.maximum(samples, 1), film.image()[0][..., 3])
    names = _Names(scene, what, assets)
    return {r.name: cryptomatte(r.source, covering, *getattr(names, r.source)()) for r in requests}


def covered_names(
    scene: core.CoreScene, sources: Sequence[str], sampling: Sampling, assets: Mapping[str, str]
) -> tuple[npt.NDArray[np.uint32], npt.NDArray[np.int64], npt.NDArray[np.int64], dict[str, Names]]:
    """Return coverage entries with names, for merging.

    The result is: entries per pixel (H, W); in pixel order the index (N) of each entry's thing and its coverage (N) in integer
    units; by source the names of the things.
    """
    counts, what, shares = _covering(scene, sampling)
    different, number = np.unique(what, axis=0, return_inverse=True)
    names = _Names(scene, different, assets)
    found = {source: getattr(names, source)() for source in sources}
    return (
        counts,
        number.ravel().astype(np.int64),
        shares,
        {s: [own[n] for n in places.tolist()] for s, (places, own) in found.items()},
    )


def _covering(
    scene: core.CoreScene, sampling: Sampling
) -> tuple[npt.NDArray[np.uint32], npt.NDArray[np.int32], npt.NDArray[np.int64]]:
    """Return core.coverage for the samples that the film has taken."""
    film, settings = sampling.film, sampling.settings
    first = settings.sample_range[0] // SAMPLE_BLOCK if settings.sample_range else 0
    begin = np.full_like(film.next, first)
    drawn = core.FilmSamples(begin, film.next, settings.seed, settings.screen_block, sampling.splits.paths > 1)
    return core.coverage(scene, drawn, settings)


class _Names:
    """Names of the core's numbers: for each entry, an index into a list of names."""

    def __init__(self, scene: core.CoreScene, what: npt.NDArray[np.int32], assets: Mapping[str, str]) -> None:
        record = scene.record
        assert record is not None
        self._ids = Ids(scene, record, record.names)
        self._assets = assets
        # Entries without a shape are media of grids by their numbers, and the fog.
        self._in_air = what[:, 0] == -1
        self._media = [*record.media, (FOG, "")]
        self._medium = np.where(what[:, 1] == 0, what[:, 2], len(record.media))[self._in_air]
        shapes = np.where(self._in_air[:, None], -1, what)
        self._rows: dict[str, Values] = {"prim": shapes[:, 0], "material": shapes[:, 1], "instance": shapes[:, 2]}
        if (shapes[:, 3] >= 0).any():
            self._rows["outer"] = shapes[:, 3]

    def crypto_object(self) -> tuple[npt.NDArray[np.int64], Names]:
        """Return names that are prim paths; in an instance, its name and the prim's path."""
        prims, instances = self._ids.prim(self._rows), self._ids.instance(self._rows)
        found = self._pairs(prims, instances, lambda prim, instance: f"{instance}|{prim}" if instance else prim)
        return self._with_media(found, [self._ids.named(path) for path, _ in self._media])

    def crypto_material(self) -> tuple[npt.NDArray[np.int64], Names]:
        named = [self._ids.named(material) or NONE for _, material in self._media]
        return self._with_media(_listed(self._ids.material(self._rows)), named)

    def crypto_asset(self) -> tuple[npt.NDArray[np.int64], Names]:
        prims, instances = self._ids.prim(self._rows), self._ids.instance(self._rows)
        found = self._pairs(prims, instances, lambda prim, instance: instance or self._assets.get(prim, prim))
        return self._with_media(found, [self._assets.get(path, self._ids.named(path)) for path, _ in self._media])

    def _with_media(self, found: tuple[npt.NDArray[np.int64], Names], names: Names) -> tuple[npt.NDArray[np.int64], Names]:
        """Return the places and names with those of the media, of which there is one name each."""
        if not self._in_air.any():
            return found
        places = found[0].copy()
        places[self._in_air] = len(found[1]) + self._medium
        return places, [*found[1], *names]

    def _pairs(self, prims: Named, instances: Named, name: Callable[[str, str], str]) -> tuple[npt.NDArray[np.int64], Names]:
        both = np.stack([prims[0].astype(np.int64), instances[0].astype(np.int64)], axis=1)
        different, place = np.unique(both, axis=0, return_inverse=True)
        names = [name(prims[1].get(prim, ""), instances[1].get(instance, "")) for prim, instance in different.tolist()]
        return place.ravel().astype(np.int64), names


def _listed(found: Named) -> tuple[npt.NDArray[np.int64], Names]:
    ids, names = found
    numbers = np.array(sorted(names), np.int64)
    place = np.searchsorted(numbers, ids.astype(np.int64)) if len(numbers) else np.zeros(ids.shape, np.int64)
    return np.where(ids > 0, place, len(numbers)), [*(names[number] for number in numbers.tolist()), NONE]
