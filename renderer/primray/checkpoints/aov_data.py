"""Data for AOVs and the denoiser that parts of a picture keep, since the stage is not available when they are merged.

AOVs that do not depend on the film's samples, and a denoiser's guides, are the same in every part: the part with sample 0 keeps
them. For Cryptomattes each part keeps the coverage of its own samples, by name, in integer units that add up exactly. Light
path expressions are kept to make outputs of the film.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from .. import core
from ..aovs import CRYPTOMATTES, AovRequest, kind_of, light_path_of, primvar_of, taxonomy_of
from ..core.light_path_tables import LightPathTables
from ..denoising.denoised import guides_of
from ..denoising.denoiser import Guides
from ..diagnostics import Diagnostics
from ..images.aov import Aov, make_aov
from ..images.cryptomatte import Coverage, covered_names, cryptomatte
from ..images.first_hit import aovs_of
from ..labels.view import labels_of_view
from ..report.prepared import Prepared
from ..sampling.sampling import Sampling

Arrays = dict[str, npt.NDArray[Any]]


@dataclass(frozen=True, eq=False)
class MatteCoverage:
    """Coverage of pixels by named things.

    `counts` (H, W): entries of each pixel; `number` and `shares` (N), pixel by pixel: which thing covers it, and by how many
    units; `names`: of the things, by kind of Cryptomatte.
    """

    counts: npt.NDArray[np.uint32]
    number: npt.NDArray[np.int64]
    shares: npt.NDArray[np.int64]
    names: Mapping[str, tuple[str, ...]]


@dataclass(frozen=True, eq=False)
class AovData:
    """Data that one part, or several merged ones, keep for AOVs and the denoiser."""

    requests: tuple[AovRequest, ...]  # all AOVs of the picture
    fixed: Mapping[str, Aov] = field(default_factory=dict)
    labels: Mapping[str, Any] = field(default_factory=dict)  # the report's facts about labels
    guides: Guides | None = None
    covered: MatteCoverage | None = None


def aov_data_of(prepared: Prepared, sampling: Sampling) -> AovData | None:
    """Return the data of a part whose samples are complete; None where no AOV and no denoising is requested."""
    settings, requests = prepared.settings, prepared.aovs
    if not requests and not settings.denoises:
        return None
    kept = AovData(requests)
    if settings.sample_range is None or settings.sample_range[0] == 0:
        plain = [r for r in requests if _is_fixed(r) and not taxonomy_of(r.source)]
        labels = [r for r in requests if taxonomy_of(r.source)]
        fixed = aovs_of(prepared.scene, plain, prepared.camera, sampling.film.counts, settings) if plain else {}
        says: dict[str, Any] = {}
        if labels and prepared.labelled is not None:
            made, says = labels_of_view(prepared, labels, Diagnostics())
            fixed |= made
        guides = guides_of(prepared.scene, settings) if settings.denoises else None
        kept = replace(kept, fixed=fixed, labels=says, guides=guides)
    sources = [r.source for r in requests if r.source in CRYPTOMATTES]
    if sources:
        counts, number, shares, names = covered_names(prepared.scene, sources, sampling, prepared.assets)
        kept = replace(kept, covered=MatteCoverage(counts, number, shares, {k: tuple(v) for k, v in names.items()}))
    return kept


def _is_fixed(request: AovRequest) -> bool:
    source = request.source
    return (
        (kind_of(source) is not None and source != "samples")
        or primvar_of(source) is not None
        or taxonomy_of(source) is not None
    )


def merged_aov_data(a: AovData | None, b: AovData | None) -> AovData | None:
    """Return the data of the samples of both; None where one of them kept nothing."""
    if a is None or b is None or a.requests != b.requests:
        return None
    covered = None if a.covered is None or b.covered is None else _merged_coverage(a.covered, b.covered)
    first = a if a.fixed or a.guides is not None else b
    return replace(first, covered=covered)


def _merged_coverage(a: MatteCoverage, b: MatteCoverage) -> MatteCoverage:
    kinds = tuple(a.names)
    rows = list(zip(*a.names.values(), strict=True)), list(zip(*b.names.values(), strict=True))
    known = {row: place for place, row in enumerate(dict.fromkeys([*rows[0], *rows[1]]))}
    numbers = [np.array([known[row] for row in own] or [0], np.int64) for own in rows]
    pixel = np.concatenate([np.repeat(np.arange(one.counts.size), one.counts.ravel()) for one in (a, b)])
    number = np.concatenate([own[one.number] for own, one in zip(numbers, (a, b), strict=True)])
    pairs, place = np.unique(np.stack([pixel, number], axis=1), axis=0, return_inverse=True)
    shares = np.zeros(len(pairs), np.int64)
    np.add.at(shares, place.ravel(), np.concatenate([a.shares, b.shares]))
    counts = np.bincount(pairs[:, 0], minlength=a.counts.size).astype(np.uint32).reshape(a.counts.shape)
    names = {kind: tuple(row[k] for row in known) for k, kind in enumerate(kinds)}
    return MatteCoverage(counts, pairs[:, 1].astype(np.int64), shares, names)


def aovs_of_data(kept: AovData, film: core.Film) -> dict[str, Aov]:
    """Return the AOVs that one render of all samples has, in the order requested, without those that no part holds."""
    found: dict[str, Aov] = {}
    for request in kept.requests:
        if request.name in kept.fixed:
            found[request.name] = kept.fixed[request.name]
        elif request.source == "samples":
            found[request.name] = make_aov(request, film.counts.sum(axis=0, dtype=np.uint32)[..., None])
        elif kept.covered is not None and request.source in kept.covered.names:
            found[request.name] = _matte(request.source, kept.covered, film)
    return found


def _matte(source: str, covered: MatteCoverage, film: core.Film) -> Aov:
    names = covered.names[source]
    different = list(dict.fromkeys(names))
    places = {name: place for place, name in enumerate(different)}
    number = np.array([places[name] for name in names] or [0], np.int64)[covered.number]
    samples = np.maximum(film.counts.sum(axis=0, dtype=np.int64), 1)
    coverage = Coverage(covered.counts, covered.shares, samples, film.image()[0][..., 3])
    return cryptomatte(source, coverage, number, different)


def contents_of_aov_data(kept: AovData) -> tuple[dict[str, Any], Arrays]:
    """Return the data as JSON and arrays by name, for a checkpoint."""
    arrays: Arrays = {}
    fixed = []
    for place, (name, aov) in enumerate(kept.fixed.items()):
        says: dict[str, Any] = {"name": name, "channels": list(aov.channels), "source": aov.source, "meaning": aov.meaning}
        says |= {"stored": aov.stored, "samples": aov.samples, "ids": list(aov.ids.items()), "metadata": dict(aov.metadata)}
        fixed.append(says)
        arrays[f"{place}.values"] = aov.values
        if aov.errors is not None:
            arrays[f"{place}.errors"] = aov.errors
    if kept.guides is not None:
        arrays |= {"guide.albedo": kept.guides.albedo, "guide.normal": kept.guides.normal}
    if kept.covered is not None:
        covered = kept.covered
        arrays |= {"counts": covered.counts, "number": covered.number, "shares": covered.shares}
    header = {
        "requests": [asdict(request) for request in kept.requests],
        "fixed": fixed,
        "labels": dict(kept.labels),
        "names": None if kept.covered is None else {kind: list(names) for kind, names in kept.covered.names.items()},
    }
    return header, arrays


def aov_data_of_contents(header: Mapping[str, Any], arrays: Mapping[str, npt.NDArray[Any]], size: tuple[int, int]) -> AovData:
    """Return what `contents_of` wrote; KeyError, TypeError or ValueError if it is not valid. `size`: width and height."""
    shape = size[::-1]
    requests = requests_of_json(header["requests"])
    fixed: dict[str, Aov] = {}
    for place, says in enumerate(header["fixed"]):
        values = arrays[f"{place}.values"]
        _valid(values.shape[:2] == shape and says["stored"] in ("float", "half", "uint"))
        ids = {int(number): str(name) for number, name in says["ids"]}
        metadata = {str(name): str(value) for name, value in says["metadata"].items()}
        samples = None if says["samples"] is None else int(says["samples"])
        channels = tuple(str(channel) for channel in says["channels"])
        fixed[str(says["name"])] = Aov(
            values=values,
            channels=channels,
            source=str(says["source"]),
            meaning=str(says["meaning"]),
            stored=says["stored"],
            ids=ids,
            metadata=metadata,
            errors=arrays.get(f"{place}.errors"),
            samples=samples,
        )
    guides = None
    if "guide.albedo" in arrays:
        guides = Guides(arrays["guide.albedo"], arrays["guide.normal"])
        _valid(guides.albedo.shape == guides.normal.shape == (*shape, 3))
    covered = None if header["names"] is None else _covered_of(header["names"], arrays, shape)
    return AovData(requests, fixed, dict(header["labels"]), guides, covered)


def _covered_of(names: Mapping[str, Any], arrays: Mapping[str, npt.NDArray[Any]], shape: tuple[int, ...]) -> MatteCoverage:
    counts, number, shares = (arrays[name] for name in ("counts", "number", "shares"))
    kinds = {str(kind): tuple(str(name) for name in own) for kind, own in names.items()}
    [length] = {len(own) for own in kinds.values()}
    _valid([array.dtype.str for array in (counts, number, shares)] == ["<u4", "<i8", "<i8"] and counts.shape == shape)
    _valid(set(kinds) <= set(CRYPTOMATTES) and number.shape == shares.shape == (int(counts.sum()),))
    _valid(not len(number) or (number.min() >= 0 and number.max() < length and shares.min() >= 0))
    return MatteCoverage(counts, number, shares, kinds)


def _valid(holds: bool) -> None:
    if not holds:
        raise ValueError


@dataclass(frozen=True)
class LightPaths:
    """Outputs (`requests`) that are light path expressions; `expressions` and `members` as in core's LightPathTables."""

    requests: tuple[AovRequest, ...]
    expressions: tuple[str, ...]
    members: tuple[int, ...]

    def as_json(self) -> dict[str, Any]:
        return asdict(self)


