"""What one pixel's light is made of: `primray explain` and `primray.explain`.

Four splits of the same light, each of which adds up to the pixel to the bit: by light, by kind of path, by bounce, and by the
prim that sends it to what the pixel shows.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from ..arrays import Doubles
from ..camera import Camera
from ..diagnostic_messages import Announcer
from ..diagnostics import Diagnostics
from ..errors import SettingsError
from ..incremental.scene import KeptStage
from ..render.render import with_setting_names
from ..settings import DEFAULT_SPP, WHOLE, RenderSettings, with_values
from .noise import NoisePath, noise_paths
from .parts import Color, Part, color_of, parts_of, settled
from .pixel import BOUNCES, EXPRESSIONS, KINDS, MOST_LOGGED, PixelRender, Sample, other_seeds, pixel_of, sums_of
from .tried_edit import TriedEdit

if TYPE_CHECKING:
    from ..images.image import Image
    from ..incremental.steps import CachedSteps
    from ..report.prepared import Prepared
    from ..settings.written import SettingsValues

RENDERS = 15  # with other seeds, for errors
NAMING_AOVS = ("prim", "instance", "material")  # the core's scene keeps names for them
SPLITS = ("light", "kind", "bounce", "prim")
TITLES = {
    "light": "by light",
    "kind": "by kind of path",
    "bounce": "by bounce",
    "prim": "by the prim that sends it here",
}
# Settings that one pixel does not have, with what they are by default.
PLAIN: Mapping[str, Any] = {
    name: getattr(RenderSettings(), name)
    for name in (
        *("pixel_size", "target_error", "time_limit_s", "adaptive", "denoise"),
        *("diffusion", "stop_at", "mixes", "background"),
    )
}


@dataclass(frozen=True)
class Shown:
    """What the ray through the middle of a pixel meets first."""

    prim: str
    instance: str
    material: str
    distance: float  # scene units
    position: Color

    def as_json(self) -> dict[str, Any]:
        return {
            "prim": self.prim,
            "instance": self.instance,
            "material": self.material,
            "distance": self.distance,
            "position": list(self.position),
        }


@dataclass(frozen=True)
class ExplainedPixel:
    """One pixel's light in parts. Column and row are counted from 0, from the upper left corner of the frame.

    >>> pixel = primray.explain("shot.usda", 16, 9, resolution=(32, 18), spp=16)
    >>> [part.name for part in pixel.splits["light"]]
    ['/sky', '/sun']
    >>> import math
    >>> red = math.fsum(part.value[0] for part in pixel.splits["light"])
    >>> abs(red - pixel.value[0]) < 1e-7
    True

    `value`: R, G, B (float32) of the picture, before a background, the shadow on a ground, a denoiser or a lens's veil;
    `error`: their standard errors.
    `splits`: parts by "light", "kind", "bounce" and "prim", the largest first.

    >>> pixel.save_layer("noise.usda")  # the paths that make its noise, as curves over the stage
    >>> pixel.save_overlay(primray.render("shot.usda", resolution=(32, 18), spp=16), "noise.png")
    """

    scene: str
    pixel: tuple[int, int]
    camera: str
    value: Color
    error: Color | None
    alpha: float
    samples: int
    renders: int  # with other seeds, that errors come from
    shown: Shown | None  # None: no surface
    splits: Mapping[str, tuple[Part, ...]]
    noise: tuple[NoisePath, ...]  # the paths that make the noise, the largest share first, then some at random
    seen_by: Camera
    frame: tuple[int, int]  # width and height of the whole frame
    edits: tuple[TriedEdit, ...] = ()  # tried where that is asked for, the fastest first

    def as_json(self) -> dict[str, Any]:
        """Return what `primray explain --json` prints."""
        return {
            "type": "explained-pixel",
            "scene": self.scene,
            "pixel": list(self.pixel),
            "camera": self.camera,
            "value": list(self.value),
            "error": None if self.error is None else list(self.error),
            "alpha": self.alpha,
            "samples": self.samples,
            "renders": self.renders,
            "shown": None if self.shown is None else self.shown.as_json(),
            "splits": {name: [part.as_json() for part in parts] for name, parts in self.splits.items()},
            "noise": [path.as_json() for path in self.noise],
            "edits": [edit.as_json() for edit in self.edits],
        }

    def save_layer(self, path: str | os.PathLike[str], stage: Any = None) -> None:
        """Write the paths of `noise` as a USD layer: linear BasisCurves of purpose guide, with shares as opacity and numbers as
        customData. `stage`: the Usd.Stage whose up axis and unit it has; None: the stage is opened again."""
        from .. import usd
        from .drawing import save_layer

        opened = usd.open_stage(self.scene, Diagnostics()) if stage is None else stage
        usd.check_layer_output(opened, path, but=usd.LIGHT_PATHS)
        save_layer(opened, self, Path(path))

    def save_overlay(self, image: Image, path: str | os.PathLike[str]) -> None:
        """Write a PNG of a picture of the same frame and camera, with the paths of `noise` drawn over it."""
        from .drawing import save_overlay

        save_overlay(image, self, Path(path))

    def _repr_html_(self) -> str:
        """Return the text for a notebook's cell."""
        text = "\n".join(self.lines())
        return f"<pre>{escape(text)}</pre>"

    def lines(self, most: int = 8) -> list[str]:
        """Return the parts as text, of each split the `most` largest."""
        from .text import lines

        return lines(self, most)


