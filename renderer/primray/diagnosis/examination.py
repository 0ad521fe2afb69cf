"""A stage that was prepared and sampled (description, picture, costs, diagnostics), and the findings that are derived from
it."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from .. import usd
from ..aovs import requests_of
from ..arrays import Doubles
from ..description import SceneDescription, Shape, Surface
from ..diagnostics import Diagnostics
from ..images.cryptomatte import FOG, UNIT, covered_names
from ..images.image import Image
from ..render import find_aovs, prepare
from ..render.prepare import Steps, Textures
from ..report.prepared import Prepared
from ..report.report import Costs
from ..report.summary import ImageSize
from ..sampling.prediction import Pilot, run_pilot
from ..sampling.sampling import Sampling
from ..settings import RenderSettings

SEEN = ("depth", "prim", "material", "albedo")


class WatchedSteps(Steps):
    """Steps of a render that keep what passes through: the description, its textures, and how long reading them took."""

    def __init__(self) -> None:
        self.description: SceneDescription | None = None
        self.textures: Textures = {}
        self.images: list[ImageSize] = []
        self.reading_s = 0.0
        self.diced: SceneDescription | None = None

    def load_textures(
        self, description: SceneDescription, diagnostics: Diagnostics, settings: RenderSettings
    ) -> tuple[SceneDescription, Textures]:
        start = time.perf_counter()
        self.description, textures = super().load_textures(description, diagnostics, settings)
        self.reading_s = time.perf_counter() - start
        self.textures = dict(textures)  # a copy: the one handed on is emptied while the core takes it
        return self.description, textures

    def image_sizes(self, textures: Textures) -> list[ImageSize]:
        self.images = super().image_sizes(textures)
        return self.images

    def add_missing_light(
        self, description: SceneDescription, textures: Textures, settings: RenderSettings, diagnostics: Diagnostics
    ) -> SceneDescription:
        self.description = super().add_missing_light(description, textures, settings, diagnostics)
        return self.description

    def dice(
        self, description: SceneDescription, textures: Textures, settings: RenderSettings
    ) -> tuple[SceneDescription, list[tuple[str, str, str]]]:
        self.diced, limits = super().dice(description, textures, settings)
        return self.diced, limits


@dataclass(frozen=True, kw_only=True)
class Examined:
    """Inputs of the findings. `image` has the AOVs of SEEN; it has no samples where the pilot was stopped."""

    stage: dict[str, Any]  # stage_facts, as in `primray inspect`
    hidden: dict[str, list[str]]  # shapes that are not drawn, by reason
    bound: dict[str, str]  # for shapes rendered without material, the material that each is bound to
    steps: WatchedSteps
    prepared: Prepared
    sampling: Sampling
    image: Image
    costs: Costs
    diagnostics: Diagnostics
    pilot: Pilot | None = field(repr=False, default=None)  # None: the error is unknown

    @property
    def description(self) -> SceneDescription:
        assert self.steps.description is not None
        return self.steps.description

    @cached_property
    def prims(self) -> npt.NDArray[np.uint32]:
        """Numbers (H, W) of the first prims hit, 0 for none; `names("prim")` has their paths."""
        return self.image.aovs["prim"].values[..., 0]

    @cached_property
    def materials(self) -> npt.NDArray[np.uint32]:
        return self.image.aovs["material"].values[..., 0]

    @cached_property
    def volumes(self) -> dict[str, Doubles]:
        """Fractions (H, W) of each pixel's samples that collide first in a volume, by the path of its prim ("fog": the fog)."""
        description = self.description
        paths = {medium.path for medium in description.media} | {s.volume.path for s in description.surfaces if s.volume}
        if description.fog is not None:
            paths.add(FOG)
        if not paths:
            return {}
        counts, number, shares, names = covered_names(self.prepared.scene, ["crypto_object"], self.sampling, {})
        pixel = np.repeat(np.arange(counts.size), counts.ravel())
        whole = np.maximum(self.sampling.film.counts.sum(axis=0, dtype=np.int64).ravel(), 1) * float(UNIT)
        found = {}
        for path in sorted(paths):
            own = [k for k, name in enumerate(names["crypto_object"]) if name == path or name.endswith(f"|{path}")]
            is_own = np.isin(number, own)
            sums = np.bincount(pixel[is_own], weights=shares[is_own].astype(np.float64), minlength=counts.size)
            found[path] = (sums / whole).reshape(counts.shape)
        return found

    def names(self, aov: str) -> dict[int, str]:
        return dict(self.image.aovs[aov].ids)

    @property
    def hit_share(self) -> float:
        """Fraction of the pixels whose centre sees a surface."""
        return float(np.mean(self.prims > 0))

    @property
    def volume_share(self) -> float:
        """Fraction of the picture that shows volumes."""
        return float(sum(cover.mean() for cover in self.volumes.values()))