def light_paths_of_tables(requests: tuple[AovRequest, ...], tables: LightPathTables | None) -> LightPaths | None:
    if tables is None:
        return None
    own = tuple(request for request in requests if light_path_of(request.source) is not None)
    return LightPaths(own, tables.expressions, tables.members)


def requests_of_json(value: Any) -> tuple[AovRequest, ...]:
    """Return requests from dictionaries of their fields; KeyError or TypeError if they are not valid."""
    return tuple(
        AovRequest(
            name=str(r["name"]),
            source=str(r["source"]),
            data_type=str(r["data_type"]),
            errors=bool(r["errors"]),
            differences=bool(r["differences"]),
            header=tuple((str(key), str(text)) for key, text in r["header"]),
        )
        for r in value
    )


def light_paths_of_json(value: Any) -> LightPaths | None:
    """Return what `as_json` wrote; ValueError, TypeError or KeyError if it is not valid."""
    if value is None:
        return None
    requests = requests_of_json(value["requests"])
    expressions, members = tuple(map(str, value["expressions"])), tuple(map(int, value["members"]))
    known = all(light_path_of(request.source) in expressions for request in requests)
    if not expressions or not known or not all(0 <= mask < 1 << len(expressions) for mask in members):
        raise ValueError(value)
    return LightPaths(requests, expressions, members)
