"""A stage to an image: opens and translates it, loads textures, builds the scene and renders it, with a report of all that.

What does the work is imported when a render starts; importing this module costs nothing.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import chain, repeat
from typing import TYPE_CHECKING, Any, Literal

from .errors import LimitError, RenderCancelled, SettingsError
from .interruption import Interruption, interruption
from .settings import RenderSettings

if TYPE_CHECKING:
    from . import core
    from .checkpointing import Checkpointing
    from .composition import Composition
    from .description import Camera, SceneDescription, TextureFile
    from .diagnostics import Diagnostics
    from .image import Image
    from .report import Costs
    from .sampling import Progress, Sampling
    from .summary import ImageSize
    from .texture import Texture

FILM_BYTES = 118  # a pixel: both replicates' exact sums and counts, film.hpp

OnInterrupt = Literal["raise", "partial"]


def render(
    stage: str | os.PathLike[str] | Any,
    settings: RenderSettings = RenderSettings(),  # noqa: B008 - immutable
    *,
    progress: Progress | None = None,
    on_interrupt: OnInterrupt = "raise",
    checkpointing: Checkpointing | None = None,
) -> Image:
    """Render a stage, given as a Usd.Stage or as the path of one.

    Ctrl-C raises KeyboardInterrupt and `progress` returning False raises RenderCancelled, unless `on_interrupt` is
    "partial": then the picture made so far comes back, its report saying "interrupted". A checkpoint is written before either.
    """
    return next(render_frames(stage, [settings], progress=progress, on_interrupt=on_interrupt, checkpointing=[checkpointing]))


def render_frames(
    stage: str | os.PathLike[str] | Any,
    frames: Iterable[RenderSettings],
    *,
    progress: Progress | None = None,
    on_interrupt: OnInterrupt = "raise",
    checkpointing: Iterable[Checkpointing | None] = (),
) -> Iterator[Image]:
    """Render one stage several times, opening it once (the first report has the time of that).

    `checkpointing`, where given, has one item a frame.
    """
    from . import usd
    from .diagnostics import Diagnostics
    from .report import Costs

    costs = Costs()
    opening = Diagnostics()
    opened: Composition | None = None
    for settings, saved in zip(frames, chain(checkpointing, repeat(None)), strict=False):
        if opened is None:
            opened = settings.composition
            with costs.stage("open"):
                stage = usd.open_stage(stage, opening, opened)
        elif settings.composition != opened:
            raise SettingsError("all frames must compose the stage alike: variants, load, mask, session_layer")
        yield _render_one(stage, opening, settings, costs, progress, on_interrupt, saved)
        costs = Costs()


def _render_one(
    stage: Any,
    opening: Diagnostics,
    settings: RenderSettings,
    costs: Costs,
    progress: Progress | None,
    on_interrupt: OnInterrupt,
    checkpointing: Checkpointing | None,
) -> Image:
    from .diagnostics import Diagnostics
    from .sampling import Sampling

    diagnostics = Diagnostics()
    if checkpointing is not None:
        checkpointing.check()
    prepared = prepare(stage, opening, settings, costs, diagnostics, fingerprinted=checkpointing is not None)
    saved: dict[str, Any] = {}
    with costs.stage("render"), interruption() as asked:
        watched = _Watched(progress, asked)
        if checkpointing is None:
            sampling = Sampling.begin(prepared.scene, prepared.settings)
            sampling.run(watched)
        else:
            sampling, saved = checkpointing.run(prepared, list(diagnostics), watched)
        sampling.film.image()
    assert sampling.stop is not None
    if asked.asked:  # even if all was done by then, frames may follow
        sampling.stop = replace(sampling.stop, reason="interrupted")
    if sampling.stop.reason == "interrupted" and on_interrupt == "raise":
        if watched.stopped:
            raise RenderCancelled("the render was stopped by its progress callback")
        raise KeyboardInterrupt

    if saved:
        costs.checkpoint = saved
    return picture_of(prepared, sampling, costs, diagnostics)


def picture_of(prepared: Prepared, sampling: Sampling, costs: Costs, diagnostics: Diagnostics) -> Image:
    """What a render that has stopped made, with its report; what sampling has to tell goes to `diagnostics`."""
    from .image import Image, pixels_sha256
    from .report import header_of, make_report

    film, failed = sampling.film, (costs.checkpoint or {}).get("failed")
    if failed:
        diagnostics.add("checkpoint-unwritten", "", failed)
    if film.invalid_samples:
        diagnostics.add("invalid-samples", "", f"{film.invalid_samples} of {film.samples} samples are left out")
    pixels, errors = film.image()
    as_json = [diagnostic.as_json() for diagnostic in diagnostics]
    report = make_report(sampling, costs, prepared.counts, as_json, core_says(prepared.scene), pixels_sha256(pixels))
    return Image(pixels, report, header_of(report), prepared.camera, errors=errors)


@dataclass(frozen=True)
class Prepared:
    """A scene that is built, and what the stage and the machine made of the settings."""

    scene: core.CoreScene
    settings: RenderSettings
    counts: dict[str, int]
    camera: Camera
    fingerprint: dict[str, str]  # empty unless it was asked for


def prepare(
    stage: Any,
    opening: Diagnostics,
    settings: RenderSettings,
    costs: Costs,
    diagnostics: Diagnostics,
    *,
    fingerprinted: bool = False,
) -> Prepared:
    """Translate an opened stage, load its textures and build its scene; what there is to tell goes to `diagnostics`."""
    from . import core, usd
    from .fingerprint import fingerprint
    from .report import resolve_settings
    from .summary import counts, summary

    with costs.stage("translate"):
        description, translating = usd.translate(stage, settings)
        diagnostics.extend([*opening, *translating])
        description, textures = load_textures(description, diagnostics, usd.read_asset)
        if settings.strict:
            diagnostics.raise_if_strict()
    images = image_sizes(textures)
    check_memory(description, settings, images, film_copies=int(fingerprinted))
    digests = fingerprint(description, textures) if fingerprinted else {}
    with costs.stage("dice"):
        description, limits = core.dice(description, settings)
    for code, path, message in limits:
        diagnostics.add(code, path, message)

    settings = resolve_settings(settings, description)
    counted = counts(summary(description, settings.dicing_rate, images))
    shapes, description = list(description.shapes), replace(description, shapes=())
    with costs.stage("build"):
        scene = core.build(description, textures, settings, shapes)
    for code, path, message in scene.warnings:
        diagnostics.add(code, path, message)
    if settings.strict:
        diagnostics.raise_if_strict()
    return Prepared(scene, settings, counted, description.camera, digests)


def core_says(scene: core.CoreScene) -> dict[str, Any]:
    """The core's own lines of a report."""
    from . import core

    return {"isa": core.isa(), "lanes": core.lanes(), "versions": core.versions(), "features": list(scene.features)}