def bare_shapes(description: SceneDescription) -> list[str]:
    """Return paths of shapes with the default grey: neither a material that can be read nor a displayColor."""
    bare = {number for number, surface in enumerate(description.surfaces) if surface == Surface("", lambert=True)}
    return list(dict.fromkeys(shape.path for shape in description.shapes if _is_bare(shape, bare)))


def _is_bare(shape: Shape, bare: set[int]) -> bool:
    if getattr(shape, "colors", None) is not None or any(p.name == "displayColor" for p in shape.primvars):
        return False
    return not bare.isdisjoint(np.unique(shape.surface).tolist())


def examine(scene: str | os.PathLike[str] | Any, settings: RenderSettings, seconds: float) -> Examined:
    """Open, translate and build a stage, and sample it for about `seconds`; raise the errors of a render."""
    costs, opening, diagnostics, steps = Costs(), Diagnostics(), Diagnostics(), WatchedSteps()
    with costs.stage("open"):
        stage = usd.open_stage(scene, opening, settings.composition)
    prepared = prepare(stage, opening, replace(settings, aovs=SEEN), costs, diagnostics, steps=steps)
    prepared = replace(prepared, aovs=requests_of(SEEN))
    if prepared.scene.record is not None:
        prepared.scene.record.names = {}  # findings name prims by paths, which descriptions and diagnostics have
    with costs.stage("render"):
        pilot = run_pilot(prepared.scene, prepared.settings, seconds)
        sampling = pilot.sampling if pilot is not None else _a_few_samples(prepared)
    pixels, errors = sampling.film.image()
    aovs, _ = find_aovs(prepared, sampling, costs, diagnostics)
    space = prepared.scene.rendering_space
    image = Image(pixels, camera=prepared.camera, errors=errors, frame=prepared.frame, aovs=aovs, color_space=space)
    hidden = usd.undrawn_shapes(stage, settings)
    assert steps.description is not None
    bound = usd.bound_materials(stage, bare_shapes(steps.description))
    return Examined(
        stage=usd.stage_facts(stage),
        hidden=hidden,
        bound=bound,
        steps=steps,
        prepared=prepared,
        sampling=sampling,
        image=image,
        costs=costs,
        diagnostics=diagnostics,
        pilot=pilot,
    )


def _a_few_samples(prepared: Prepared) -> Sampling:
    settings = replace(prepared.settings, spp=2, target_error=None, time_limit_s=None, adaptive=False)
    sampling = Sampling.begin(prepared.scene, settings)
    sampling.run(None)
    return sampling


class Question(Enum):
    """Questions about a picture, in the order in which answers are given."""

    EMPTY = "empty"  # why is something, or everything, not there?
    DARK = "dark"  # why is it too dark, or too bright?
    GREY = "grey"  # why has it no colour?
    SLOW = "slow"  # what takes the time: setting up, tracing, or noise?


@dataclass(frozen=True)
class Finding:
    """A reason for what is wrong. `share` (0 to 1) is the fraction of pixels, seconds or error that it explains, if known."""

    question: Question
    code: str
    message: str
    advice: str
    prims: tuple[str, ...] = ()
    share: float | None = None

    def as_json(self) -> dict[str, Any]:
        return {
            "question": self.question.value,
            "code": self.code,
            "message": self.message,
            "advice": self.advice,
            "prims": list(self.prims),
            "share": self.share,
        }
