"""Samples of one pixel, rendered again: its film with outputs by kind of path and by bounce, and its logged paths.

The scene is that of the picture with a region of one pixel, which changes no bit of it. What is learnt before a render (splits,
guides) depends on no seed, so that renders with other seeds need nothing new.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from .. import core
from ..aovs import LIGHT_PATH, AovRequest
from ..arrays import Doubles
from ..color.color_space import luminance_weights
from ..images.light_path_aovs import light_paths_of_film
from ..report.logged_paths import Event, LightPath, ShapeNames, paths_of
from ..settings import DEFAULT_SPP, SAMPLE_BLOCK, RenderSettings
from .parts import Color, Sums, exact_sums

if TYPE_CHECKING:
    from ..report.prepared import Prepared

MOST_BOUNCES = 8  # that have a part of their own
# Kinds of path: each path is of exactly one.
KINDS: Mapping[str, str] = {
    "seen itself": "C[LO]",
    "direct diffuse": "C<.D>[LO]",
    "indirect diffuse": "C<.D>.*[DV].*[LO]",
    "caustic": "C<.D>[GS]+[LO]",
    "direct glossy": "C<.G>[LO]",
    "indirect glossy": "C<.G>.+[LO]",
    "in a mirror": "C<RS>.+[LO]",
    "mirrored light": "C<RS>[LO]",
    "through glass": "C<TS>.+[LO]",
    "light through glass": "C<TS>[LO]",
    "scattered once": "CV[LO]",
    "scattered, indirect": "CV.+[LO]",
}
BOUNCES: Mapping[str, str] = {
    "0 bounces": "C[LO]",
    "1 bounce": "C.[LO]",
    **{f"{n} bounces": f"C.{{{n}}}[LO]" for n in range(2, MOST_BOUNCES + 1)},
    f"{MOST_BOUNCES + 1} bounces or more": f"C.{{{MOST_BOUNCES + 1},}}[LO]",
}
EXPRESSIONS = tuple(dict.fromkeys([*KINDS.values(), *BOUNCES.values()]))
LOGGED_AT_ONCE = 256  # samples of a replicate
AIR = "the air"  # media, which have no prim in the log
MOST_LOGGED = 1 << 14  # samples of all renders of a pixel together


@dataclass(frozen=True)
class Sample:
    """A sample: its number in the picture's order by replicate, its value as the film adds it, and its paths."""

    replicate: int
    index: int
    value: Color
    paths: tuple[LightPath, ...]


@dataclass(frozen=True)
class PixelRender:
    """The renders of a pixel at (x, y) of the frame; `prepared`: with a region of that pixel alone."""

    prepared: Prepared
    x: int
    y: int

    @property
    def settings(self) -> RenderSettings:
        return self.prepared.settings

    @property
    def scale(self) -> float:
        return self.prepared.scene.exposure_scale

    @property
    def weights(self) -> Doubles:
        return np.array(luminance_weights(self.prepared.scene.rendering_space))

    @cached_property
    def splits(self) -> core.Splits:
        return core.choose_splits(self.prepared.scene, self.settings)

    @property
    def span(self) -> tuple[int, int]:
        """The range of samples [first, end) that the picture takes of the pixel."""
        asked = self.settings
        return asked.sample_range or (0, DEFAULT_SPP if asked.spp is None else asked.spp)

    @cached_property
    def names(self) -> ShapeNames:
        scene = self.prepared.scene
        return ShapeNames(scene, {} if scene.record is None else scene.record.names)

    def film(self, seed: int, span: tuple[int, int]) -> core.Film:
        """Return the film of the pixel's samples with a seed."""
        settings = replace(self.settings, seed=seed)
        film = core.Film(self.prepared.scene, settings=settings)
        film.start_at(span[0] // SAMPLE_BLOCK)
        core.render_pass(self.prepared.scene, film, core.uniform_ends(film, span[1]), self.splits, settings)
        return film

    def outputs(self, film: core.Film) -> dict[str, tuple[Doubles, Doubles]]:
        """Return the light (3,) of each expression, which add up to the film's pixel, and differences of the replicates."""
        requests = [AovRequest(text, LIGHT_PATH + text, differences=True) for text in EXPRESSIONS]
        made = light_paths_of_film(self.prepared.scene, requests, film)
        found = {}
        for text in EXPRESSIONS:
            difference = made[text].differences
            assert difference is not None
            found[text] = made[text].values[0, 0].astype(np.float64), np.nan_to_num(difference[0, 0].astype(np.float64))
        return found

    def samples(self, seed: int, span: tuple[int, int], only: tuple[int, int] | None = None) -> Iterator[Sample]:
        """Yield the samples with a seed; `only`: replicate and index of a single one."""
        settings = replace(self.settings, seed=seed)
        first, end = (core.samples_of_replicates(number) for number in span)
        if only is not None:
            replicate, index = only
            spans = [(0, 0), (0, 0)]
            spans[replicate] = index, index + 1
            yield from self._logged(settings, spans)
            return
        at = 0
        while any(first[r] + at < end[r] for r in range(2)):
            spans = [(min(first[r] + at, end[r]), min(first[r] + at + LOGGED_AT_ONCE, end[r])) for r in range(2)]
            yield from self._logged(settings, spans)
            at += LOGGED_AT_ONCE

    def _logged(self, settings: RenderSettings, spans: Sequence[tuple[int, int]]) -> Iterator[Sample]:
        events = core.log_pixel(self.prepared.scene, self.x, self.y, spans, self.splits, settings)
        own: defaultdict[int, list[Event]] = defaultdict(list)
        for event in events:
            own[event["sample"]].append(event)
        for number in sorted(own):
            found = own[number]
            camera = next(event for event in found if event["kind"] == "camera")
            paths = tuple(self._kept(paths_of(self.names, found)))
            yield Sample(int(camera["replicate"]), int(camera["index"]), found[-1]["value"], paths)

    def _kept(self, paths: Iterator[LightPath]) -> Iterator[LightPath]:
        """Yield the paths without those that the picture leaves out as caustics."""
        for path in paths:
            runs = path.way.runs
            if self.settings.caustics or runs[-1:] not in (("G",), ("S",)) or not ({"D", "V"} & set(runs)):
                yield path


def other_seeds(seed: int, count: int) -> list[int]:
    """Return seeds of renders beside the picture's."""
    return [(seed + 0x9E3779B9 * (k + 1)) % 2**32 for k in range(count)]


def light_by(key: str, sample: Sample) -> dict[str, Doubles]:
    """Return the light (3,) of a sample by "light" or by "prim"."""
    found: dict[str, Doubles] = {}
    for path in sample.paths:
        name = (path.light if key == "light" else path.sender) or AIR
        found[name] = found.get(name, 0) + np.array(path.adds)
    return found


def sums_of(samples: Sequence[Sample], key: str) -> Sums:
    return exact_sums([(sample.replicate, sample.value, light_by(key, sample)) for sample in samples])


def pixel_of(film: core.Film) -> tuple[npt.NDArray[np.float32], float]:
    """Return R, G and B (3,) and alpha of a film of one pixel."""
    pixel = film.pixels[0, 0]
    return pixel[:3], float(pixel[3])