@with_setting_names
def explain(
    stage: str | os.PathLike[str] | Any,
    x: int,
    y: int,
    settings: RenderSettings = RenderSettings(),  # noqa: B008 - immutable
    *,
    renders: int = RENDERS,
    edits: bool = False,
    **values: Unpack[SettingsValues],
) -> ExplainedPixel:
    """Return the light of the pixel in column `x` and row `y` of the frame, both from 0, from the top left, in parts.

    >>> pixel = primray.explain("shot.usda", 16, 9, resolution=(32, 18), spp=16)
    >>> pixel.samples, pixel.splits["bounce"][0].name
    (16, '1 bounce')

    The samples are those that `render` takes of it with the same settings; a target error or a time limit does not end them:
    `spp`, or 64, does. `renders` further ones of this pixel with other seeds give the errors; 0: no errors.
    `edits`: try edits that would lessen the noise, of settings and of the lights and materials that make most of it. The latter
    are edited in a session layer, which is as before afterwards.
    Fields of RenderSettings may be given by name. Errors are those of `render`, and SettingsError `explain-pixel` where the
    frame has no such pixel.
    """
    asked = with_values(settings, values)
    explainer = Explainer(KeptStage(stage, asked, writes_session=edits))
    found = explainer.explain(x, y, asked, renders=renders, edits=edits)
    Announcer(stage).tell(explainer.diagnostics)
    return found


class Explainer:
    """Pixels of one stage, which stays translated and built between them. `steps`: `further_steps` to do so by."""

    def __init__(self, kept: KeptStage, steps: CachedSteps | None = None) -> None:
        self._kept = kept
        self._steps = steps
        self.diagnostics = Diagnostics()  # of the first pixel that was prepared

    @property
    def stage(self) -> Any:
        """The Usd.Stage, as composed for the settings."""
        return self._kept.opened.stage

    def explain(
        self, x: int, y: int, settings: RenderSettings, *, renders: int = RENDERS, edits: bool = False
    ) -> ExplainedPixel:
        """Return a pixel in parts; `edits` are tried in the stage's session layer."""
        if renders < 0 or renders == 1:
            raise SettingsError("errors need 2 renders or more, or 0 for none", where="renders", code="explain-renders")
        found = explained(self.prepare(x, y, settings), renders)
        if not edits:
            return found
        from .edits import try_edits

        return replace(found, edits=try_edits(self, found, settings))

    def picture(self, settings: RenderSettings, spp: int) -> Image:
        """Return a picture of the whole frame, of at most `spp` samples a pixel."""
        given = DEFAULT_SPP if settings.spp is None else settings.spp
        asked = replace(settings, **PLAIN, region=WHOLE, aovs=(), sample_range=None, spp=min(given, spp))
        return self._kept.render(asked, None, "raise", None, (), lambda diagnostics: None)

    def prepare(self, x: int, y: int, settings: RenderSettings) -> PixelRender:
        """Return the renders of a pixel."""
        width, height = self._resolution(settings)
        if not (0 <= x < width and 0 <= y < height):
            sentence = f"the frame has {width} x {height} pixels, and none at {x} {y}; pixels of an overscan are not explained"
            raise SettingsError(sentence, where="pixel", code="explain-pixel")
        region = (x / width, 1 - (y + 1) / height, (x + 1) / width, 1 - y / height)
        return PixelRender(self.prepared(settings, region, (*NAMING_AOVS, *EXPRESSIONS)), x, y)

    def prepare_at(self, across: float, down: float, settings: RenderSettings) -> PixelRender:
        """Return the renders of the pixel at a point of the frame, in 0 to 1 from its upper left corner."""
        width, height = self._resolution(settings)
        return self.prepare(min(int(across * width), width - 1), min(int(down * height), height - 1), settings)

    def _resolution(self, settings: RenderSettings) -> tuple[int, int]:
        asked = replace(settings, **PLAIN, aovs=NAMING_AOVS, region=None)
        return self._kept.translated(asked).frame.resolution

    def prepared(self, settings: RenderSettings, region: tuple[float, float, float, float], aovs: Sequence[str]) -> Prepared:
        """Return a region of the frame, ready to be sampled; edits of the stage since the last one are taken."""
        from ..report.report import Costs

        asked, costs, told = replace(settings, **PLAIN, region=region, aovs=tuple(aovs)), Costs(), Diagnostics()
        prepared = self._kept.prepare(asked, costs, told, steps=self._steps)
        if not self.diagnostics:
            self.diagnostics = told
        return replace(prepared, settings=replace(prepared.settings, **PLAIN))


