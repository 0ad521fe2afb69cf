"""Cryptomattes of a film, from what its own samples see first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ... import core
from ...aov_names import AovRequest
from ...sampling.sampling import Sampling
from ...settings import SAMPLE_BLOCK
from ..aov import Aov
from ..first_hit import Ids
from .cryptomatte import Coverage, cryptomatte

Names = list[str]
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
        assert scene.record is not None
        self._ids = Ids(scene, scene.record, scene.record.names)
        self._assets = assets
        self._rows: dict[str, Any] = {"prim": what[:, 0], "material": what[:, 1], "instance": what[:, 2]}
        if (what[:, 3] >= 0).any():
            self._rows["outer"] = what[:, 3]

    def crypto_object(self) -> tuple[npt.NDArray[np.int64], Names]:
        """Return names that are prim paths; in an instance, its name and the prim's path."""
        prims, instances = self._ids.prim(self._rows), self._ids.instance(self._rows)
        return self._pairs(prims, instances, lambda prim, instance: f"{instance}|{prim}" if instance else prim)

    def crypto_material(self) -> tuple[npt.NDArray[np.int64], Names]:
        return _listed(self._ids.material(self._rows))

    def crypto_asset(self) -> tuple[npt.NDArray[np.int64], Names]:
        prims, instances = self._ids.prim(self._rows), self._ids.instance(self._rows)
        return self._pairs(prims, instances, lambda prim, instance: instance or self._assets.get(prim, prim))

    def _pairs(self, prims: Any, instances: Any, name: Any) -> tuple[npt.NDArray[np.int64], Names]:
        both = np.stack([prims[0].astype(np.int64), instances[0].astype(np.int64)], axis=1)
        different, place = np.unique(both, axis=0, return_inverse=True)
        names = [name(prims[1].get(prim, ""), instances[1].get(instance, "")) for prim, instance in different.tolist()]
        return place.ravel().astype(np.int64), names


def _listed(found: tuple[npt.NDArray[Any], Mapping[int, str]]) -> tuple[npt.NDArray[np.int64], Names]:
    ids, names = found
    numbers = np.array(sorted(names), np.int64)
    place = np.searchsorted(numbers, ids.astype(np.int64)) if len(numbers) else np.zeros(ids.shape, np.int64)
    return np.where(ids > 0, place, len(numbers)), [*(names[number] for number in numbers.tolist()), NONE]
