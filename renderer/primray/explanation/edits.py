"""Edits that would halve the time which a pixel's surroundings take to an error, each tried.

Time to an error is variance times cost. Both are measured on the pixel's tile: each edit is rendered several times with other
seeds, on a kept scene, so that what does not change is neither translated nor built again. The variance is weighed as in
relMSE; its ratio has an interval by resampling the pixels, in which fireflies are as rare as they are. What an edit does to the
picture is compared with the noise of all these renders together.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import core
from ..arrays import Doubles
from ..color.color_space import luminance_weights
from ..sampling.error import student_quantile
from ..settings import RenderSettings
from .pixel import other_seeds
from .tried_edit import TriedEdit

if TYPE_CHECKING:
    from .explained import ExplainedPixel, Explainer
    from .noise import NoisePath

TILE = 16  # pixels across
RENDERS, SPP = 8, 32
RESAMPLED = 400
DARKEST = 0.01  # relMSE's: a pixel's variance counts over its square plus this
CLAMP = 10.0  # times the pixel's light
LARGER = 2.0
ROUGHER = 0.3
MOST_OF_A_KIND = 2  # lights, and materials
LEAST_SHARE = 0.02  # of the noise, for an edit of what makes it
CERTAIN = 4.5  # standard deviations by Student's t of one of 256 pixels, for a change of the picture


@dataclass(frozen=True)
class _Trial:
    """Renders of a tile with other seeds: their pixels (K, H, W, 3), the CPU seconds of one, and the luminance of channels."""

    pixels: Doubles
    seconds: float
    weights: Doubles

    @property
    def bright(self) -> Doubles:
        found: Doubles = self.pixels @ self.weights
        return found


@dataclass(frozen=True)
class _Edit:
    words: str
    settings: RenderSettings
    editing: AbstractContextManager[object]


def try_edits(explainer: Explainer, pixel: ExplainedPixel, settings: RenderSettings) -> tuple[TriedEdit, ...]:
    """Return what edits do to the tile of an explained pixel, the fastest first."""
    base = _trial(explainer, pixel, settings)
    found = []
    for edit in _edits(explainer, pixel, settings):
        with edit.editing:
            found.append(_tried(edit.words, base, _trial(explainer, pixel, edit.settings), pixel.samples))
    return tuple(sorted(found, key=lambda tried: tried.times))


def _edits(explainer: Explainer, pixel: ExplainedPixel, settings: RenderSettings) -> Iterator[_Edit]:
    """Yield edits of what makes the pixel's noise."""
    from .. import usd

    paths = [path for path in pixel.noise if not path.is_random]
    shares: dict[str, float] = {}
    deep = caustic = 0.0
    for path in paths:
        shares[path.light] = shares.get(path.light, 0.0) + path.share
        deep += path.share if len(path.prims) > 1 else 0.0
        caustic += path.share if any(kind in path.expression for kind in ("D>+<.S", "D>+<.G")) else 0.0
    by_material = _shares_by_material(explainer.stage, paths)
    if deep >= LEAST_SHARE and settings.clamp_indirect is None:
        level = float(f"{CLAMP * max(pixel.value):.1g}")
        if level > 0:
            yield _Edit(f"--clamp-indirect {level:g}", replace(settings, clamp_indirect=level), nullcontext())
    if caustic >= LEAST_SHARE and settings.caustics:
        yield _Edit("--caustics off", replace(settings, caustics=False), nullcontext())
    if deep >= LEAST_SHARE and (settings.max_depth is None or settings.max_depth > 3):
        yield _Edit("--max-depth 3", replace(settings, max_depth=3), nullcontext())
    for light in _largest(shares):
        if usd.can_be_larger(explainer.stage, light):
            words = f"{light} {LARGER:g} times as large, of the same power"
            yield _Edit(words, settings, usd.larger_light(explainer.stage, light, LARGER))
    smooth = {name: share for name, share in by_material.items() if usd.can_be_rougher(explainer.stage, name, ROUGHER)}
    for material in _largest(smooth):
        yield _Edit(
            f"{material} with a roughness of {ROUGHER:g}", settings, usd.rougher_material(explainer.stage, material, ROUGHER)
        )


def _largest(shares: Mapping[str, float]) -> list[str]:
    """Return the names of the largest shares that are worth an edit."""
    names = [name for name, share in shares.items() if share >= LEAST_SHARE]
    return sorted(names, key=lambda name: -shares[name])[:MOST_OF_A_KIND]