class _Watched:
    """The caller's progress callback, and whether it or a signal asked to stop."""

    def __init__(self, progress: Progress | None, asked: Interruption) -> None:
        self.progress = progress
        self.asked = asked
        self.stopped = False

    def __call__(self, fraction: float, samples: int, rays: int) -> bool:
        if self.progress is not None and self.progress(fraction, samples, rays) is False:
            self.stopped = True
        return not self.stopped and not self.asked.asked


def load_textures(
    description: SceneDescription, diagnostics: Diagnostics, read: Callable[[str], bytes] | None
) -> tuple[SceneDescription, dict[TextureFile, list[tuple[int, Texture]]]]:
    """The images of every file that could be read (with their tiles' numbers, or 0), and the description without the domes
    whose texture could not; each file that could not is a diagnostic."""
    from .light_textures import with_read_textures
    from .texture_outside import note_textures_outside
    from .texture_set import load_texture_set

    textures = load_texture_set(description, diagnostics, read)
    note_textures_outside(description, textures, diagnostics)
    return replace(description, lights=with_read_textures(description.lights, textures, diagnostics)), textures


def image_sizes(textures: dict[TextureFile, list[tuple[int, Texture]]]) -> list[ImageSize]:
    """Of images that are held once, whoever reads them."""
    from .summary import ImageSize

    different = {id(image): image for images in textures.values() for _, image in images}
    return [ImageSize(i.shape[1], i.shape[0], i.shape[2], i.stored.itemsize) for i in different.values()]


def check_memory(
    description: SceneDescription, settings: RenderSettings, images: list[ImageSize], film_copies: int = 0
) -> None:
    """LimitError if the scene is estimated to need more memory than is allowed, before anything of it is built.

    A copy of the film is what a checkpoint is written from, or read into.
    """
    limit_bytes = settings.max_memory_bytes
    if limit_bytes is None:
        return
    from .summary import summary

    width, height = description.resolution
    needed = summary(description, settings.dicing_rate, images).memory_bytes + film_copies * FILM_BYTES * width * height
    if needed > limit_bytes:
        sentence = f"the scene needs about {needed / 2**20:.0f} MiB, {limit_bytes / 2**20:.0f} MiB are allowed"
        raise LimitError(sentence, code="memory-limit")