def explained(render: PixelRender, renders: int = RENDERS, check: Callable[[], None] = lambda: None) -> ExplainedPixel:
    """Return a pixel in parts. `check` is called before each further render, and ends them by what it raises."""
    prepared, span, seed = render.prepared, render.span, render.settings.seed
    film = render.film(seed, span)
    value, alpha = pixel_of(film)
    samples = list(render.samples(seed, span))
    count = span[1] - span[0]
    fewer = min(count, max(MOST_LOGGED // max(renders, 1), 2))
    others = []
    for one in other_seeds(seed, renders):
        check()
        others.append(_Other.of(render, one, (span[0], span[0] + fewer)))
    ratio, weights = fewer / count, render.weights
    values: dict[str, Mapping[str, Doubles]] = {}
    differences: dict[str, Mapping[str, Doubles]] = {}
    for key in ("light", "prim"):
        means = sums_of(samples, key).means(render.scale)
        values[key] = settled({name: mean for name, (mean, _) in means.items()}, value)
        differences[key] = {name: difference for name, (_, difference) in means.items()}
    outputs = render.outputs(film)
    for key, names in (("kind", KINDS), ("bounce", BOUNCES)):
        values[key] = settled({name: outputs[text][0] for name, text in names.items()}, value)
        differences[key] = {name: outputs[text][1] for name, text in names.items()}
    expressions = {"kind": KINDS, "bounce": BOUNCES}
    splits = {
        key: parts_of(
            values[key],
            differences[key],
            [other.values[key] for other in others],
            weights,
            ratio=ratio,
            expressions=expressions.get(key),
        )
        for key in SPLITS
    }
    error = None
    if others:
        error = color_of(np.array([other.pixel for other in others]).std(axis=0, ddof=1) * ratio**0.5)
    return ExplainedPixel(
        scene=prepared.stage,
        pixel=(render.x, render.y),
        camera=prepared.camera.path,
        value=color_of(value),
        error=error,
        alpha=alpha,
        samples=count,
        renders=len(others),
        shown=_shown(render),
        splits=splits,
        noise=noise_paths(render, samples),
        seen_by=prepared.camera,
        frame=prepared.frame.resolution,
    )


@dataclass(frozen=True)
class _Other:
    """A render of the pixel with another seed: its value (3,), and parts by split and name (3,)."""

    pixel: Doubles
    values: Mapping[str, Mapping[str, Doubles]]

    @classmethod
    def of(cls, render: PixelRender, seed: int, span: tuple[int, int]) -> _Other:
        film = render.film(seed, span)
        outputs = render.outputs(film)
        values: dict[str, Mapping[str, Doubles]] = {
            "kind": {name: outputs[text][0] for name, text in KINDS.items()},
            "bounce": {name: outputs[text][0] for name, text in BOUNCES.items()},
        }
        samples = list(render.samples(seed, span))
        values |= {key: _means(samples, key, render.scale) for key in ("light", "prim")}
        return cls(pixel_of(film)[0].astype(np.float64), values)


def _means(samples: Sequence[Sample], key: str, scale: float) -> dict[str, Doubles]:
    return {name: mean for name, (mean, _) in sums_of(samples, key).means(scale).items()}


def _shown(render: PixelRender) -> Shown | None:
    from .. import core

    scene = render.prepared.scene
    point = core.pick(scene, 0, 0, render.settings)
    if point is None:
        return None
    names: Mapping[str, str] = {} if scene.record is None else scene.record.names
    prim, material = (names.get(path, path) for path in (point.prim, point.material))
    return Shown(prim, point.instance, material, point.distance, color_of(point.position))