def _shares_by_material(stage: Any, paths: Sequence[NoisePath]) -> dict[str, float]:
    """Return how much of the noise comes by way of each material, on paths that something reflects or refracts."""
    from .. import usd

    mirrored = [path for path in paths if set("GS") & set(path.expression)]
    prims = {prim for path in mirrored for prim in path.prims if prim.startswith("/")}  # not the air, nor in native instances
    materials = usd.bound_materials(stage, prims)
    shares: dict[str, float] = {}
    for path in mirrored:
        for material in {materials[prim] for prim in path.prims if prim in materials}:
            shares[material] = shares.get(material, 0.0) + path.share
    return shares


def _trial(explainer: Explainer, pixel: ExplainedPixel, settings: RenderSettings) -> _Trial:
    width, height = pixel.frame
    left, top = (max(min(at - TILE // 2, most - TILE), 0) for at, most in zip(pixel.pixel, pixel.frame, strict=True))
    right, bottom = min(left + TILE, width), min(top + TILE, height)
    region = (left / width, 1 - bottom / height, right / width, 1 - top / height)
    prepared = explainer.prepared(replace(settings, sample_range=None, spp=SPP), region, ())
    splits = core.choose_splits(prepared.scene, prepared.settings)
    made, seconds = [], []
    for seed in other_seeds(settings.seed, RENDERS):
        asked = replace(prepared.settings, seed=seed)
        film = core.Film(prepared.scene, settings=asked)
        began = time.process_time()
        core.render_pass(prepared.scene, film, core.uniform_ends(film, SPP), splits, asked)
        seconds.append(time.process_time() - began)
        made.append(film.pixels[..., :3].astype(np.float64))
    weights = np.array(luminance_weights(prepared.scene.rendering_space))
    return _Trial(np.array(made), float(np.median(seconds)), weights)


def _tried(words: str, base: _Trial, made: _Trial, samples: int) -> TriedEdit:
    """Return what an edit did. `samples`: of the picture, whose error the seconds are for."""
    errors = [(_variance(trial), trial.seconds) for trial in (base, made)]
    (before, before_s), (after, after_s) = errors
    cost = after_s / before_s if before_s > 0 else 1.0
    draws = np.random.default_rng(0).integers(0, len(before), (RESAMPLED, len(before)))
    ratios = _ratio(after[draws].sum(axis=1), before[draws].sum(axis=1)) * cost
    times = float(_ratio(after.sum(), before.sum()) * cost)
    low, high = (float(value) for value in np.quantile(ratios, (0.025, 0.975)))
    seconds = before_s * samples / SPP
    change, reach, changes = _change(base, made)
    return TriedEdit(
        words,
        times,
        (low, high),
        (seconds * (1 - high), seconds * (1 - low)),
        change,
        (change - reach, change + reach),
        changes,
    )


def _ratio(a: Any, b: Any) -> Any:
    return np.divide(a, b, out=np.ones_like(np.asarray(a, np.float64)), where=np.asarray(b) > 0)


def _variance(trial: _Trial) -> Doubles:
    """Return the weighed variance of each pixel (N,)."""
    light = trial.pixels.mean(axis=0)
    of_pixels: Doubles = (trial.pixels.var(axis=0, ddof=1) / (light**2 + DARKEST)).sum(axis=-1).ravel()
    return of_pixels


def _change(base: _Trial, made: _Trial) -> tuple[float, float, bool]:
    """Return the relative change of the tile's luminance, half of its 95 % interval, and whether it or a pixel has changed."""
    bright = [trial.bright for trial in (base, made)]
    sums = [b.mean(axis=(1, 2)) for b in bright]
    difference = float(sums[1].mean() - sums[0].mean())
    error = math.sqrt(sum(float(s.var(ddof=1)) / len(s) for s in sums))
    level = float(sums[0].mean())
    freedom = 2 * (RENDERS - 1)
    reach = student_quantile(freedom) * error
    of_pixels = np.abs(bright[1].mean(axis=0) - bright[0].mean(axis=0))
    noise = np.sqrt(sum(b.var(axis=0, ddof=1) / len(b) for b in bright))
    changed = bool((of_pixels > student_quantile(freedom, CERTAIN) * noise)[noise > 0].any())
    return (difference / level, reach / level, abs(difference) > reach or changed) if level > 0 else (0.0, 0.0, changed)
